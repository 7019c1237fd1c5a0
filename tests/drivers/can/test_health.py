"""Load, errors and state of a bus, against figures worked out by hand from ISO 11898-1."""

import pytest

from drivers.can.health import BusHealth, BusState, bits_of
from drivers.can.slcan import CanFrame

FULL = CanFrame(0x181, bytes(8))
S_NS = 1_000_000_000


def loaded(health: BusHealth, frames_per_s: int) -> None:
    health.passed([], S_NS)
    for number in range(frames_per_s):
        health.passed([FULL], S_NS + number)
    health.passed([], 2 * S_NS)


def test_a_frame_of_eight_bytes_has_111_bits_and_a_tenth_of_stuffing() -> None:
    assert bits_of(FULL) == pytest.approx(1.1 * 111)
    assert bits_of(CanFrame(0x181, bytes(8), remote=True)) == pytest.approx(1.1 * 47)
    assert bits_of(CanFrame(0x181, b"", extended=True)) == pytest.approx(1.1 * 67)


def test_load_is_the_share_of_bits_of_the_last_second() -> None:
    health = BusHealth(1_000_000)
    loaded(health, 4000)
    assert health.load == pytest.approx(4000 * 122.1 / 1e6)
    assert health.trouble == ""
    assert "load 49%" in health.summary


def test_a_bus_that_is_nearly_full_is_told() -> None:
    health = BusHealth(500_000)
    loaded(health, 3500)
    assert health.trouble == "the CAN bus is loaded to 85%: take nodes or messages off it"


def test_errors_count_by_the_second_and_cease_to_be_told_when_they_end() -> None:
    health = BusHealth(1_000_000)
    health.passed([], S_NS)
    health.error_frames = 10
    health.passed([], 2 * S_NS)
    assert health.trouble == ""
    health.error_frames = 21
    health.passed([], 3 * S_NS)
    assert health.trouble.startswith("the CAN bus has 11 errors/s")
    health.passed([], 4 * S_NS)
    assert health.trouble == ""


@pytest.mark.parametrize(
    ("state", "told"), [(BusState.WARNING, ""), (BusState.PASSIVE, "passive"), (BusState.OFF, "off")]
)
def test_the_controllers_state_is_told_from_passive_on(state: BusState, told: str) -> None:
    health = BusHealth(1_000_000, state=state)
    assert told in health.trouble
    assert bool(health.trouble) is bool(told)
