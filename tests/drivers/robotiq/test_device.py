"""The session of a Robotiq FT 300: against scripted bytes where pymodbus has no part, then against the mock."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from math import isnan

import pytest

from drivers.ports import Port, PortClosed, open_port, read_until
from drivers.robotiq import device
from drivers.robotiq.codec import FRAME_NS, STOP_BURST, encode_frame, with_crc
from drivers.robotiq.device import RobotiqFt300
from drivers.roles import Identity
from mock_devices.testing.clock import long_ago
from mock_devices.testing.force import WAIT_S, WRENCH, ServedMock, collect
from rig.config.products.robotiq_ft300 import Ft300Wiring
from rig.errors import DeviceError
from tests.drivers.scripted_port import ScriptedPort
from tests.drivers.silence import await_silence

FRAME = encode_frame([125, -250, -775, 125, -250, 500])
PERIOD_NS = 10_000_000
ARRIVAL_NS = 10**15


@pytest.fixture
def listening() -> Iterator[tuple[RobotiqFt300, ScriptedPort]]:
    """A sensor whose line is in the test's hand, as if it already streamed."""
    port = ScriptedPort()
    sensor = RobotiqFt300(lambda _: port, Ft300Wiring(latency_ms=1.5), long_ago)
    yield sensor, port
    sensor.close()


def test_samples_are_numbered_and_captured_a_line_time_and_the_latency_before_arrival(
    listening: tuple[RobotiqFt300, ScriptedPort],
) -> None:
    sensor, port = listening
    port.push(FRAME)
    (sample,) = sensor.poll(ARRIVAL_NS)
    assert sample[4:10] == WRENCH
    assert isnan(sample.temperature_C)
    assert (sample.seq, sample.device_us, sample.status, sample.valid) == (0, 0, 0, 1)
    assert sample.arrival_ns - sample.capture_ns == FRAME_NS + 1_500_000
    assert list(sensor.poll(ARRIVAL_NS + 1)) == []


def test_frames_read_together_were_captured_a_period_apart(listening: tuple[RobotiqFt300, ScriptedPort]) -> None:
    sensor, port = listening
    port.push(FRAME * 3)
    samples = sensor.poll(ARRIVAL_NS)
    assert [sample.seq for sample in samples] == [0, 1, 2]
    assert [late.capture_ns - early.capture_ns for early, late in pairwise(samples)] == [PERIOD_NS, PERIOD_NS]
    assert {sample.arrival_ns for sample in samples} == {ARRIVAL_NS}


def test_a_frame_that_comes_41_ms_late_is_recorded_where_it_was_sampled(
    listening: tuple[RobotiqFt300, ScriptedPort],
) -> None:
    sensor, port = listening
    captures = []
    for number in range(200):
        late_ns = 41_000_000 if number == 150 else 0
        if not 150 < number < 155:  # what was sent meanwhile is read with the late one, or right behind it
            port.push(FRAME * (1 if number != 155 else 5))
            captures += [sample.capture_ns for sample in sensor.poll(ARRIVAL_NS + number * PERIOD_NS + late_ns)]
    first = captures[0]
    assert captures == pytest.approx([first + number * PERIOD_NS for number in range(200)], abs=100_000)
    assert sensor.counters.device_lost == 0


def test_capture_goes_on_upwards_where_the_first_frame_was_late(listening: tuple[RobotiqFt300, ScriptedPort]) -> None:
    sensor, port = listening
    port.push(FRAME)
    captures = [sensor.poll(ARRIVAL_NS)[0].capture_ns]
    port.push(FRAME * 2)
    captures += [sample.capture_ns for sample in sensor.poll(ARRIVAL_NS + 4_000_000)]
    assert all(late > early for early, late in pairwise(captures))
    assert captures[-1] <= ARRIVAL_NS + 4_000_000


