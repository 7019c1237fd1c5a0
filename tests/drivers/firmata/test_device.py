"""The glove's driver against literal bytes: its start, forces by a known characteristic, gaps, and what is wrong."""

import math
from datetime import UTC, datetime

import pytest

from drivers.firmata.device import DEAD_BIT, SATURATED_BIT, FirmataBoard, trouble_of
from rig.config.glove import FingerCalibration, GloveCalibration
from rig.config.products.firmata_glove import FirmataGlove
from rig.errors import DeviceError
from rig.input_streams import InputSample, input_stream
from tests.drivers.scripted_port import ScriptedPort

FIRMWARE = bytes.fromhex("f0 79 02 05 53 00 74 00 64 00 f7")  # "Std" 2.5
SIX_INPUTS = bytes.fromhex("f0 6a 7f 7f 00 01 02 03 04 05 f7")
KNOWN = FingerCalibration(loads_N=(0.0, 2.0, 10.0), counts=(40.0, 140.0, 540.0), noise_counts=0.5, repeatability=0.02)
CALIBRATION = GloveCalibration(
    product="firmata-glove", firmware="Std 2.5", date=datetime(2026, 1, 1, tzinfo=UTC), fingers={"thumb": KNOWN}
)
MS = 1_000_000


def answered(written: bytes) -> bytes:
    return {b"\xf0\x79\xf7": FIRMWARE, b"\xf0\x69\xf7": SIX_INPUTS}.get(written, b"")


def started(config: FirmataGlove, port: ScriptedPort | None = None) -> tuple[FirmataBoard, ScriptedPort]:
    port = port or ScriptedPort(answered)
    board = FirmataBoard(port, config, reset_s=0.0)
    board.start()
    return board, port


def glove(**more: object) -> FirmataGlove:
    return FirmataGlove.model_validate({"fingers": {"thumb": 0}, "of_fingers": CALIBRATION} | more)


def one(board: FirmataBoard, port: ScriptedPort, data: str, at_ms: int) -> list[InputSample]:
    port.push(bytes.fromhex(data))
    return list(board.poll(at_ms * MS))


def test_the_start_names_the_board_and_asks_for_what_it_wants() -> None:
    board, port = started(glove(fingers={"thumb": 0, "index": 2}))
    assert (board.identity.product, board.identity.firmware) == ("firmata-glove", "Std 2.5")
    # 20 ms, and inputs 0 and 2.
    assert port.written[-1] == bytes.fromhex("f0 7a 14 00 f7 c0 01 c2 01")
    board.close()
    assert port.written[-1] == bytes.fromhex("c0 00 c2 00")


def test_forces_go_by_straight_lines_between_the_weights() -> None:
    board, port = started(glove())
    # 90 counts lie half way between 40 and 140, so 1 N; 340 half way between 140 and 540, so 6 N.
    (low,) = one(board, port, "e0 5a 00", 1000)
    (high,) = one(board, port, "e0 54 02", 1020)
    assert [low.values, high.values] == [(1.0, 90.0), (6.0, 340.0)]
    assert (low.seq, high.seq, low.valid, low.status) == (0, 1, 1, 0)
    # Three bytes of ten bits at 57600 bit/s are 0.52 ms; what the adapter holds back nobody knows.
    assert 0.52e6 <= low.arrival_ns - low.capture_ns <= 0.53e6
    assert low.uncertainty_ns == 16 * MS
    assert input_stream(0, "glove", glove().channels).pack(low.row)


def test_below_the_zero_there_is_no_force_and_beyond_the_heaviest_weight_none_is_known() -> None:
    board, port = started(glove())
    (idle,) = one(board, port, "e0 1e 00", 1000)  # 30
    (beyond,) = one(board, port, "e0 21 04", 1020)  # 545
    (full,) = one(board, port, "e0 7f 07", 1040)  # 1023
    assert idle.values[0] == 0.0
    for sample in (beyond, full):
        assert math.isnan(sample.values[0])
        assert (sample.valid, sample.status) == (0, 1 << SATURATED_BIT)


def test_a_cut_wire_is_told_from_an_unloaded_finger() -> None:
    board, port = started(glove())
    (cut,) = one(board, port, "e0 00 00", 1000)
    assert (cut.valid, cut.status) == (0, 1 << DEAD_BIT)
    flat = KNOWN.model_copy(update={"counts": (2.0, 140.0, 540.0)})
    assert trouble_of(0, flat) is None  # one that reads nothing unloaded: nobody can tell


def test_a_finger_without_calibration_has_counts_and_no_force_and_that_is_said() -> None:
    board, port = started(glove(fingers={"thumb": 0, "ring": 1}))
    port.push(bytes.fromhex("e0 5a 00"))
    (sample,) = one(board, port, "e1 5a 00", 1000)
    assert sample.values[0] == 1.0 and math.isnan(sample.values[1]) and sample.values[2:] == (90.0, 90.0)
    assert "no calibration of ring" in board.concern() and "rig calibrate glove" in board.concern()
    assert started(glove())[0].concern() == ""


def test_samples_that_do_not_come_are_counted_by_their_time() -> None:
    board, port = started(glove())
    one(board, port, "e0 5a 00", 1000)
    one(board, port, "e0 5a 00", 1020)
    assert board.counters.device_lost == 0
    one(board, port, "e0 5a 00", 1100)  # four intervals: three are missing
    assert board.counters.device_lost == 3


def test_half_a_sample_is_no_sample() -> None:
    board, port = started(glove(fingers={"thumb": 0, "index": 2}))
    # Input 2 of the first turn was lost on the line.
    assert len(one(board, port, "e0 5a 00 e0 5b 00 e2 10 00", 1000)) == 1
    assert board.counters.device_lost == 1


def test_no_board_answers() -> None:
    port = ScriptedPort()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("drivers.firmata.device.ASK_S", 0.01)
        with pytest.raises(DeviceError, match=r"no board with Firmata answered .* put StandardFirmata on the board"):
            FirmataBoard(port, glove(), reset_s=0.0).start()
    assert port.written == [bytes.fromhex("f0 79 f7")] * 6


def test_a_board_that_names_itself_after_its_reset_is_not_asked() -> None:
    port = ScriptedPort(lambda written: SIX_INPUTS if written == b"\xf0\x69\xf7" else b"")
    port.push(bytes.fromhex("f9 02 05") + FIRMWARE)
    board = FirmataBoard(port, glove(), reset_s=0.5)
    board.start()
    assert port.written[0] == bytes.fromhex("f0 69 f7")


def test_a_pin_that_the_board_has_not() -> None:
    with pytest.raises(DeviceError, match="has no analogue input 7, which fingers names"):
        started(glove(fingers={"thumb": 0, "index": 7}))


def test_a_board_without_a_name() -> None:
    port = ScriptedPort(lambda written: bytes.fromhex("f0 79 f7") if written == b"\xf0\x79\xf7" else b"")
    with pytest.raises(DeviceError, match="does not say what firmware"):
        started(glove(), port)


def test_a_calibration_that_does_not_rise_is_refused() -> None:
    with pytest.raises(ValueError, match="must rise together"):
        FingerCalibration(loads_N=(0.0, 2.0, 10.0), counts=(40.0, 30.0, 540.0), noise_counts=0.5, repeatability=0.0)
    with pytest.raises(ValueError, match="3 loads and 4 counts"):
        FingerCalibration(loads_N=(0.0, 2.0, 10.0), counts=(1.0, 3.0, 5.0, 9.0), noise_counts=0.5, repeatability=0.0)
