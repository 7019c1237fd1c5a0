"""The mock of a Robotiq FT 300: its Modbus slave against literal bytes and third-party clients, and its stream."""

import struct
from contextlib import closing

import minimalmodbus
import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.client import ModbusSerialClient
from pymodbus.exceptions import ModbusIOException

from drivers.robotiq.codec import (
    FRAME_NS,
    START_STREAM,
    STOP_BURST,
    STREAM_STARTED,
    Wrench,
    encode_read,
    encode_write,
    make_decoder,
    with_crc,
)
from drivers.roles import LinkCounters
from mock_devices.interfaces import NEVER_NS, ProtocolMock
from mock_devices.robotiq.mock import REQUEST_BYTES_MAX, RequestFinder, RobotiqMock
from mock_devices.testing.force import WRENCH, ServedMock, StillPlant
from mock_devices.testing.wire import MemoryWire
from tests.mock_devices.polled import mbpoll
from tests.mock_devices.sensor_bench import SensorBench

START_NS = 7_000_000_000
PERIOD_NS = 10_000_000
READ_FORCES = bytes.fromhex("09 03 00 B4 00 06 84 A6")
FORCES = with_crc(bytes.fromhex("09 03 0C 007D FF06 FCF9 007D FF06 01F4"))


class RobotiqBench(SensorBench[RobotiqMock]):
    """A mock just powered."""

    def __init__(self, drift_ppm: float = 0.0, serial_number: int = 1234) -> None:
        wire, self.plant = MemoryWire("/memory"), StillPlant()
        super().__init__(RobotiqMock(wire, self.plant, START_NS, drift_ppm, serial_number), wire, START_NS)

    def frames(self, duration_ns: int) -> list[Wrench]:
        return make_decoder(LinkCounters()).feed(self.wait(duration_ns))

    def stream(self) -> None:
        assert self.say(START_STREAM) == STREAM_STARTED


def exception(function: int, code: int) -> bytes:
    return with_crc(bytes([9, function | 0x80, code]))


def test_it_is_a_mock_of_the_stage() -> None:
    mock: ProtocolMock = RobotiqBench().mock
    assert (mock.name, mock.endpoints(), mock.filenos(), mock.due_ns) == ("force", {"serial": "/memory"}, [], NEVER_NS)


def test_the_manuals_requests_are_answered() -> None:
    bench = RobotiqBench()
    assert bench.say(bytes.fromhex("09 03 00 B4 00 01 C5 64")) == with_crc(bytes.fromhex("09 03 02 00 7D"))
    assert bench.say(READ_FORCES) == FORCES


@pytest.mark.parametrize(
    ("address", "count", "data"),
    [
        (190, 3, "0000 0000 03E8"),
        (410, 1, "0000"),
        (500, 3, "4654 5302 0004"),
        (510, 4, "4654 5300 04D2 0000"),
        (514, 1, "07E3"),
    ],
)
def test_the_register_map(address: int, count: int, data: str) -> None:
    body = bytes([9, 3, 2 * count]) + bytes.fromhex(data)
    assert RobotiqBench().say(encode_read(address, count)) == with_crc(body)


def test_a_large_serial_number_has_its_low_word_first() -> None:
    assert RobotiqBench(serial_number=80871424).say(encode_read(512, 2))[3:7] == bytes.fromhex("0000 04D2")


@pytest.mark.parametrize(
    ("request_", "function", "code"),
    [
        (encode_read(186, 1), 3, 2),
        (encode_read(180, 7), 3, 2),
        (encode_read(180, 0), 3, 3),
        (encode_read(180, 126), 3, 3),
        (with_crc(bytes.fromhex("09 04 00 B4 00 01")), 4, 1),
        (with_crc(bytes.fromhex("09 06 01 9A 02 00")), 6, 1),
        (with_crc(bytes.fromhex("09 11")), 0x11, 1),
        (encode_write(411, [0x0200]), 16, 2),
        (encode_write(410, [0x0200, 0]), 16, 2),
        (encode_write(410, [0x0100]), 16, 3),
        (with_crc(bytes.fromhex("09 10 01 9A 00 01 04 02 00 00 00")), 16, 3),
    ],
)
def test_requests_that_cannot_be_served_get_an_exception(request_: bytes, function: int, code: int) -> None:
    bench = RobotiqBench()
    assert bench.say(request_) == exception(function, code)
    assert not bench.mock.streaming


@pytest.mark.parametrize("slave", [0, 1, 8, 10, 247])
def test_requests_to_other_slaves_are_met_with_silence(slave: int) -> None:
    bench = RobotiqBench()
    hidden = with_crc(bytes([slave, 16, 0, 0, 0, 4, 8]) + READ_FORCES)
    assert bench.say(hidden) == b""
    assert bench.say(READ_FORCES) == FORCES


def test_a_wrong_checksum_is_met_with_silence() -> None:
    bench = RobotiqBench()
    assert bench.say(READ_FORCES[:-1] + b"\x00") == b""
    assert bench.say(READ_FORCES) == FORCES


