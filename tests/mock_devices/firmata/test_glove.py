"""The simulated hand and board: presses by their profile, converters by the divider's law, and requests by bytes."""

import pytest

from mock_devices.faults.inputs import GLOVE_FAULTS, SWITCH_FAULTS
from mock_devices.faults.wires import faults_of
from mock_devices.firmata.glove import GloveFigures, GlovePlant
from mock_devices.firmata.mock import FirmataMock
from mock_devices.testing.wire import MemoryWire
from rig.errors import UsageError

QUIET = GloveFigures(noise_counts=0.0, fabric_N=0.0)


def test_a_press_rises_steadily_rests_and_is_let_go() -> None:
    hand = GlovePlant(figures=QUIET)
    hand.press((8.0,), from_s=0.0)
    # It begins after 4 s, rises at 4 N/s for 2 s, rests for 0.2 s and is let go in 0.25 s.
    times_N = {3.9: 0.0, 5.0: 4.0, 6.0: 8.0, 6.1: 8.0, 6.325: 4.0, 6.5: 0.0}
    assert {at: hand.pressed_N(at) for at in times_N} == pytest.approx(times_N, abs=1e-9)


def test_a_converter_reads_the_dividers_share() -> None:
    hand = GlovePlant(figures=QUIET, weights_N={0: 12.0, 1: 4.0})
    assert [hand.counts(finger, 0.0) for finger in range(4)] == [512, 256, 0, 0]  # 1023 / 2 and 1023 / 4
    hand.cut = {0}
    assert hand.counts(0, 0.0) == 0


def test_it_answers_by_the_protocol_and_sends_its_inputs_in_turn() -> None:
    wire = MemoryWire()
    board = FirmataMock(wire, GlovePlant(figures=QUIET, weights_N={0: 12.0}), 0)
    wire.said = bytes.fromhex("f9 f0 79 f7 f0 69 f7 f0 7a 14 00 f7 c1 01 c0 01")
    board.receive(0)
    said = wire.take()
    assert said.startswith(bytes.fromhex("f9 02 05 f0 79 02 05 53 00 74 00"))
    assert said.endswith(bytes.fromhex("f0 6a") + b"\x7f" * 14 + bytes(range(6)) + b"\xf7")
    assert board.due_ns == 20_000_000
    board.tick(20_000_000)
    assert wire.take() == bytes.fromhex("e0 00 04 e1 00 00")  # 512, 0
    assert board.due_ns == 40_000_000
    wire.said = bytes.fromhex("c0 00 c1 00")
    board.receive(30_000_000)
    assert board.due_ns > 1 << 60


def test_an_interval_below_ten_milliseconds_is_ten() -> None:
    wire = MemoryWire()
    board = FirmataMock(wire, GlovePlant(), 0)
    wire.said = bytes.fromhex("f0 7a 02 00 f7 c0 01")
    board.receive(0)
    assert board.due_ns == 10_000_000


def test_endless_requests_are_not_kept() -> None:
    wire = MemoryWire()
    board = FirmataMock(wire, GlovePlant(), 0)
    wire.said = b"\xf0" + b"\x01" * 500 + bytes.fromhex("f9")
    board.receive(0)
    assert wire.take() == bytes.fromhex("f9 02 05")


def test_what_is_done_to_it_by_name() -> None:
    board = FirmataMock(MemoryWire(), GlovePlant(figures=QUIET), 0)
    faults = faults_of(board, GLOVE_FAULTS)
    faults["weight"].apply("1=4.0")
    assert board.plant.counts(1, 0.0) == 256
    faults["weight"].apply(False)
    assert board.plant.counts(1, 0.0) == 0
    faults["presses"].apply("8,9")
    assert [press.peak_N for press in board.plant.presses] == [8.0, 9.0]
    faults["cut"].apply(2.0)
    assert board.plant.cut == {2}
    for kind, wrong in (("weight", "heavy"), ("weight", "0=99"), ("presses", "a,b"), ("cut", 9.0)):
        with pytest.raises(UsageError, match="this fault takes"):
            faults[kind].apply(wrong)
    assert set(SWITCH_FAULTS) == {"press", "unplug"}