def test_a_reading_beyond_the_range_is_not_valid(listening: tuple[RobotiqFt300, ScriptedPort]) -> None:
    sensor, port = listening
    port.push(encode_frame([0, 0, -30_001, 0, 0, 0]) + encode_frame([0, 0, -30_000, 0, 0, 0]))
    assert [(sample.fz_N, sample.valid) for sample in sensor.poll(ARRIVAL_NS)] == [(-300.01, 0), (-300.0, 1)]


def test_a_wrong_checksum_is_counted(listening: tuple[RobotiqFt300, ScriptedPort]) -> None:
    sensor, port = listening
    port.push(FRAME + FRAME[:-1] + b"\x00" + FRAME)
    assert len(sensor.poll(ARRIVAL_NS)) == 2
    assert (sensor.counters.frames, sensor.counters.checksum_errors, sensor.counters.device_lost) == (2, 1, 0)


def test_a_frame_lost_to_a_wrong_checksum_keeps_its_place(listening: tuple[RobotiqFt300, ScriptedPort]) -> None:
    sensor, port = listening
    captures = []
    for number in range(10):
        port.push(FRAME[:-1] + b"\x00" if number == 5 else FRAME)
        captures += [sample.capture_ns for sample in sensor.poll(ARRIVAL_NS + number * PERIOD_NS)]
    steps = [(late - early) / PERIOD_NS for early, late in pairwise(captures)]
    assert steps == pytest.approx([1, 1, 1, 1, 2, 1, 1, 1], abs=0.01)
    assert (sensor.counters.checksum_errors, sensor.counters.device_lost) == (1, 1)


def test_close_stops_the_stream_and_may_be_called_twice() -> None:
    port = ScriptedPort()
    sensor = RobotiqFt300(lambda _: port, Ft300Wiring())
    sensor.close()
    sensor.close()
    assert port.written == [STOP_BURST]
    assert port.closed


def test_the_port_is_opened_at_the_sensors_own_baud() -> None:
    bauds: list[int] = []
    port = ScriptedPort()

    def opener(baud: int) -> ScriptedPort:
        bauds.append(baud)
        return port

    RobotiqFt300(opener, Ft300Wiring(baud=19_200)).close()
    assert bauds == [19_200]


class ChatterPort(ScriptedPort):
    """Another device that never stops talking."""

    def read(self) -> bytes:
        return b"chatter"


def test_a_line_that_never_falls_silent_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in (("SILENCE_S", 0.01), ("BURST_S", 0.02), ("STOP_S", 0.05)):
        monkeypatch.setattr(device, name, seconds)
    port = ChatterPort()
    port.push(b"always readable")
    sensor = RobotiqFt300(lambda _: port, Ft300Wiring())
    with pytest.raises(DeviceError, match=r"robotiq-ft300 at /dev/scripted: still sends bytes after 0.05 s"):
        sensor.start()
    sensor.close()


