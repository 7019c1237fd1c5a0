"""Health of a stream, by hand: three bits, ages, rates and frozen values at their bounds."""

import math

import pytest

from controller.devices.health import Standstill, StreamHealth

MS = 1_000_000
ALIVE, VALID, ON_RATE = 1, 2, 4


def fed(*times_ms: float, valid: bool = True, period_ms: int = 10, stale_ms: int = 40) -> StreamHealth:
    health = StreamHealth(period_ms * MS, stale_ms * MS)
    for time_ms in times_ms:
        health.update(round(time_ms * MS), valid, time_ms)
    return health


def test_before_the_first_sample_a_stream_is_nothing() -> None:
    health = StreamHealth(10 * MS, 40 * MS)
    assert (health.valid, health.frozen, health.rate_Hz) == (False, False, 0.0)
    assert health.bits(0) == health.bits(1_000_000 * MS) == 0
    assert health.age_ns(5) == 5 + (1 << 62)


def test_a_steady_stream_is_alive_valid_and_on_rate() -> None:
    health = fed(0, 10, 20)
    assert health.bits(21 * MS) == ALIVE | VALID | ON_RATE
    assert health.age_ns(21 * MS) == MS
    assert health.rate_Hz == pytest.approx(100.0)


def test_one_sample_is_on_rate_until_there_are_two() -> None:
    assert fed(7).rate_Hz == pytest.approx(100.0)
    assert fed(7).bits(7 * MS) == ALIVE | VALID | ON_RATE


@pytest.mark.parametrize(("age_ms", "alive"), [(0, True), (39.9, True), (40, False), (1e6, False)])
def test_a_sample_counts_until_it_is_stale(age_ms: float, alive: bool) -> None:
    health, now_ns = fed(0), round(age_ms * MS)
    assert health.alive(now_ns) is alive
    assert health.bits(now_ns) == ALIVE * alive | VALID | ON_RATE


def test_what_the_device_does_not_vouch_for_is_alive_and_not_valid() -> None:
    assert fed(0, 10, valid=False).bits(10 * MS) == ALIVE | ON_RATE


@pytest.mark.parametrize(
    ("samples", "period_ms", "on_rate"),
    # The mean goes to the new period with a share of 0.02 a sample: after n samples 1 - 0.98^n of the way.
    [(10, 20, True), (12, 20, False), (200, 11.9, True), (200, 12.6, False), (300, 8.1, True), (300, 7.9, False)],
)
def test_a_rate_off_by_a_fifth_is_off_rate(samples: int, period_ms: float, on_rate: bool) -> None:
    times_ms = [number * period_ms for number in range(samples + 1)]
    health = fed(*times_ms)
    mean_ms = 10 + (1 - 0.98**samples) * (period_ms - 10)
    assert health.rate_Hz == pytest.approx(1000 / mean_ms)
    assert (abs(mean_ms - 10) < 2) is on_rate
    assert bool(health.bits(round(times_ms[-1] * MS)) & ON_RATE) is on_rate


def test_exactly_a_fifth_is_off_rate_and_without_a_rate_there_is_none() -> None:
    health = fed(0)
    health._mean_period_ns = 12.0 * MS
    assert not health.bits(0) & ON_RATE
    health._mean_period_ns = 0.0
    assert health.rate_Hz == 0.0
    health._mean_period_ns = 0.5
    assert health.rate_Hz == pytest.approx(2e9)


def test_a_value_is_frozen_when_it_came_more_often_than_the_limit_again() -> None:
    health = StreamHealth(MS, 4 * MS)
    frozen = []
    for number in range(103):
        health.update(number * MS, True, 1.0)
        frozen.append(health.frozen)
    assert frozen == [False] * 101 + [True] * 2
    health.update(104 * MS, True, 1.1)
    assert (health.frozen, health.identical) == (False, 0)


def test_a_stream_that_says_no_value_is_never_frozen() -> None:
    health = StreamHealth(MS, 4 * MS, 2)
    for number in range(10):
        health.update(number * MS, True)
    assert (health.frozen, health.identical) == (False, 0)


def test_a_first_value_repeats_nothing() -> None:
    health = StreamHealth(MS, 4 * MS, 0)
    health.update(0, True, 0.0)
    assert not health.frozen
    health.update(MS, True, 0.0)
    assert health.frozen


def test_a_stream_starts_well_at_any_time_of_the_clock() -> None:
    health = StreamHealth(MS, 4 * MS)
    for number in range(2):
        health.update((1 << 60) + number * MS, True, number)
    assert health.rate_Hz == pytest.approx(1000.0)


def test_ten_reports_of_one_place_are_no_standstill_and_eleven_are() -> None:
    standstill = Standstill()
    assert [standstill.update(5.0, float(cycle)) for cycle in range(12)] == [0.0] * 10 + [10.0, 11.0]


def test_a_set_point_that_goes_back_counts_as_way_too() -> None:
    standstill = Standstill()
    assert [standstill.update(5.0, -float(cycle)) for cycle in range(11)][-1] == 10.0


def test_what_an_axis_said_at_rest_does_not_make_a_pause_in_its_answers_a_standstill() -> None:
    standstill = Standstill()
    at_rest = [standstill.update(0.0, 0.01 * (cycle % 2)) for cycle in range(100)]
    late = [standstill.update(0.0, 0.4 + 0.02 * cycle) for cycle in range(9)]
    assert at_rest + late == [0.0] * 109, "sent off, and nine reports of before come at once"
    assert standstill.update(0.0, 0.6) == 0.6, "a tenth is one too many"


def test_a_set_point_that_is_a_little_more_than_a_hundredth_away_has_set_out() -> None:
    standstill = Standstill()
    standstill.update(0.0, 0.0)
    assert [standstill.update(0.0, 0.0101) for _ in range(10)] == [0.0] * 9 + [0.0101]


def test_a_first_report_of_nothing_and_a_new_beginning_count_from_the_next() -> None:
    standstill = Standstill()
    assert standstill.update(math.nan, 0.0) == 0.0
    for cycle in range(20):
        standstill.update(5.0, float(cycle))
    standstill.begin()
    assert [standstill.update(5.0, 100.0 + cycle) for cycle in range(11)] == [0.0] * 10 + [10.0]