@pytest.mark.parametrize("cut", range(len(READ_FORCES) + 1))
def test_a_request_may_be_split_at_every_byte(cut: int) -> None:
    bench = RobotiqBench()
    assert bench.say(READ_FORCES[:cut]) + bench.say(READ_FORCES[cut:]) == FORCES


def test_noise_before_a_request_is_passed_over() -> None:
    assert RobotiqBench().say(b"\xff" * 300 + b"\x09\x10\x01\x9a" + READ_FORCES) == FORCES


@given(st.lists(st.binary(max_size=100), max_size=20))
def test_the_slave_holds_at_most_a_request_whatever_comes(chunks: list[bytes]) -> None:
    finder = RequestFinder()
    for chunk in chunks:
        list(finder.feed(chunk))
        assert finder.held <= REQUEST_BYTES_MAX
    assert list(finder.feed(bytes(REQUEST_BYTES_MAX) + READ_FORCES))[-1] == READ_FORCES


def test_noise_costs_one_pass_and_no_checksum_of_each_of_its_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    """200 bytes of it took 10 ms, for which every other mock of the bench stood still."""
    tried: list[bytes] = []

    def count(part: bytes) -> bool:
        tried.append(part)
        return False

    monkeypatch.setattr("mock_devices.robotiq.mock.is_intact", count)
    assert list(RequestFinder().feed(b"\x55" * REQUEST_BYTES_MAX + b"\x09\x03" + bytes(6))) == []
    assert len(tried) <= 2


def test_the_stream_starts_with_an_answer_and_runs_at_100_frames_a_second() -> None:
    bench = RobotiqBench()
    bench.stream()
    assert bench.frames(1_000_000_000 + FRAME_NS) == [Wrench(*WRENCH)] * 100


def test_a_frame_arrives_when_it_has_passed_the_line() -> None:
    bench = RobotiqBench()
    bench.stream()
    assert bench.wait(PERIOD_NS) == b""
    bench.plant.load = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert bench.wait(FRAME_NS - 1) == b""
    assert bench.frames(1) == [Wrench(*WRENCH)]


def test_when_samples_were_taken_is_kept_on_the_benchs_clock() -> None:
    bench = RobotiqBench()
    begun_ns = bench.now_ns
    bench.stream()
    bench.wait(2 * PERIOD_NS)
    mark = int.from_bytes(struct.pack("<6h", 125, -250, -775, 125, -250, 500), "little")
    assert list(bench.mock.sampled) == [(mark, begun_ns + PERIOD_NS), (mark, begun_ns + 2 * PERIOD_NS)]


def test_a_fast_clock_gives_more_frames() -> None:
    bench = RobotiqBench(drift_ppm=20_000)
    bench.stream()
    assert len(bench.frames(10_000_000_000 + FRAME_NS)) == 1020


def test_a_streaming_sensor_is_deaf_to_modbus() -> None:
    bench = RobotiqBench()
    assert bench.say(START_STREAM + READ_FORCES) == STREAM_STARTED
    assert bench.say(READ_FORCES) == b""
    assert bench.mock.streaming


@pytest.mark.parametrize("cut", [0, 1, 25, 49, 50])
def test_a_burst_stops_the_stream_and_modbus_works_again(cut: int) -> None:
    bench = RobotiqBench()
    bench.stream()
    bench.wait(PERIOD_NS)
    assert bench.say(STOP_BURST[:cut]) + bench.say(STOP_BURST[cut:]) == b""
    assert not bench.mock.streaming
    assert bench.wait(10 * PERIOD_NS) == b""
    assert bench.say(b"\xff\xff" + READ_FORCES) == FORCES
    bench.stream()


def test_a_burst_that_is_too_short_or_interrupted_does_not_stop_the_stream() -> None:
    bench = RobotiqBench()
    bench.stream()
    bench.say(STOP_BURST[:-1] + b"\x00" + STOP_BURST[:-1])
    assert bench.mock.streaming


def test_a_frozen_sensor_repeats_its_forces() -> None:
    bench = RobotiqBench()
    assert bench.say(READ_FORCES) == FORCES
    bench.mock.frozen = True
    bench.plant.load = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert bench.say(READ_FORCES) == FORCES
    bench.stream()
    assert bench.frames(30_000_000) == [Wrench(*WRENCH)] * 2


def test_an_invalid_sensor_gives_the_end_of_its_converter() -> None:
    bench = RobotiqBench()
    bench.mock.invalid = True
    bench.stream()
    assert bench.frames(20_000_000) == [Wrench(327.67, 327.67, 327.67, 32.767, 32.767, 32.767)]


def test_every_nth_checksum_can_be_spoilt() -> None:
    bench = RobotiqBench()
    bench.mock.corrupt_every = 3
    bench.stream()
    counters = LinkCounters()
    make_decoder(counters).feed(bench.wait(90_000_000 + FRAME_NS))
    assert (counters.frames, counters.checksum_errors) == (6, 3)