def opened(mock: ServedMock) -> RobotiqFt300:
    return RobotiqFt300(partial(open_port, mock.endpoint), Ft300Wiring())


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
class TestAgainstTheMockInAnotherProcess:
    def test_a_session_identifies_the_sensor_and_streams(self, robotiq: ServedMock) -> None:
        sensor = opened(robotiq)
        sensor.start()
        samples = collect(sensor, lambda got: len(got) >= 50)
        sensor.close()
        assert sensor.identity == Identity(
            "robotiq-ft300",
            "FTS-1234",
            "FTS-2.0.4",
            {
                "rate": "100 Hz",
                "production year": "2019",
                "forces at start": "fx_N 1.25 fy_N -2.5 fz_N -7.75 mx_N_m 0.125 my_N_m -0.25 mz_N_m 0.5",
            },
        )
        assert sensor.period_ns == PERIOD_NS
        assert [sample.seq for sample in samples] == list(range(len(samples)))
        assert {sample[4:10] for sample in samples} == {WRENCH}
        assert all(sample.valid for sample in samples)
        assert sensor.counters.discarded_bytes == 0

    def test_a_stream_left_running_is_stopped_and_started_again(self, robotiq: ServedMock) -> None:
        ports: list[Port] = []

        def opener(baud: int) -> Port:
            ports.append(open_port(robotiq.endpoint, baud))
            return ports[-1]

        RobotiqFt300(opener, Ft300Wiring()).start()
        ports[-1].close()
        sensor = opened(robotiq)
        sensor.start()
        assert len(collect(sensor, lambda got: len(got) >= 10)) >= 10
        sensor.close()

    def test_close_leaves_a_sensor_that_answers_modbus_again(self, robotiq: ServedMock) -> None:
        for _ in range(2):
            sensor = opened(robotiq)
            sensor.start()
            sensor.close()
        port = open_port(robotiq.endpoint, 19_200)
        port.write(bytes.fromhex("09 03 00 B4 00 01 C5 64"))
        expected = with_crc(bytes.fromhex("09 03 02 00 7D"))
        answer = read_until(port, lambda data: expected in data, WAIT_S)
        port.close()
        assert answer.endswith(expected)

    def test_a_start_without_an_answer_counts_if_frames_come(self, robotiq: ServedMock) -> None:
        robotiq.set(mute_start=True)
        sensor = opened(robotiq)
        sensor.start()
        assert len(collect(sensor, lambda got: len(got) >= 5)) >= 5
        sensor.close()

    def test_a_refused_start_is_one_sentence(self, robotiq: ServedMock) -> None:
        self._fails(robotiq, "refused to start its stream with Modbus exception 3", refuse_stream=True)

    def test_a_sensor_that_cannot_be_stopped_is_one_sentence(self, robotiq: ServedMock) -> None:
        sensor = opened(robotiq)
        sensor.start()
        robotiq.set(deaf=True)
        sensor.close()
        sensor = opened(robotiq)
        with pytest.raises(DeviceError, match=r"still sends bytes after 3 s of stop bursts"):
            sensor.start()
        sensor.close()

    def test_a_device_that_is_no_force_sensor_is_one_sentence(self, robotiq: ServedMock) -> None:
        self._fails(robotiq, "firmware 'KMS-2.0.4' is not that of a force sensor", wrong_identity=True)

    def test_a_silent_device_is_one_sentence(self, robotiq: ServedMock) -> None:
        self._fails(robotiq, "no Modbus answer from slave 9, registers 500 to 502 in 3 tries of 0.4 s", silent=True)

    def _fails(self, robotiq: ServedMock, sentence: str, **knobs: bool) -> None:
        robotiq.set(**knobs)
        sensor = opened(robotiq)
        with pytest.raises(DeviceError, match=sentence):
            sensor.start()
        sensor.close()

    def test_another_product_behind_the_port_is_one_sentence(self, bota: ServedMock) -> None:
        self._fails(bota, "no Modbus answer")

    def test_a_sensor_that_falls_silent_gives_no_samples_and_no_error(self, robotiq: ServedMock) -> None:
        sensor = opened(robotiq)
        sensor.start()
        robotiq.set(silent=True)
        await_silence(sensor)
        robotiq.set(silent=False)
        collect(sensor, lambda got: len(got) >= 1)
        sensor.close()

    def test_spoilt_checksums_are_counted(self, robotiq: ServedMock) -> None:
        sensor = opened(robotiq)
        sensor.start()
        robotiq.set(corrupt_every=4)
        collect(sensor, lambda _: sensor.counters.checksum_errors >= 5)
        sensor.close()

    def test_a_cut_cable_raises_and_close_stays_quiet(self, robotiq: ServedMock) -> None:
        sensor = opened(robotiq)
        sensor.start()
        robotiq.cut()
        with pytest.raises(PortClosed, match="the line is gone"):
            collect(sensor, lambda _: False)
        sensor.close()
        sensor.close()
