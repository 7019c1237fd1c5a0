"""The mock of a Bota SensONE: what it does to bytes, and that a client written from the maker's example can use it."""

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from drivers.bota.codec import ForceFrame, make_decoder
from drivers.roles import LinkCounters
from mock_devices.bota.mock import BOOT_NS, BotaMock, Command, CommandParser
from mock_devices.interfaces import NEVER_NS, ProtocolMock
from mock_devices.testing.force import WRENCH, ServedMock, StillPlant
from mock_devices.testing.wire import MemoryWire
from tests.mock_devices.sensor_bench import SensorBench

START_NS = 5_000_000_000
SECOND_NS = 1_000_000_000
BOOT = b"c,0,1,0,4\r\nApp Init\r\nname: BFT-SENS-SER-M8\r\nS/N: 000271\r\nFW version: 1.0.6\r\n"


class BotaBench(SensorBench[BotaMock]):
    """A booted mock."""

    def __init__(self, drift_ppm: float = 0.0) -> None:
        wire, self.plant = MemoryWire("/memory"), StillPlant()
        super().__init__(BotaMock(wire, self.plant, START_NS, drift_ppm), wire, START_NS + BOOT_NS)
        self.mock.tick(self.now_ns)
        self.wire.take()

    def run(self) -> None:
        assert self.say(b"CR") == b"r,0,C,0\r\nr,0,R,0\r\n"

    def frames(self, duration_ns: int) -> list[ForceFrame]:
        return make_decoder(LinkCounters()).feed(self.wait(duration_ns))


def test_it_is_a_mock_of_the_stage() -> None:
    mock: ProtocolMock = BotaBench().mock
    assert (mock.name, mock.endpoints(), mock.filenos(), mock.due_ns) == ("force", {"serial": "/memory"}, [], NEVER_NS)


def test_power_prints_who_it_is_after_booting_and_then_waits() -> None:
    wire = MemoryWire("/memory")
    mock = BotaMock(wire, StillPlant(), START_NS)
    assert mock.due_ns == START_NS + BOOT_NS
    mock.tick(START_NS + BOOT_NS - 1)
    assert wire.sent == []
    mock.tick(START_NS + BOOT_NS)
    assert b"".join(wire.sent) == BOOT
    assert mock.due_ns == NEVER_NS


@pytest.mark.parametrize(("reset", "answer"), [(b"#", b""), (b"I", b"r,0,I,0\r\n")])
def test_both_resets_boot_again_and_lose_what_is_said_meanwhile(reset: bytes, answer: bytes) -> None:
    bench = BotaBench()
    bench.run()
    assert bench.say(reset) == answer
    assert bench.say(b"C") == b""
    assert bench.wait(SECOND_NS) == BOOT
    assert bench.say(b"C") == b"r,0,C,0\r\n"


def test_settings_are_acknowledged_in_configuration_mode() -> None:
    bench = BotaBench()
    assert bench.say(b"Cc,0,1,0,4") == b"r,0,C,0\r\nr,0,c,0\r\n"
    assert bench.say(b"f,51,0,0,1") == b"r,0,f,0\r\n"
    assert bench.say(b"b, 0.000,-1.500, 0.000,12.345, 0.000, 0.000") == b"r,0,b,0\r\n"
    assert bench.say(b"m5, 1.000000,-0.250000, 0.000000, 0.000000, 0.000000, 0.000000") == b"r,0,m,0\r\n"
    assert bench.say(b"b,1.500000,0.000000,0.000000,0.000000,0.000000,-0.250000\n") == b"r,0,b,0\r\n"
    assert bench.say(b"sl") == b"r,0,s,0\r\nr,0,l,0\r\n"
    assert bench.say(b"w") == b"r,0,w,0\r\nc,0,1,0,4\r\nf,51,0,0,1\r\n"


def test_it_says_which_product_it_is_before_the_acknowledgement() -> None:
    bench = BotaBench()
    bench.say(b"C")
    assert bench.say(b"p?\n") == b"p,0,271,0,0,BFT-SENS-SER-M8\r\nr,0,p,0\r\n"


def test_settings_are_refused_outside_configuration_mode() -> None:
    bench = BotaBench()
    assert bench.say(b"f,51,0,0,1") == b"r,0,f,1\r\n"
    bench.run()
    assert bench.say(b"c,0,1,0,4s") == b"r,0,c,1\r\nr,0,s,1\r\n"


@pytest.mark.parametrize(
    "wrong", [b"c,0,1,1,4", b"c,0,1,0,9", b"f,50,0,0,1", b"f,2049,0,0,1", b"p!", b"b,1.5,", b"f,51R", b"c,,C", b"f;"]
)
def test_settings_that_are_wrong_are_refused(wrong: bytes) -> None:
    bench = BotaBench()
    bench.say(b"C")
    assert bench.say(wrong + b"R").startswith(f"r,0,{wrong[:1].decode()},1\r\n".encode())


def test_commands_are_understood_one_character_at_a_time() -> None:
    bench = BotaBench()
    answers = b"".join(bench.say(bytes([byte])) for byte in b"Cc,0,1,0,4f,512,0,0,1R")
    assert answers == b"r,0,C,0\r\nr,0,c,0\r\nr,0,f,0\r\nr,0,R,0\r\n"


def test_line_ends_and_noise_between_commands_are_ignored() -> None:
    assert BotaBench().say(b"\r\n?\xffC\r\n") == b"r,0,C,0\r\n"


@given(st.binary(max_size=300))
def test_the_parser_holds_at_most_a_command_whatever_comes(noise: bytes) -> None:
    parser = CommandParser()
    for command in parser.feed(noise + b"f,51" + b"9" * 100):
        assert isinstance(command, Command)
    assert list(parser.feed(b"C"))[-1] == Command("C", ())


