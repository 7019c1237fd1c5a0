"""Device counters on the host's clock: wrap, drift, and delays that are never negative."""

import random
from collections.abc import Callable
from itertools import pairwise

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


Delay = Callable[[int, random.Random], int]
EPOCH_NS = 10**12


def quick(rng: random.Random) -> int:
    """A quiet computer's delay, with its exponential tail."""
    return round(rng.expovariate(1 / (0.1 * MS)))


def idle(_: int, rng: random.Random) -> int:
    return quick(rng)


def loaded(_: int, rng: random.Random) -> int:
    """Two samples in three wait for up to two time slices."""
    return quick(rng) if rng.random() < 1 / 3 else rng.randrange(8 * MS)


def stalls(since_ns: int, rng: random.Random) -> int:
    """Every fifth of a second the host stands still for 30 ms, and reads the burst that has come since."""
    return max(30 * MS - since_ns % (200 * MS), 0) or quick(rng)


def long_stalls(since_ns: int, rng: random.Random) -> int:
    return max(700 * MS - since_ns % (5_000 * MS), 0) or quick(rng)


def busy_by_turns(since_ns: int, rng: random.Random) -> int:
    """For 5 s out of 10 nothing comes in time."""
    return quick(rng) if since_ns // (5_000 * MS) % 2 == 0 else rng.randrange(MS // 5, 8 * MS)


def played(
    clock: ClockMap, delay: Delay, seconds: float = 40.0, drift_ppm: float = 0.0, period_ns: int = MS, seed: int = 1
) -> list[float]:
    """Errors of capture [ms] of a stream whose bytes cannot overtake each other and come in reads of whole bursts."""
    rng, captures, truth, waiting = random.Random(seed), list[int](), list[int](), list[int]()
    arrival_ns, latency_ns = 0, clock.latency_ns
    for number in range(round(seconds * 1e9 / period_ns) + 1):
        since_ns = number * period_ns
        ready_ns = EPOCH_NS + since_ns + latency_ns + delay(since_ns, rng)
        if waiting and ready_ns > arrival_ns:
            for device_ns in waiting:
                clock.observe(device_ns, arrival_ns)
            captures += clock.captures(waiting, arrival_ns)
            assert captures[-1] <= arrival_ns
            waiting = []
        arrival_ns = max(ready_ns, arrival_ns)
        waiting.append(round(since_ns / (1 + drift_ppm * 1e-6)))
        truth.append(EPOCH_NS + since_ns)
    assert all(late > early for early, late in pairwise(captures))
    return [abs(capture_ns - true_ns) / MS for capture_ns, true_ns in zip(captures, truth, strict=False)]


def share(errors: list[float], fraction: float) -> float:
    return sorted(errors)[int(fraction * (len(errors) - 1))]


