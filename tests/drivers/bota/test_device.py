"""The session of a Bota SensONE: against scripted bytes, then against the mock in another process."""

import os
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from drivers.bota import device
from drivers.bota.codec import ForceFrame, encode_frame
from drivers.bota.device import BotaSensOne
from drivers.ports import PortClosed, open_port
from drivers.roles import Identity
from mock_devices.testing.clock import long_ago
from mock_devices.testing.force import WRENCH, ServedMock, collect
from rig.config.products.bota_sensone import BotaWiring
from rig.errors import DeviceError, UsageError
from tests.drivers.scripted_port import ScriptedPort
from tests.drivers.silence import await_silence

BOOT = b"c,0,1,0,4\r\nApp Init\r\nname: BFT-SENS-SER-M8\r\nS/N: 000271\r\nFW version: 1.0.6\r\n"
PERIOD_US = 996
MS = 1_000_000


def frame(time_us: int, status: int = 0, fz_N: float = -3.0) -> bytes:
    return encode_frame(ForceFrame(status, 1.5, -2.25, fz_N, 0.125, -0.25, 0.5, time_us, 25.0))


def sensor_like(command: bytes) -> bytes:
    """What a healthy sensor answers to each command of the start-up."""
    if command == b"#":
        return BOOT
    acknowledged = f"r,0,{command[:1].decode()},0\r\n".encode()
    return acknowledged + frame(1000) if command == b"R" else acknowledged


def started(
    answer: Callable[[bytes], bytes] = sensor_like, config: BotaWiring | None = None
) -> tuple[BotaSensOne, ScriptedPort]:
    port = ScriptedPort(answer)
    sensor = BotaSensOne(port, config or BotaWiring(), long_ago)
    try:
        sensor.start()
    except DeviceError:
        sensor.close()
        raise
    return sensor, port


@pytest.fixture
def running() -> Iterator[tuple[BotaSensOne, ScriptedPort]]:
    """A started sensor whose first sample has been read."""
    sensor, port = started()
    assert len(sensor.poll(0)) == 1
    yield sensor, port
    sensor.close()


