"""Device counters on the host's clock: wrap, drift, and delays that are never negative."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.timing import ClockMap, Unwrapper

MS = 1_000_000


def test_a_counter_that_wraps_goes_on() -> None:
    unwrap = Unwrapper(8)
    assert [unwrap(count) for count in (250, 255, 3, 4, 2, 200)] == [250, 255, 259, 260, 258, 200]


@given(start=st.integers(0, 2**32 - 1), steps=st.lists(st.integers(0, 2**30), max_size=30))
def test_unwrapping_undoes_the_modulus(start: int, steps: list[int]) -> None:
    unwrap, total = Unwrapper(32), start
    first = unwrap(start)
    for step in steps:
        total += step
        assert unwrap(total % 2**32) - first == total - start


def test_capture_is_never_after_arrival_nor_before_an_earlier_capture() -> None:
    clock, random_delay = ClockMap(), random.Random(1)
    captures = []
    for number in range(5000):
        device_ns = number * MS
        arrival_ns = 7_000 * MS + device_ns + random_delay.randrange(0, 8 * MS)
        captures.append(clock(device_ns, arrival_ns))
        assert captures[-1] <= arrival_ns
    assert captures == sorted(captures)


@pytest.mark.parametrize("drift_ppm", [-80.0, 0.0, 80.0])
def test_drift_is_found_and_capture_times_are_right_to_a_tenth_of_a_millisecond(drift_ppm: float) -> None:
    clock, delays = ClockMap(latency_ns=2 * MS), random.Random(2)
    error_ns = 0
    for number in range(40_000):
        true_ns = 3_000 * MS + number * MS
        device_ns = round(number * MS / (1 + drift_ppm * 1e-6))
        arrival_ns = true_ns + 2 * MS + round(delays.expovariate(1 / (0.3 * MS)))
        error_ns = clock(device_ns, arrival_ns) - true_ns
    assert clock.drift_ppm == pytest.approx(drift_ppm, abs=2.0)
    assert abs(error_ns) < 0.1 * MS


def test_the_map_is_right_from_the_first_sample_on_where_delays_are_constant() -> None:
    clock = ClockMap()
    assert [clock(number * MS, 500 * MS + number * MS) for number in range(3)] == [500 * MS, 501 * MS, 502 * MS]


@pytest.mark.parametrize("late_ms", [20, 400, 5_000])
def test_samples_that_waited_for_a_busy_host_do_not_bend_the_map(late_ms: int) -> None:
    """While an axis homes nobody reads the sensor; what waited on its line comes late, and all of it at once."""
    clock, delays = ClockMap(), random.Random(3)
    errors_ns = []
    for number in (*range(110), *range(late_ms + 110, late_ms + 10_000)):
        waited = number < 110
        delay_ns = (late_ms + 110 - number) * MS if waited else round(delays.expovariate(1 / (0.3 * MS)))
        capture_ns = clock(number * MS, number * MS + delay_ns)
        errors_ns.append(abs(capture_ns - number * MS))
    assert max(errors_ns[2000:]) < 0.5 * MS


def test_one_late_window_in_the_middle_is_no_part_of_the_map() -> None:
    clock, delays = ClockMap(), random.Random(4)
    for number in range(20_000):
        late_ns = 100 * MS if 9_000 <= number < 9_500 else 0
        clock(number * MS, number * MS + late_ns + round(delays.expovariate(1 / (0.3 * MS))))
    assert abs(clock(20_000 * MS, 20_001 * MS) - 20_000 * MS) < 0.1 * MS
    assert clock.drift_ppm == pytest.approx(0.0, abs=2.0)