@pytest.mark.parametrize(
    ("sinc", "rate_Hz"), [(51, 1003), (64, 800), (128, 400), (205, 249), (256, 200), (512, 100), (1024, 50)]
)
def test_the_filter_sets_the_rate(sinc: int, rate_Hz: int) -> None:
    bench = BotaBench()
    bench.say(f"Cf,{sinc},0,0,1R".encode())
    assert len(bench.frames(SECOND_NS)) == rate_Hz


def test_frames_carry_the_plants_load_and_the_sensors_own_time() -> None:
    bench = BotaBench()
    bench.run()
    first, second = bench.frames(20_000_000)
    booted_us = BOOT_NS // 1000
    assert first == ForceFrame(0, *WRENCH, booted_us + 10_000, 24.5)
    assert second == ForceFrame(0, *WRENCH, booted_us + 20_000, 24.5)


def test_when_samples_were_taken_is_kept_on_the_benchs_clock() -> None:
    bench = BotaBench(drift_ppm=20_000)
    begun_ns = bench.now_ns
    bench.run()
    frames = bench.frames(30_000_000)
    times_ns = [begun_ns + round(number * 1e7 / 1.02) for number in (1, 2, 3)]
    assert list(bench.mock.sampled) == [
        (frame.time_us, time_ns) for frame, time_ns in zip(frames, times_ns, strict=True)
    ]


def test_a_fast_clock_gives_more_frames_and_more_microseconds() -> None:
    bench = BotaBench(drift_ppm=20_000)
    bench.run()
    frames = bench.frames(10 * SECOND_NS)
    assert len(frames) == 1020
    assert frames[-1].time_us - frames[0].time_us == pytest.approx(1019 * 10_000, abs=1)


def test_the_sensors_clock_wraps_at_32_bits() -> None:
    bench = BotaBench()
    bench.now_ns = START_NS + (2**32 - 15_000) * 1000
    bench.run()
    assert [frame.time_us for frame in bench.frames(20_000_000)] == [2**32 - 5_000, 5_000]


def test_status_bits_tell_overrange_invalid_and_raw_readings() -> None:
    bench = BotaBench()
    bench.run()
    bench.plant.over = True
    assert [frame.status for frame in bench.frames(10_000_000)] == [2]
    bench.mock.invalid = True
    assert [frame.status for frame in bench.frames(10_000_000)] == [6]
    bench.say(b"Cc,0,0,0,4R")
    bench.plant.over = bench.mock.invalid = False
    assert [frame.status for frame in bench.frames(10_000_000)] == [8]


def test_a_frozen_sensor_repeats_its_forces_under_running_time() -> None:
    bench = BotaBench()
    bench.run()
    bench.frames(10_000_000)
    bench.mock.frozen = True
    bench.plant.load = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    first, second = bench.frames(20_000_000)
    assert first[1:7] == second[1:7] == WRENCH
    assert second.time_us - first.time_us == 10_000


def test_a_silent_sensor_neither_streams_nor_answers_but_goes_on_counting() -> None:
    bench = BotaBench()
    bench.run()
    (before,) = bench.frames(10_000_000)
    bench.mock.silent = True
    assert bench.frames(50_000_000) == []
    bench.mock.silent = False
    (after,) = bench.frames(10_000_000)
    assert after.time_us - before.time_us == 60_000


def test_every_nth_checksum_can_be_spoilt() -> None:
    bench = BotaBench()
    bench.mock.corrupt_every = 3
    bench.run()
    counters = LinkCounters()
    make_decoder(counters).feed(bench.wait(90_000_000))
    assert (counters.frames, counters.checksum_errors) == (6, 3)


def test_a_wrong_identity_shows_after_a_reset_and_a_refusal_in_its_answer() -> None:
    bench = BotaBench()
    bench.mock.wrong_identity = True
    bench.mock.refuse = "f"
    bench.say(b"#")
    assert b"name: KMS40\r\n" in bench.wait(SECOND_NS)
    assert bench.say(b"Cf,51,0,0,1") == b"r,0,C,0\r\nr,0,f,1\r\n"


def test_a_late_tick_sends_every_frame_that_was_due() -> None:
    bench = BotaBench()
    bench.run()
    late_ns = bench.now_ns + 35_000_000
    while bench.mock.due_ns <= late_ns:
        bench.mock.tick(late_ns)
    assert [frame.time_us for frame in make_decoder(LinkCounters()).feed(bench.wire.take())] == [
        BOOT_NS // 1000 + step for step in (10_000, 20_000, 30_000)
    ]


def test_close_cuts_the_wire() -> None:
    bench = BotaBench()
    bench.mock.close()
    assert bench.wire.closed


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
def test_a_client_that_follows_the_makers_example_gets_frames(bota: ServedMock) -> None:
    """The steps of `bota_serial_example.py`, with pyserial and nothing of ours but the served bytes."""
    with serial.Serial(bota.endpoint, 460_800, timeout=10) as line:
        line.write(b"#")
        assert line.read_until(b"App Init").endswith(b"App Init")
        assert line.read_until(b"FW version: 1.0.6\r").endswith(b"\r")
        for command in (b"C", b"c,0,1,0,4", b"f,512,0,0,1", b"R"):
            line.write(command)
            answer = b"r,0," + command[:1] + b",0"
            assert line.read_until(answer).endswith(answer)
        assert line.read_until(b"\xaa").endswith(b"\xaa")
        payload = line.read(36)
    assert make_decoder(LinkCounters()).feed(b"\xaa" + payload)[0][1:7] == WRENCH