@pytest.fixture(autouse=True)
def short_waits(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    """A scripted sensor answers at once or never."""
    if request.node.get_closest_marker("bench") is None:
        for name in ("BOOT_S", "ACK_S", "FIRST_FRAMES_S"):
            monkeypatch.setattr(device, name, 0.05)
        monkeypatch.setattr(device, "LISTEN_S", 0.0)


def test_start_resets_configures_and_runs_the_sensor() -> None:
    sensor, port = started()
    assert port.written == [b"#", b"C", b"c,0,1,0,4", b"f,51,0,0,1", b"R"]
    assert sensor.identity == Identity(
        "BFT-SENS-SER-M8", "000271", "1.0.6", {"rate": "1003.9 Hz", "sinc": "51", "baud": "460800"}
    )
    assert sensor.period_ns == 996_094
    sensor.close()


def test_the_first_frame_waited_for_is_not_lost() -> None:
    sensor, _ = started()
    (sample,) = sensor.poll(10**18)
    assert (sample.seq, sample.device_us, sample.valid) == (0, 1000, 1)
    assert sample.arrival_ns < 10**18
    assert sample[4:] == (1.5, -2.25, -3.0, 0.125, -0.25, 0.5, 25.0, 0, 1)
    assert sensor.counters.discarded_bytes == 0
    sensor.close()


def test_rate_and_baud_of_the_configuration_reach_the_sensor() -> None:
    sensor, port = started(config=BotaWiring(rate_Hz=100, baud=115_200))
    assert port.written[2:4] == [b"c,0,1,0,2", b"f,512,0,0,1"]
    assert sensor.period_ns == 10_000_000
    sensor.close()


def test_the_first_command_after_a_reset_is_repeated_where_it_is_lost() -> None:
    heard: list[bytes] = []

    def deaf_once(command: bytes) -> bytes:
        heard.append(command)
        return b"" if heard.count(b"C") == 1 and command == b"C" else sensor_like(command)

    sensor, port = started(deaf_once)
    assert port.written[:3] == [b"#", b"C", b"C"]
    sensor.close()


@pytest.mark.parametrize("number", range(5))
@pytest.mark.parametrize("damage", [b"", b"r,0,\xd2\r\n", b"r,0,c,1\r\nr,0,f,1\r\nr,0,R,1\r\nr,0,C,1\r\n"])
def test_any_one_damaged_answer_during_start_is_asked_for_again(number: int, damage: bytes) -> None:
    """Lost, not understood, or a refusal of what arrived damaged at the sensor."""
    heard: list[bytes] = []

    def damaged_once(command: bytes) -> bytes:
        heard.append(command)
        return (damage or b"?") if len(heard) == number + 1 else sensor_like(command)

    sensor, port = started(damaged_once)
    commands = [b"#", b"C", b"c,0,1,0,4", b"f,51,0,0,1", b"R"]
    assert port.written == [*commands[: number + 1], *commands[number:]]
    assert len(sensor.poll(0)) == 1
    sensor.close()


def test_a_boot_text_with_a_damaged_name_is_asked_for_again() -> None:
    texts = iter([BOOT.replace(b"BFT", b"BGT"), BOOT])
    sensor, _ = started(lambda command: next(texts) if command == b"#" else sensor_like(command))
    assert sensor.identity.product == "BFT-SENS-SER-M8"
    sensor.close()


def test_a_silent_device_is_one_sentence() -> None:
    with pytest.raises(DeviceError, match=r"bota-sensone at /dev/scripted: no boot text .* nothing came; check power"):
        started(lambda _: b"")


def test_a_device_that_talks_otherwise_is_one_sentence() -> None:
    with pytest.raises(DeviceError, match=r"no boot text .* 8 bytes came .*460800 baud"):
        started(lambda _: b"ERROR01\r")


def test_another_makers_sensor_is_one_sentence() -> None:
    with pytest.raises(DeviceError, match="is a 'KMS40', not a Bota sensor"):
        started(lambda command: BOOT.replace(b"BFT-SENS-SER-M8", b"KMS40") if command == b"#" else b"")


def test_a_refused_command_is_one_sentence() -> None:
    with pytest.raises(DeviceError, match="refused b'f,51,0,0,1' with code 1, expected 0"):
        started(lambda command: b"r,0,f,1\r\n" if command[:1] == b"f" else sensor_like(command))


def test_a_command_without_an_answer_is_one_sentence() -> None:
    with pytest.raises(DeviceError, match=r"no answer to b'R' within 0.05 s, nothing came"):
        started(lambda command: b"" if command == b"R" else sensor_like(command))


def test_a_sensor_that_runs_without_frames_is_one_sentence() -> None:
    with pytest.raises(DeviceError, match=r"no frame within .* s of run mode"):
        started(lambda command: b"r,0,R,0\r\n" if command == b"R" else sensor_like(command))


def test_a_sensor_that_never_vouches_for_a_reading_is_one_sentence() -> None:
    with pytest.raises(DeviceError, match=r"no valid reading within .* status <StatusBits.INVALID: 4>"):
        started(lambda command: b"r,0,R,0\r\n" + frame(1000, status=4) if command == b"R" else sensor_like(command))


@pytest.mark.parametrize(
    ("config", "sentence"),
    [
        (BotaWiring(rate_Hz=500), "1004, 800, 400, 250, 200, 100 Hz"),
        (BotaWiring(baud=19_200), "takes 9600, 57600, 115200, 230400, 460800"),
        (BotaWiring(rate_Hz=1000, baud=230_400), "230400 baud carries at most 623 frames/s"),
    ],
)
def test_settings_that_cannot_be_had_are_refused_and_the_port_is_given_back(config: BotaWiring, sentence: str) -> None:
    port = ScriptedPort()
    with pytest.raises(UsageError, match=sentence):
        BotaSensOne(port, config)
    assert port.closed
    assert port.written == []


def test_samples_are_numbered_without_gaps_and_carry_both_times(running: tuple[BotaSensOne, ScriptedPort]) -> None:
    sensor, port = running
    port.push(frame(1000 + PERIOD_US) + frame(1000 + 2 * PERIOD_US))
    samples = sensor.poll(10**15)
    assert [sample.seq for sample in samples] == [1, 2]
    assert [sample.arrival_ns for sample in samples] == [10**15, 10**15]
    assert [sample.device_us for sample in samples] == [1996, 2992]
    assert samples[1].capture_ns - samples[0].capture_ns == PERIOD_US * 1000
    assert all(sample.capture_ns <= sample.arrival_ns for sample in samples)
    assert list(sensor.poll(10**15 + 1)) == []


def test_capture_precedes_arrival_by_the_configured_latency() -> None:
    sensor, _ = started(config=BotaWiring(latency_ms=2.5))
    (sample,) = sensor.poll(0)
    assert sample.arrival_ns - sample.capture_ns == 2_500_000
    sensor.close()


def test_gaps_of_the_sensors_clock_are_counted_as_lost_frames(running: tuple[BotaSensOne, ScriptedPort]) -> None:
    sensor, port = running
    port.push(frame(1000 + 1 * PERIOD_US) + frame(1000 + 4 * PERIOD_US) + frame(1000 + 5 * PERIOD_US))
    assert [sample.seq for sample in sensor.poll(1)] == [1, 2, 3]
    assert sensor.counters.device_lost == 2


def test_a_frame_with_a_wrong_checksum_is_counted_there_and_as_lost(running: tuple[BotaSensOne, ScriptedPort]) -> None:
    sensor, port = running
    spoilt = frame(1000 + PERIOD_US)[:-1] + b"\x00"
    port.push(spoilt + frame(1000 + 2 * PERIOD_US))
    assert len(sensor.poll(1)) == 1
    assert (sensor.counters.checksum_errors, sensor.counters.device_lost) == (1, 1)


def test_the_sensors_clock_may_wrap() -> None:
    last = 0xFFFF_FFFF - 100
    sensor, port = started(lambda command: b"r,0,R,0\r\n" + frame(last) if command == b"R" else sensor_like(command))
    port.push(frame((last + PERIOD_US) & 0xFFFF_FFFF))
    assert [sample.device_us for sample in sensor.poll(1)] == [last, last + PERIOD_US]
    assert sensor.counters.device_lost == 0
    sensor.close()


def test_a_clock_that_goes_back_means_the_sensor_restarted(running: tuple[BotaSensOne, ScriptedPort]) -> None:
    sensor, port = running
    port.push(frame(500))
    with pytest.raises(DeviceError, match=r"its clock went back by 0.5 ms: it restarted by itself"):
        sensor.poll(1)


def test_a_frame_that_the_line_brings_twice_is_dropped_and_counted(running: tuple[BotaSensOne, ScriptedPort]) -> None:
    sensor, port = running
    port.push(frame(1000 + PERIOD_US) * 2 + frame(1000 + 2 * PERIOD_US))
    port.push(frame(1000 + 2 * PERIOD_US))
    assert [(sample.seq, sample.device_us) for sample in sensor.poll(1)] == [(1, 1996), (2, 2992)]
    assert (sensor.counters.repeated, sensor.counters.device_lost) == (2, 0)


def test_frames_that_came_after_the_look_at_the_clock_are_dated_by_a_later_one() -> None:
    """A host stops for 5 ms between clock and read: dated by the clock alone, all frames since would be 5 ms early."""
    port, clock_ns = ScriptedPort(sensor_like), 10 * MS
    sensor = BotaSensOne(port, BotaWiring(), lambda: clock_ns)
    sensor.start()
    for number in range(1, 6):
        port.push(frame(1000 + number * PERIOD_US))
    clock_ns += 5 * PERIOD_US * 1000
    assert sensor.poll(10 * MS)[-1].arrival_ns == clock_ns
    clock_ns += PERIOD_US * 1000
    port.push(frame(1000 + 6 * PERIOD_US))
    assert sensor.poll(clock_ns)[0].capture_ns == clock_ns
    sensor.close()


def test_capture_times_go_upwards_through_a_new_start(running: tuple[BotaSensOne, ScriptedPort]) -> None:
    sensor, port = running
    port.push(frame(5_000_000))
    before = sensor.poll(10**15)
    sensor.start()
    port.push(frame(1000 + PERIOD_US))
    captures = [sample.capture_ns for sample in (*before, *sensor.poll(10**15))]
    assert all(late > early for early, late in pairwise(captures))


def test_a_sensor_may_be_started_again_and_goes_on_numbering(running: tuple[BotaSensOne, ScriptedPort]) -> None:
    sensor, port = running
    port.push(frame(5_000_000))
    assert [sample.seq for sample in sensor.poll(1)] == [1]
    sensor.start()
    assert [(sample.seq, sample.device_us) for sample in sensor.poll(2)] == [(2, 1000)]


@pytest.mark.parametrize(("status", "valid"), [(0, 1), (1, 1), (2, 0), (4, 0), (8, 0), (6, 0)])
def test_status_bits_decide_whether_a_sample_is_valid(
    running: tuple[BotaSensOne, ScriptedPort], status: int, valid: int
) -> None:
    sensor, port = running
    port.push(frame(1000 + PERIOD_US, status))
    (sample,) = sensor.poll(1)
    assert (sample.status, sample.valid) == (status, valid)


@pytest.mark.parametrize("fz_N", [float("nan"), float("inf"), float("-inf")])
def test_a_force_that_is_no_number_is_not_valid(running: tuple[BotaSensOne, ScriptedPort], fz_N: float) -> None:
    sensor, port = running
    port.push(frame(1000 + PERIOD_US, fz_N=fz_N))
    assert [sample.valid for sample in sensor.poll(1)] == [0]


def test_close_takes_the_sensor_out_of_run_mode_and_may_be_called_twice() -> None:
    sensor, port = started()
    sensor.close()
    sensor.close()
    assert port.closed
    assert port.written[-1] == b"C"
    with pytest.raises(PortClosed):
        sensor.poll(0)


def opened(mock: ServedMock, config: BotaWiring | None = None) -> BotaSensOne:
    return BotaSensOne(open_port(mock.endpoint, BotaSensOne.DEFAULT_BAUD), config or BotaWiring())


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
class TestAgainstTheMockInAnotherProcess:
    def test_a_session_streams_at_its_rate_and_accounts_for_every_frame(self, bota: ServedMock) -> None:
        sensor = opened(bota)
        sensor.start()
        samples = collect(sensor, lambda got: len(got) >= 500)
        sensor.close()
        assert [sample.seq for sample in samples] == list(range(len(samples)))
        assert {sample[4:10] for sample in samples} == {WRENCH}
        elapsed_periods = round((samples[-1].device_us - samples[0].device_us) * 1000 / sensor.period_ns)
        assert elapsed_periods == len(samples) - 1 + sensor.counters.device_lost
        assert sensor.counters.frames == len(samples)
        assert all(early.capture_ns <= late.capture_ns for early, late in pairwise(samples))

    def test_an_abandoned_session_is_taken_over_while_it_streams(self, bota: ServedMock) -> None:
        first = open_port(bota.endpoint, BotaSensOne.DEFAULT_BAUD)
        abandoned = BotaSensOne(first, BotaWiring())
        abandoned.start()
        first.close()
        sensor = opened(bota, BotaWiring(rate_Hz=400))
        sensor.start()
        samples = collect(sensor, lambda got: len(got) >= 50)
        sensor.close()
        assert sensor.period_ns == 2_500_000
        assert all(sample.valid for sample in samples)

    def test_another_load_and_another_status_arrive(self, bota: ServedMock) -> None:
        sensor = opened(bota)
        sensor.start()
        bota.load(0.0, 0.0, -12.5, 0.0, 0.0, 0.0)
        samples = collect(sensor, lambda got: bool(got) and got[-1].fz_N == -12.5)
        bota.set(invalid=True)
        samples = collect(sensor, lambda got: bool(got) and not got[-1].valid)
        sensor.close()
        assert samples[-1].status == 4

    def test_spoilt_checksums_are_counted_and_seen_as_lost(self, bota: ServedMock) -> None:
        sensor = opened(bota)
        sensor.start()
        bota.set(corrupt_every=5)
        collect(sensor, lambda _: sensor.counters.checksum_errors >= 10)
        sensor.close()
        assert sensor.counters.device_lost >= sensor.counters.checksum_errors - 1

    def test_a_sensor_that_falls_silent_gives_no_samples_and_no_error(self, bota: ServedMock) -> None:
        sensor = opened(bota)
        sensor.start()
        bota.set(silent=True)
        await_silence(sensor)
        bota.set(silent=False)
        collect(sensor, lambda got: len(got) >= 1)
        sensor.close()
        assert sensor.counters.device_lost >= 1

    def test_a_cut_cable_raises_and_close_stays_quiet(self, bota: ServedMock) -> None:
        sensor = opened(bota)
        sensor.start()
        bota.cut()
        with pytest.raises(PortClosed, match="the line is gone"):
            collect(sensor, lambda _: False)
        sensor.close()
        sensor.close()

    def test_a_second_close_does_not_write_into_the_file_that_got_the_lines_number(
        self, bota: ServedMock, tmp_path: Path
    ) -> None:
        sensor = opened(bota)
        number = sensor.fileno()
        sensor.close()
        other = os.open(tmp_path / "other", os.O_CREAT | os.O_RDWR)
        if other != number:
            os.dup2(other, number)
            os.close(other)
        sensor.close()
        with pytest.raises(PortClosed, match="this end closed the line"):
            sensor.poll(time.monotonic_ns())
        os.close(number)
        assert (tmp_path / "other").read_bytes() == b""

    def test_a_silent_device_a_wrong_device_and_a_refusal_each_end_the_start(self, bota: ServedMock) -> None:
        bota.set(wrong_identity=True)
        with pytest.raises(DeviceError, match="not a Bota sensor"):
            self._start(bota)
        bota.set(wrong_identity=False, refuse="f")
        with pytest.raises(DeviceError, match="refused b'f,51,0,0,1'"):
            self._start(bota)
        bota.set(silent=True)
        with pytest.raises(DeviceError, match="nothing came"):
            self._start(bota)

    def _start(self, bota: ServedMock) -> None:
        sensor = opened(bota)
        try:
            sensor.start()
        finally:
            sensor.close()
