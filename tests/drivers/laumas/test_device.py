"""The session with the transmitter, its mock behind a scripted port: what is asked, when, and what may go wrong."""

import math

import pytest

from drivers.laumas.device import LaumasTransmitter
from mock_devices.laumas.mock import ERROR_BIT, LaumasMock
from mock_devices.testing.clock import Clock
from mock_devices.testing.wire import MemoryWire
from rig.channels import ForceSample
from rig.config.products.laumas_tlb import LaumasWiring
from rig.config.table import merged, parse
from rig.config.wiring import Wiring
from rig.errors import DeviceError, UsageError
from tests.drivers.scripted_port import ScriptedPort

MS = 1_000_000


class Cell:
    """A plant with a force along z, and one across that the transmitter does not see."""

    def __init__(self) -> None:
        self.force_N, self.temperature_C, self.over = -2.5, 20.0, False

    def wrench(self) -> tuple[float, float, float, float, float, float]:
        return 7.0, 7.0, self.force_N, 1.0, 1.0, 1.0

    def overrange(self) -> bool:
        return self.over


class Session:
    """Driver and mock on one line; ``run`` polls each millisecond."""

    def __init__(self, **settings: object) -> None:
        self.cell, self.clock, self.wire = Cell(), Clock(), MemoryWire()
        self.mock = LaumasMock(self.wire, self.cell)
        self.answers, self.spoilt = 0, (0, 0)
        self.port = ScriptedPort(self._answer)
        config = LaumasWiring.model_validate({"port": "/dev/ttyUSB0", "error_bits": ERROR_BIT} | settings)
        self.sensor = LaumasTransmitter(lambda: self.port, config, self.clock)

    def _answer(self, data: bytes) -> bytes:
        self.wire.said += data
        self.mock.receive(self.clock())
        answer = bytearray(self.wire.take())
        self.answers += 1
        number, place = self.spoilt
        if self.answers == number:
            answer[place] ^= 4
        return bytes(answer)

    def run(self, milliseconds: int) -> list[ForceSample]:
        samples: list[ForceSample] = []
        for _ in range(milliseconds):
            self.clock.advance(0.001)
            samples += self.sensor.poll(self.clock())
        return samples


def started(**settings: object) -> Session:
    session = Session(**settings)
    session.sensor.start()
    return session


def test_it_says_who_it_is() -> None:
    identity = started().sensor.identity
    assert (identity.product, identity.serial, identity.firmware) == ("laumas-tlb", "4711", "105")
    assert identity.settings["channels"] == "fz"


@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("place", [0, 1, 2, 3, -1])
def test_any_one_damaged_answer_at_set_up_is_asked_for_again(
    number: int, place: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drivers.laumas.device.ANSWER_S", 0.01)
    session = Session()
    session.spoilt = (number, place)
    session.sensor.start()
    assert (session.sensor.identity.serial, session.answers) == ("4711", 3)


def test_it_is_asked_a_hundred_times_a_second_and_gives_newtons() -> None:
    session = started()
    samples = session.run(1000)
    assert len(samples) == pytest.approx(100, abs=1)
    assert {(s.fx_N, s.fy_N, s.fz_N, s.mx_N_m, s.valid) for s in samples} == {(0.0, 0.0, -2.5, 0.0, 1)}
    assert [sample.seq for sample in samples] == list(range(len(samples)))
    # Eight characters of 115200 baud after the question began.
    assert samples[0].arrival_ns - samples[0].capture_ns == pytest.approx(1 * MS - 694_444, abs=MS)
    assert math.isnan(samples[0].temperature_C)


def test_net_weight_follows_the_tare_and_gross_does_not() -> None:
    net, gross = started(weight="net"), started()
    for session in (net, gross):
        session.mock.tare = -5_000
    assert (net.run(30)[-1].fz_N, gross.run(30)[-1].fz_N) == (-2.0, -2.5)


def test_counts_are_newtons_as_configured() -> None:
    assert started(counts_per_N=1000.0).run(30)[-1].fz_N == -25.0


@pytest.mark.parametrize("wrong", ["error bit", "beyond capacity"])
def test_what_it_does_not_vouch_for_is_invalid(wrong: str) -> None:
    session = started(capacity_N=50.0)
    if wrong == "error bit":
        session.mock.invalid = True
    else:
        session.cell.force_N = -50.1
    sample = session.run(30)[-1]
    assert (sample.valid, sample.status) == (0, ERROR_BIT if wrong == "error bit" else 0)


def test_a_lost_answer_is_asked_for_again_and_counted() -> None:
    session = started()
    session.mock.corrupt_every = 5
    samples = session.run(2000)
    assert session.sensor.counters.checksum_errors > 3 and session.sensor.counters.device_lost > 3
    assert len(samples) > 50


def test_silence_is_told_after_half_a_second() -> None:
    session = started()
    session.run(50)
    session.mock.silent = True
    with pytest.raises(DeviceError, match=r"laumas-tlb at /dev/ttyUSB0: no answer for 0.5 s"):
        session.run(700)


def test_a_pause_in_which_nobody_polls_is_no_silence() -> None:
    """An axis that homes takes seconds, and whoever waits for it does not look at the sensor."""
    session = started()
    for _ in range(2):
        session.clock.advance(3.0)
        assert session.run(30)[-1].valid == 1
    session.mock.silent = True
    session.run(15)  # asked, and not answered, when nobody looks any more
    session.clock.advance(3.0)
    session.mock.silent = False
    assert session.run(30)[-1].valid == 1


def test_a_refusal_is_told_in_words() -> None:
    session = Session()
    session.mock.refusing = True
    with pytest.raises(DeviceError, match=r"refused register 40001: no such register; check force\.product"):
        session.sensor.start()


def test_a_transmitter_of_another_address_is_not_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("drivers.laumas.device.ANSWER_S", 0.01)
    with pytest.raises(DeviceError, match=r"no answer of slave 7 in 3 tries .* check power, cable, force.port"):
        Session(slave=7).sensor.start()


def test_any_bit_of_its_status_is_an_error_until_those_that_are_were_named() -> None:
    session = Session(error_bits=0xFFFF)
    session.mock.invalid = True
    with pytest.raises(DeviceError, match=r"bits 0 of its status register 40007 are set, .* force.error_bits"):
        session.sensor.start()
    told = Session(error_bits=0x0002)
    told.mock.invalid = True
    told.sensor.start()
    assert told.run(30)[-1].valid == 1
    with pytest.raises(UsageError, match=r"force\.error_bits: Input should be greater than or equal to 1"):
        parse(Wiring, merged({}, ["force.product=laumas-tlb", "force.error_bits=0"]), "rig.toml")


def test_no_torque_of_the_limits_is_refused_and_no_force_beyond_the_cell_taken() -> None:
    settings = ["force.product=laumas-tlb", "limits.torque_N_m=0.5", "force.capacity_N=10"]
    with pytest.raises(UsageError, match=r"limits\.force_N 20 N is above its maximum, 10 N: the load cell"):
        parse(Wiring, merged({}, settings), "rig.toml")
    assert parse(Wiring, merged({}, [*settings, "limits.force_N=10"]), "rig.toml").force.sampled_Hz == 100.0


def test_a_rate_that_the_line_cannot_carry_is_refused() -> None:
    with pytest.raises(ValueError, match="9600 baud carry 36 questions a second"):
        LaumasWiring(baud=9600)
    assert LaumasWiring(baud=9600, rate_Hz=30).line_baud == 9600