def test_a_silent_sensor_neither_answers_nor_streams() -> None:
    bench = RobotiqBench()
    bench.mock.silent = True
    assert bench.say(READ_FORCES) == b""
    assert bench.say(START_STREAM) == b""
    assert bench.wait(50_000_000) == b""
    bench.mock.silent = False
    assert len(bench.frames(20_000_000)) == 2


def test_start_can_go_unanswered_or_be_refused_and_a_deaf_sensor_streams_on() -> None:
    bench = RobotiqBench()
    bench.mock.refuse_stream = True
    assert bench.say(START_STREAM) == exception(16, 3)
    bench.mock.refuse_stream = False
    bench.mock.mute_start = True
    assert bench.say(START_STREAM) == b""
    bench.mock.deaf = True
    bench.say(STOP_BURST * 3)
    assert bench.mock.streaming


def test_a_wrong_identity_shows_in_the_firmware() -> None:
    bench = RobotiqBench()
    bench.mock.wrong_identity = True
    assert bench.say(encode_read(500, 1)) == with_crc(b"\x09\x03\x02KM")


def test_close_cuts_the_wire() -> None:
    bench = RobotiqBench()
    bench.mock.close()
    assert bench.wire.closed


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
class TestThirdPartyClients:
    """Clients written elsewhere use the mock, in another process, unchanged."""

    def test_minimalmodbus_reads_registers_and_starts_the_stream(self, robotiq: ServedMock) -> None:
        instrument = minimalmodbus.Instrument(robotiq.endpoint, 9)
        line = instrument.serial
        line.baudrate, line.timeout = 19_200, 1.0
        assert instrument.read_registers(180, 6) == [125, 0x10000 - 250, 0x10000 - 775, 125, 0x10000 - 250, 500]
        assert instrument.read_register(182, number_of_decimals=2, signed=True) == -7.75
        assert instrument.read_string(500, number_of_registers=1) == "FT"
        assert instrument.read_long(512, byteorder=minimalmodbus.BYTEORDER_LITTLE_SWAP) == 1234
        with pytest.raises(minimalmodbus.IllegalRequestError, match="Slave reported illegal data address"):
            instrument.read_register(186)
        instrument.write_registers(410, [0x0200])
        frame = line.read(16)
        line.close()
        assert make_decoder(LinkCounters()).feed(frame) == [Wrench(*WRENCH)]

    def test_minimalmodbus_hears_nothing_from_another_slave(self, robotiq: ServedMock) -> None:
        instrument = minimalmodbus.Instrument(robotiq.endpoint, 8)
        instrument.serial.baudrate, instrument.serial.timeout = 19_200, 0.2
        with pytest.raises(minimalmodbus.NoResponseError):
            instrument.read_register(180)
        instrument.serial.close()

    def test_pymodbus_reads_registers_and_gets_exceptions(self, robotiq: ServedMock) -> None:
        client = ModbusSerialClient(robotiq.endpoint, baudrate=19_200, timeout=2)
        assert client.connect()
        forces = client.read_holding_registers(180, count=6, device_id=9).registers
        refused = client.read_holding_registers(186, count=1, device_id=9)
        client.close()  # type: ignore[no-untyped-call]
        assert struct.unpack(">6h", struct.pack(">6H", *forces)) == (125, -250, -775, 125, -250, 500)
        assert (refused.isError(), refused.exception_code) == (True, 2)

    def test_pymodbus_stops_a_stream_and_reads_again(self, robotiq: ServedMock) -> None:
        with closing(ModbusSerialClient(robotiq.endpoint, baudrate=19_200, timeout=5)) as client:
            assert client.connect()
            assert not client.write_registers(410, [0x0200], device_id=9).isError()
        with closing(ModbusSerialClient(robotiq.endpoint, baudrate=19_200, timeout=0.3, retries=0)) as client:
            assert client.connect()
            with pytest.raises(ModbusIOException):
                client.read_holding_registers(180, count=1, device_id=9)
            assert isinstance(client.socket, serial.Serial)
            client.socket.write(b"\xff" * 50)
            client.socket.timeout = 1.0
            while client.socket.read(16):
                continue
        with closing(ModbusSerialClient(robotiq.endpoint, baudrate=19_200, timeout=5)) as client:
            assert client.connect()
            assert client.read_holding_registers(180, count=1, device_id=9).registers == [125]

    def test_mbpoll_reads_registers_and_hears_nothing_from_another_slave(self, robotiq: ServedMock) -> None:
        forces = mbpoll(robotiq.endpoint, 9, 19_200, "-t", "4:hex", "-r", "180", "-c", "3")
        assert "[180]: \t0x007D\n[181]: \t0xFF06\n[182]: \t0xFCF9\n" in forces
        assert "Illegal data address" in mbpoll(robotiq.endpoint, 9, 19_200, "-r", "186")
        assert "Connection timed out" in mbpoll(robotiq.endpoint, 8, 19_200, "-r", "180")