@pytest.mark.parametrize("drift_ppm", [-100.0, 0.0, 100.0])
@pytest.mark.parametrize("period_ns", [MS, 10 * MS])
@pytest.mark.parametrize(
    ("delay", "limit_ms"), [(idle, 0.1), (loaded, 0.1), (stalls, 0.1), (long_stalls, 0.1), (busy_by_turns, 0.35)]
)
def test_capture_times_are_right_once_five_seconds_are_known(
    delay: Delay, limit_ms: float, period_ns: int, drift_ppm: float
) -> None:
    """Where nothing comes in time for 5 s, the 0.2 ms by which the quickest is late cannot be told from drift."""
    errors = played(ClockMap(latency_ns=2 * MS), delay, 40.0, drift_ppm, period_ns)
    assert share(errors[len(errors) // 8 :], 0.99) < limit_ms


@pytest.mark.parametrize("drift_ppm", [-100.0, 0.0, 100.0])
def test_on_a_quiet_computer_they_are_right_from_the_first_second_on_and_make_no_steps(drift_ppm: float) -> None:
    errors = played(ClockMap(), idle, 5.0, drift_ppm)
    assert share(errors, 0.99) < 0.1
    assert max(abs(late - early) for early, late in pairwise(errors[100:])) < 0.1


@pytest.mark.parametrize("drift_ppm", [-80.0, 0.0, 80.0])
def test_drift_is_found(drift_ppm: float) -> None:
    clock = ClockMap()
    played(clock, idle, 40.0, drift_ppm)
    assert clock.drift_ppm == pytest.approx(drift_ppm, abs=1.0)


@pytest.mark.parametrize("slower_ms", [-3, 3])
def test_delays_that_no_crystals_drift_explains_bend_the_map_by_no_more_than_one_explains(slower_ms: int) -> None:
    """In its first 3 s a host gets 1 ms a second slower, or faster, at what it does with every sample: 1000 ppm."""
    clock = ClockMap()
    errors = played(clock, lambda since_ns, _: max(slower_ms, 0) * since_ns // 3_000 - min(slower_ms, 0) * MS, 3.0)
    assert abs(clock.drift_ppm) <= 300
    assert errors[-1] <= max(3 * 0.3, -min(slower_ms, 0)) + 0.05


def test_where_delays_are_constant_the_map_is_right_from_the_first_sample_on() -> None:
    assert max(played(ClockMap(), lambda *_: 0, 0.02)) == 0


@pytest.mark.parametrize("late_ms", [20, 400, 5_000])
def test_samples_that_waited_for_a_busy_host_do_not_bend_the_map(late_ms: int) -> None:
    """While an axis homes nobody reads the sensor; what waited on its line comes late, and all of it at once."""
    errors = played(ClockMap(), lambda since_ns, rng: max(late_ms * MS - since_ns, 0) or quick(rng), 15.0)
    assert max(errors[2 * late_ms + 100 :]) < 0.3


def test_capture_times_of_a_burst_are_a_period_apart_even_where_it_is_the_first() -> None:
    clock = ClockMap()
    for number in range(5):
        clock.observe(number * MS, 9 * MS)
    assert clock.captures([number * MS for number in range(5)], 9 * MS) == [number * MS for number in range(5, 10)]


def test_where_the_offset_falls_time_goes_on_at_half_its_pace_and_never_stands() -> None:
    """The first ten come 3 ms late, the next at once behind them; the latency leaves room before arrival."""
    clock, captures = ClockMap(latency_ns=2 * MS), list[int]()
    for number in range(20):
        arrival_ns = (number + 5) * MS if number < 10 else max(14 * MS + number, (number + 2) * MS)
        clock.observe(number * MS, arrival_ns)
        captures += clock.captures([number * MS], arrival_ns)
    assert captures[9] == 12 * MS
    steps = [late - early for early, late in pairwise(captures[9:16])]
    assert steps == [MS // 2] * 6
    assert captures[16:] == [number * MS for number in range(16, 20)]


def test_what_a_late_sample_leaves_of_the_time_to_the_next_read_is_shared_out() -> None:
    clock = ClockMap()
    clock.observe(0, 10 * MS)
    assert clock.captures([0], 10 * MS) == [10 * MS]
    for number in range(1, 11):
        clock.observe(number * MS, 10 * MS + 50_000)
    captures = clock.captures([number * MS for number in range(1, 11)], 10 * MS + 50_000)
    assert captures == [10 * MS + 5_000 * number for number in range(1, 11)]


def test_captures_differ_even_where_the_clock_has_no_room_between_two_reads() -> None:
    clock = ClockMap()
    found = []
    for number, arrival_ns in enumerate((5 * MS, 5 * MS, 5 * MS + 1)):
        clock.observe(number * MS, arrival_ns)
        found += clock.captures([number * MS], arrival_ns)
    assert found == [5 * MS, 5 * MS + 1, 5 * MS + 2]


def test_a_host_clock_that_was_steered_by_half_the_bound_is_followed_within_a_minute() -> None:
    """30 s at one rate, then 150 ppm faster: the map gives way by its spare rate, and then knows."""
    steered = 30_000 * MS
    errors = played(ClockMap(), lambda since_ns, rng: quick(rng) + round(max(since_ns - steered, 0) * 150e-6), 90.0)
    drifted = [error - max(number - 30_000, 0) * 150e-6 for number, error in enumerate(errors)]
    assert max(map(abs, drifted[80_000:])) < 0.3


def test_after_a_restart_the_device_counts_anew_and_time_goes_on_upwards() -> None:
    clock = ClockMap()
    clock.observe(7_000 * MS, 9_000 * MS)
    (before_ns,) = clock.captures([7_000 * MS], 9_000 * MS)
    clock.restart()
    clock.observe(MS, 9_000 * MS)
    assert clock.captures([MS], 9_000 * MS)[0] > before_ns
    clock.observe(50 * MS, 9_050 * MS)
    assert clock.captures([50 * MS], 9_050 * MS)[0] == pytest.approx(9_049 * MS, abs=0.02 * MS)


def test_lateness_is_counted_from_the_quickest_sample() -> None:
    clock = ClockMap()
    for number in range(1000):
        clock.observe(number * MS, (number + 3) * MS)
    assert clock.lateness_ns(1000 * MS, 1044 * MS) == 41 * MS
    assert clock.lateness_ns(1000 * MS, 1001 * MS) == -2 * MS
