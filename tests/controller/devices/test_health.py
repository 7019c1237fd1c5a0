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


class Reports:
    """An axis that is told where to be and reports once a millisecond."""

    def __init__(self) -> None:
        self.standstill = Standstill()
        self.now_ns = 0

    def update(self, position_mm: float, setpoint_mm: float) -> float:
        """The report of the moment at which the set-point went out."""
        return self.standstill.update(self.sent(setpoint_mm), position_mm)

    def sent(self, setpoint_mm: float) -> int:
        """When the report is of that comes later."""
        self.now_ns += MS
        self.standstill.sent(self.now_ns, setpoint_mm)
        return self.now_ns


def test_ten_reports_of_one_place_are_no_standstill_and_eleven_are() -> None:
    axis = Reports()
    assert [axis.update(5.0, float(cycle)) for cycle in range(12)] == [0.0] * 10 + [10.0, 11.0]


def test_a_set_point_that_goes_back_counts_as_way_too() -> None:
    axis = Reports()
    assert [axis.update(5.0, -float(cycle)) for cycle in range(11)][-1] == 10.0


def test_an_axis_at_rest_has_not_said_too_often_where_it_is_as_it_is_sent_off() -> None:
    axis = Reports()
    at_rest = [axis.update(0.0, 0.01 * (cycle % 2)) for cycle in range(100)]
    away = [axis.update(0.0, 0.4 + 0.02 * cycle) for cycle in range(9)]
    assert at_rest + away == [0.0] * 109
    assert axis.update(0.0, 0.6) == 0.6, "a tenth is one too many"


def test_late_reports_are_held_against_the_set_points_of_their_own_time() -> None:
    axis = Reports()
    axis.update(0.0, 0.0)
    at_rest = [axis.sent(0.0) for _ in range(20)]
    away = [axis.sent(0.03 * step) for step in range(200)]
    late = [axis.standstill.update(captured_ns, 0.0) for captured_ns in at_rest + away[:10]]
    assert late == [0.0] * 30, "the set-point is 6 mm away by now"
    frozen = [axis.standstill.update(captured_ns, 0.0) for captured_ns in away[10:]]
    assert frozen == pytest.approx([0.03 * step for step in range(10, 200)]), "and late ones tell a frozen axis as well"


def test_a_report_of_between_two_set_points_is_held_against_the_earlier() -> None:
    axis = Reports()
    for _ in range(12):
        axis.update(0.0, 0.0)
    sent_ns = [axis.sent(0.1 * step) for step in range(1, 20)]
    between = [axis.standstill.update(captured_ns - 1, 0.0) for captured_ns in sent_ns]
    assert between == pytest.approx([0.0] * 10 + [0.1 * step for step in range(10, 19)])


def test_set_points_of_the_last_second_at_2_kHz_are_kept_and_no_more() -> None:
    axis = Reports()
    sent_ns = [axis.sent(float(step)) for step in range(5000)]
    axis.standstill.update(sent_ns[0], 0.0)
    ways_mm = [axis.standstill.update(sent_ns[-1], 0.0) for _ in range(10)]
    assert ways_mm[-1] == 2047.0, "from the oldest of 2048 to the newest"


def test_a_set_point_that_is_a_little_more_than_a_hundredth_away_has_set_out() -> None:
    axis = Reports()
    axis.update(0.0, 0.0)
    assert [axis.update(0.0, 0.0101) for _ in range(10)] == [0.0] * 9 + [0.0101]


def test_what_was_reported_before_anything_was_sent_is_no_standstill_and_hides_none() -> None:
    axis = Reports()
    assert [axis.standstill.update(number * MS, 5.0) for number in range(20)] == [0.0] * 20
    axis.now_ns = 20 * MS
    assert [axis.update(5.0, float(cycle)) for cycle in range(11)] == [0.0] * 10 + [10.0]


def test_a_first_report_of_nothing_and_a_new_beginning_count_from_the_next() -> None:
    axis = Reports()
    assert axis.update(math.nan, 0.0) == 0.0
    for cycle in range(20):
        axis.update(5.0, float(cycle))
    axis.standstill.begin()
    assert [axis.update(5.0, 100.0 + cycle) for cycle in range(11)] == [0.0] * 10 + [10.0]
