"""Times of a sender by what the library says of its clock: closed forms, steps, repeats, and senders without one."""

import math

import pytest

from drivers.lsl.clock import OTHER_CLOCK_NS, SenderClock, Stamps
from drivers.lsl.library import ClockCorrection
from drivers.roles import LinkCounters

HOST_NS = 50_000_000_000  # our clock shows this when the library's shows zero
S = 1_000_000_000


def clock(offset_s: float = 2.0, uncertainty_s: float = 1e-4) -> tuple[SenderClock, LinkCounters]:
    counters = LinkCounters()
    made = SenderClock(counters, HOST_NS)
    made.correct(ClockCorrection(offset_s, uncertainty_s))
    return made, counters


def test_capture_is_the_stamp_its_correction_and_the_hosts_zero() -> None:
    made, _ = clock()
    found = made.stamps(10.0, 63 * S)
    assert found == Stamps(62 * S, 10 * S, 52 * S, 100_000)


def test_what_comes_again_after_a_recovery_is_dropped_and_counted() -> None:
    made, counters = clock()
    stamps = [1.0, 1.02, 1.04, 1.02, 1.04, 1.06]
    found = [made.stamps(at, 60 * S) for at in stamps]
    assert [item is None for item in found] == [False, False, False, True, True, False]
    assert counters.repeated == 2


def test_no_capture_is_after_its_arrival_and_none_goes_back() -> None:
    made, _ = clock(offset_s=2.0)
    first = made.stamps(1.0, 53 * S - 5)  # 5 ns after the arrival by the correction of now
    made.correct(ClockCorrection(1.5, 1e-4))  # a better one sets the clock back by half a second
    second = made.stamps(1.02, 54 * S)
    assert first and second
    assert first.capture_ns == 53 * S - 5
    assert second.capture_ns == first.capture_ns + 1
    assert second.device_ns + second.correction_ns == second.capture_ns


@pytest.mark.parametrize("stamp_s", [math.nan, 0.0, -3.0, 1.7e9])
def test_a_sender_without_a_known_clock_has_arrivals_alone(stamp_s: float) -> None:
    made, _ = clock()
    found = made.stamps(stamp_s, 60 * S)
    assert found is not None
    assert (found.capture_ns, found.uncertainty_ns, made.foreign) == (60 * S, -1, 1)


def test_how_old_a_sample_may_be_and_still_have_its_time() -> None:
    made, _ = clock(offset_s=0.0)
    arrival_ns = HOST_NS + 1000 * S
    inside_s = 1000 - OTHER_CLOCK_NS / S
    kept, foreign = made.stamps(inside_s, arrival_ns), made.stamps(inside_s + 0.001, arrival_ns + S)
    assert kept and kept.uncertainty_ns == 100_000
    assert foreign and foreign.uncertainty_ns == -1
