"""Load, rate, stiffness and the peak foreseen, from samples that are written down; all values worked out by hand."""

import math

import pytest

from controller.loop.setpoint import Setpoint
from controller.safety import load as load_monitor
from controller.safety.load import NO_WRENCH, UNKNOWN, LoadMonitor, TipLoad, Wrench, calibrated_zero
from rig.config.wiring import Wiring
from tests.calibrations import ZERO_N, with_calibration

MS = 1_000_000
STILL = Setpoint(0.0, 0.0)


def along(force_N: float) -> Wrench:
    return (0.0, 0.0, -force_N, 0.0, 0.0, 0.0)


def moving(
    speed_mm_s: float, stiffness_N_mm: float, samples: int = 60, period_ms: int = 1, monitor: LoadMonitor | None = None
) -> LoadMonitor:
    """Samples of a linear tissue while the axis moves; force and position of a sample belong to one moment."""
    monitor = monitor or LoadMonitor(period_ms * MS)
    for number in range(samples):
        at_ms = number * period_ms
        for part in range(period_ms):
            monitor.axis((at_ms - period_ms + part + 1) * MS, speed_mm_s * (at_ms - period_ms + part + 1) * 1e-3)
        before_mm = speed_mm_s * (at_ms * 1e-3 - period_ms * 0.5e-3)  # where the axis was half a period before
        monitor.force(at_ms * MS, along(stiffness_N_mm * before_mm + 1.0))
    return monitor


def asked(
    monitor: LoadMonitor, now_ms: float, setpoint: Setpoint = STILL, zero: Wrench = NO_WRENCH, noise_N: float = 0.0
) -> TipLoad:
    return monitor.load(round(now_ms * MS), zero, noise_N, setpoint, 2000.0)


def test_before_the_first_sample_nothing_is_known() -> None:
    load = asked(LoadMonitor(MS), 0.0)
    assert load is UNKNOWN
    assert math.isnan(load.force_N) and math.isnan(load.torque_N_m) and math.isnan(load.predicted_N)
    assert (load.rate_N_s, load.stiffness_N_mm, load.vanished_N) == (0.0, 0.0, 0.0)


def test_force_and_torque_are_norms_from_the_zero() -> None:
    monitor = LoadMonitor(MS)
    monitor.axis(0, 0.0)
    monitor.force(0, (1.0, 2.0, 3.0, 0.1, 0.2, 0.3))
    load = asked(monitor, 0.0, zero=(0.0, 0.0, 1.0, 0.0, 0.0, 0.1))
    assert load.force_N == pytest.approx(3.0)  # |(1, 2, 2)|
    assert load.torque_N_m == pytest.approx(0.3)  # |(0.1, 0.2, 0.2)|
    assert load.predicted_N == load.force_N


@pytest.mark.parametrize(("period_ms", "window_ms"), [(1, 10), (4, 10), (10, 25)])
def test_the_rate_is_the_change_over_its_window(period_ms: int, window_ms: int) -> None:
    monitor = LoadMonitor(period_ms * MS)
    spans = []
    for number in range(20):
        monitor.force(number * period_ms * MS, (0.3 * number, 0.0, -0.4 * number, 0.0, 0.0, 0.0))
        spans.append(asked(monitor, number * period_ms).rate_N_s)
    rate_N_s = 0.5 / (period_ms * 1e-3)
    least = math.floor(window_ms / 2 / period_ms) + 1  # more than half the window must be there
    assert spans[:least] == [0.0] * least
    assert spans[least:] == pytest.approx([rate_N_s] * (20 - least))


def test_what_is_older_than_the_window_is_no_part_of_the_rate() -> None:
    monitor = LoadMonitor(MS)
    for number in range(30):
        monitor.force(number * MS, along(100.0 if number < 19 else 5.0))
    assert asked(monitor, 29.0).rate_N_s == 0.0
    monitor.force(30 * MS, along(6.0))
    assert asked(monitor, 30.0).rate_N_s == pytest.approx(1.0 / 0.010)


@pytest.mark.parametrize("speed_mm_s", [10.0, 30.0, -10.0])
def test_stiffness_is_force_over_travel_raised_by_what_tissue_stiffens_on_the_way(speed_mm_s: float) -> None:
    load = asked(moving(speed_mm_s, 2.0), 59.0, Setpoint(speed_mm_s * 0.0585, 0.0), zero=along(-50.0))
    # All secants of a line are alike; the one over the longest way that counts is raised the most.
    travels_mm = [abs(speed_mm_s) * lag * 1e-3 for lag in (1, 2, 3, 5, 8, 13, 21, 34, 55)]
    counted = [mm for mm in travels_mm if mm >= 0.05 - 1e-9]
    longest_mm = max(mm for mm in counted if mm <= 0.7)
    assert load.stiffness_N_mm == pytest.approx(2.0 * (1 + 0.25 * 0.5 * longest_mm), rel=1e-6)


def test_the_way_ahead_raises_the_stiffness_too_and_the_peak_is_load_and_stiffness_times_way() -> None:
    monitor = moving(10.0, 2.0)
    newest_mm, load_N = 10.0 * 0.0585, 2.0 * 10.0 * 0.0585 + 1.0
    setpoint = Setpoint(newest_mm + 0.4, 20.0)
    ahead_mm = 0.4 + 20.0**2 / (2 * 2000.0)
    load = asked(monitor, 59.0, setpoint)
    stiffness_N_mm = 2.0 * (1 + 0.25 * 0.5 * (ahead_mm + 0.55))
    assert load.force_N == pytest.approx(load_N)
    assert load.stiffness_N_mm == pytest.approx(stiffness_N_mm)
    assert load.predicted_N == pytest.approx(load_N + stiffness_N_mm * ahead_mm)


def test_a_tip_that_leaves_has_its_stopping_way_behind_it() -> None:
    monitor = moving(10.0, 2.0)
    newest_mm, load_N = 10.0 * 0.0585, 2.0 * 10.0 * 0.0585 + 1.0
    load = asked(monitor, 59.0, Setpoint(newest_mm + 0.05, -20.0))
    assert load.predicted_N == pytest.approx(load_N), "0.05 mm ahead and 0.1 mm back are none"
    assert load.stiffness_N_mm == pytest.approx(2.0 * (1 + 0.25 * 0.5 * 0.55))


def test_force_that_rises_while_the_axis_stands_goes_on_rising_until_now() -> None:
    monitor = LoadMonitor(MS)
    for number in range(20):
        monitor.axis(number * MS, 5.0)
        monitor.force(number * MS, along(0.5 * number))
    load = asked(monitor, 22.0, Setpoint(5.0, 0.0))
    assert load.rate_N_s == pytest.approx(500.0)
    assert load.predicted_N == pytest.approx(9.5 + 500.0 * 0.003)
    assert load.stiffness_N_mm == 0.0


def test_less_travel_than_a_twentieth_of_a_millimetre_is_no_stiffness() -> None:
    assert asked(moving(0.9, 2.0, samples=56), 55.0).stiffness_N_mm == 0.0  # 55 samples back: 0.0495 mm
    assert asked(moving(0.92, 2.0, samples=56), 55.0).stiffness_N_mm > 2.0  # 0.0506 mm


def test_beyond_seven_tenths_of_a_millimetre_only_where_there_is_nothing_nearer() -> None:
    assert asked(moving(100.0, 2.0), 59.0).stiffness_N_mm == pytest.approx(2.0 * (1 + 0.125 * 0.5))
    fast = asked(moving(800.0, 2.0), 59.0).stiffness_N_mm
    assert fast == pytest.approx(2.0 * (1 + 0.125 * 0.8)), "the first is 0.8 mm long, and the only one"


def test_noise_takes_its_share_of_a_rise_and_a_restless_zero_no_more_than_the_noisiest_sensor() -> None:
    monitor = moving(10.0, 2.0)
    travel_mm = 0.55
    for noise_N, counted_N in ((0.1, 0.1), (0.15, 0.15), (5.0, 0.15)):
        guard_N = 3.0 * math.sqrt(2.0) * counted_N
        expected = max((2.0 * travel_mm - guard_N) / travel_mm * (1 + 0.125 * travel_mm), 0.0)
        assert asked(monitor, 59.0, noise_N=noise_N).stiffness_N_mm == pytest.approx(expected)


def test_force_that_falls_on_the_way_in_is_no_stiffness() -> None:
    assert asked(moving(10.0, -2.0, monitor=LoadMonitor(MS)), 59.0, zero=along(-50.0)).stiffness_N_mm == 0.0


def test_a_slow_sensor_keeps_enough_samples_for_its_rate() -> None:
    monitor = moving(10.0, 2.0, samples=20, period_ms=10)
    load = asked(monitor, 190.0)
    assert load.rate_N_s == pytest.approx(20.0)
    # Sixty milliseconds are kept: six periods, of which lags 1, 2, 3 and 5 are looked at, 0.1 to 0.5 mm.
    assert load.stiffness_N_mm == pytest.approx(2.0 * (1 + 0.125 * 0.5))


def test_no_more_is_kept_than_is_looked_at() -> None:
    monitor = moving(10.0, 2.0, samples=500)
    assert len(monitor._samples) == 61
    assert len(monitor._axis) == 64
    sparse = LoadMonitor(1000 * MS)
    for second in range(10):
        sparse.force(second * 1000 * MS, along(1.0))
    assert len(sparse._samples) == 3


def placed(at_ms: float, *axis: tuple[float, float]) -> float:
    """Where a sample of a fast sensor is put that was taken at ``at_ms``."""
    monitor = LoadMonitor(0)
    for time_ms, mm in axis:
        monitor.axis(round(time_ms * MS), mm)
    monitor.force(round(at_ms * MS), along(0.0))
    return monitor._samples[-1].position_mm


def test_a_sample_is_where_the_axis_was_then() -> None:
    assert math.isnan(placed(5.0))
    assert placed(5.0, (3.0, 7.0)) == 7.0
    axis = ((0.0, 0.0), (10.0, 1.0), (20.0, 3.0))
    assert placed(5.0, *axis) == pytest.approx(0.5)
    assert placed(15.0, *axis) == pytest.approx(2.0)
    assert placed(10.0, *axis) == pytest.approx(1.0)
    assert placed(25.0, *axis) == pytest.approx(4.0), "ahead of the newest as it last moved"
    assert placed(90.0, *axis) == pytest.approx(5.0), "but by 10 ms at most"
    assert placed(-5.0, *axis) == 0.0, "and where nothing is so old, the oldest"
    assert placed(12.0, (10.0, 1.0), (10.0, 2.0)) == 2.0, "two reports of one time: the newer"


def test_a_sample_is_half_a_period_older_than_it_says() -> None:
    monitor = LoadMonitor(10 * MS)
    for time_ms in (0, 10, 20):
        monitor.axis(time_ms * MS, time_ms / 10)
    monitor.force(20 * MS, along(0.0))
    assert monitor._samples[-1].position_mm == pytest.approx(1.5)


def test_until_the_first_zero_load_counts_from_the_calibrations() -> None:
    assert calibrated_zero(Wiring()) == NO_WRENCH == (0.0,) * 6
    assert calibrated_zero(with_calibration(Wiring(), "p", "1")) == (*ZERO_N, 0.0, 0.0, 0.0)


def test_constants_are_those_that_the_documentation_states() -> None:
    assert load_monitor.LAGS == (1, 2, 3, 5, 8, 13, 21, 34, 55)
    assert all(math.isnan(value) for value in load_monitor.NAN_WRENCH) and len(load_monitor.NAN_WRENCH) == 6


def sampled(*rows: tuple[float, float, float]) -> LoadMonitor:
    """Samples (time in ms, position in mm where it was taken, force in N) of a sensor of 1 kHz."""
    monitor = LoadMonitor(MS)
    for at_ms, position_mm, force_N in rows:
        monitor.axis(round((at_ms - 0.5) * MS), position_mm)
        monitor.axis(round((at_ms - 0.5) * MS), position_mm)
        monitor.force(round(at_ms * MS), along(force_N))
    return monitor


@pytest.mark.parametrize(
    ("rows", "travel_mm", "slope_N_mm"),
    [
        # 0.05 mm is enough way for a secant, and less is none.
        ([(0.0, 0.0, 0.0), (1.0, 0.05, 0.1)], 0.05, 2.0),
        ([(0.0, 0.0, 0.0), (1.0, 0.049, 0.1)], 0.0, 0.0),
        # The last way of 0.5 N/mm is the newest; 0.7 mm back still counts, farther does not where a nearer one told.
        ([(0.0, 0.0, 0.0), (1.0, 0.6, 0.95), (2.0, 0.7, 1.0)], 0.7, 1.0 / 0.7),
        ([(0.0, 0.0, 0.0), (1.0, 0.7, 3.95), (2.0, 0.8, 4.0)], 0.1, 0.5),
        # After a gap the three newest samples are left, however old.
        ([(0.0, 0.0, 0.0), (1000.0, 0.1, 1.0), (2000.0, 0.2, 1.1)], 0.2, 5.5),
    ],
)
def test_stiffness_is_the_steepest_secant_of_the_ways_that_count(
    rows: list[tuple[float, float, float]], travel_mm: float, slope_N_mm: float
) -> None:
    stiffness_N_mm = sampled(*rows)._stiffness(NO_WRENCH, 0.0, 0.0)
    assert stiffness_N_mm == pytest.approx(slope_N_mm * (1.0 + 0.25 * 0.5 * travel_mm))


def jumped(
    before_N: float,
    after_N: float,
    mm_a_sample: float = 0.0,
    per_mm: float = 0.0,
    period_ms: int = 1,
    noise_N: float = 0.0,
) -> list[float]:
    """What has vanished at each of ten samples from a jump on: the force goes to ``after_N`` and rises no more."""
    monitor, told = LoadMonitor(period_ms * MS), []
    for number in range(-30, 10):
        at_ms, place_mm = (number + 30) * period_ms, 20.0 + mm_a_sample * number
        monitor.axis(round((at_ms - 0.5 * period_ms) * MS), place_mm)
        monitor.force(at_ms * MS, along(after_N if number >= 0 else before_N + per_mm * mm_a_sample * number))
        told.append(asked(monitor, at_ms, noise_N=noise_N).vanished_N)
    assert told[:31] == [0.0] * 31, "one sample is a disturbance"
    return told[31:]


@pytest.mark.parametrize(("period_ms", "seen"), [(1, 3), (3, 1), (10, 1)])
def test_a_load_that_goes_at_once_is_told_from_its_second_sample_for_three_milliseconds(
    period_ms: int, seen: int
) -> None:
    assert jumped(2.0, 0.0, period_ms=period_ms) == pytest.approx([2.0] * seen + [0.0] * (9 - seen))
    assert jumped(2.0, -2.0, period_ms=period_ms)[0] == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("before_N", "after_N", "told"),
    [(0.81, 0.48, True), (0.79, 0.40, False), (0.81, 0.49, False), (3.0, 1.79, True), (3.0, 1.81, False),
     (0.8, 0.0, True), (0.3, 0.0, False)],
)  # fmt: skip
def test_it_counts_from_eight_tenths_of_a_newton_and_where_four_tenths_are_gone(
    before_N: float, after_N: float, told: bool
) -> None:
    assert (jumped(before_N, after_N)[0] > 0.0) is told


def test_the_force_that_is_left_is_what_points_the_same_way() -> None:
    monitor = LoadMonitor(MS)
    for number in range(6):  # the fewest of which two lie before a jump, and two after it
        monitor.axis(number * MS, 20.0)
        monitor.force(number * MS, (3.0, 5.0, -7.0, 0.0, 0.0, 0.0) if number < 2 else (4.0, 1.0, -1.5, 0.0, 0.0, 0.0))
    # From the zero: (2, 3, -6), 7 N, and (3, -1, -0.5), of which (6 - 3 + 3) / 7 N point the same way.
    assert asked(monitor, 5.0, zero=(1.0, 2.0, -1.0, 0.0, 0.0, 0.0)).vanished_N == pytest.approx(7.0 - 6.0 / 7.0)


def test_a_sensor_without_a_period_is_looked_at_from_sample_to_sample() -> None:
    assert LoadMonitor(0)._vanishing == 1


# Where the second sample after the jump is the newest, the two before it are four and five samples back, three and four
# before the jump's place.
def test_on_the_way_out_twice_the_tangent_before_may_go() -> None:
    [told, *_] = jumped(4.0, 0.5, mm_a_sample=-0.05, per_mm=2.0)
    assert told == pytest.approx(min(4.3 - 4.0 * 0.2, 4.4 - 4.0 * 0.25) - 0.5)
    [short, *_] = jumped(4.0, 0.5, mm_a_sample=-0.0024, per_mm=2.0)  # 0.05 mm lie 21 samples back
    assert short == pytest.approx(min(4.0144 - 4.0 * 0.0096, 4.0192 - 4.0 * 0.012) - 0.5)
    [stiff, *_] = jumped(40.0, 0.0, mm_a_sample=-0.05, per_mm=60.0)
    assert stiff == pytest.approx(min(49.0 - 50.0 * 0.2, 52.0 - 50.0 * 0.25)), "no more than 50 N/mm"


def test_on_the_way_out_twenty_newtons_a_millimetre_may_go_where_no_tangent_is_known() -> None:
    assert jumped(4.0, 0.5, mm_a_sample=-0.05)[0] == 0.0
    assert jumped(4.0, 0.5, mm_a_sample=-0.02)[0] == pytest.approx(4.0 - 20.0 * 0.1 - 0.5)
    [short, *_] = jumped(4.0, 0.5, mm_a_sample=-0.0023, per_mm=2.0)
    assert short == pytest.approx(min(4.0138 - 20.0 * 0.0092, 4.0184 - 20.0 * 0.0115) - 0.5)


def test_on_the_way_in_it_is_to_rise_by_the_tangent_before() -> None:
    assert jumped(4.0, 1.0, mm_a_sample=0.05, per_mm=3.0)[0] == pytest.approx(3.55 + 3.0 * 0.2 - 1.0)
    # At full speed half of a gain may leave nearly as much as there was before.
    assert jumped(35.0, 20.0, mm_a_sample=0.2, per_mm=5.0)[0] == pytest.approx(32.0 + 5.0 * 0.8 - 20.0)
    assert jumped(19.0, 9.0, mm_a_sample=0.05, per_mm=12.0)[0] == pytest.approx(16.6 + 10.0 * 0.25 - 9.0)


def test_noise_makes_no_tangent_and_short_ways_tell_none() -> None:
    tangent_N_mm = 3.0 - 3.0 * math.sqrt(2.0) * 0.05 / 0.65  # over 13 samples, the longest way that counts
    [told, *_] = jumped(4.0, 1.0, mm_a_sample=0.05, per_mm=3.0, noise_N=0.05)
    assert told == pytest.approx(3.4 + tangent_N_mm * 0.25 - 1.0)
    # Of thirty samples twenty-one lie before: 0.19 mm of the 0.2 that it takes.
    assert jumped(4.0, 1.0, mm_a_sample=0.009, per_mm=3.0)[0] == pytest.approx(4.0 - 3.0 * 0.009 * 4 - 1.0)


def vanished(*rows: tuple[float, float]) -> float:
    """What has vanished after samples at these places [mm] and forces [N], one a millisecond."""
    monitor = LoadMonitor(MS)
    for number, (place_mm, force_N) in enumerate(rows):
        monitor.axis(number * MS - MS // 2, place_mm)
        monitor.force(number * MS, along(force_N))
    return asked(monitor, len(rows) - 1.0).vanished_N


AT_REST = (20.0, 4.0)


def test_the_tangent_is_that_up_to_the_newer_of_the_two_before_a_jump() -> None:
    rising = [(20.0 + 0.05 * at, 1.0 + 0.1 * at) for at in range(26)]
    rising[-1] = (rising[-1][0], rising[-1][1] + 0.3)
    after = [(20.0 + 0.05 * at, 0.5) for at in range(26, 30)]
    tangent_N_mm = (0.5 + 0.3) / 0.25  # five samples back
    assert vanished(*rising, *after) == pytest.approx(3.4 + tangent_N_mm * 0.25 - 0.5)


def test_a_tip_that_is_where_it_was_before_the_jump_went_no_way_out() -> None:
    before = [*24 * [AT_REST], (20.05, 4.0), AT_REST]
    assert vanished(*before, *4 * [(20.0, 0.5)]) == pytest.approx(3.5)


@pytest.mark.parametrize(
    ("place_mm", "felt_N", "told"), [(0.019, 2.09, False), (0.021, 2.09, True), (0.019, 2.11, True)]
)
def test_what_was_hardly_more_at_the_same_place_a_moment_ago_has_not_vanished(
    place_mm: float, felt_N: float, told: bool
) -> None:
    rows = [*10 * [(20.0 - place_mm, felt_N)], *18 * [AT_REST], *2 * [(20.0, 0.5)]]
    assert (vanished(*rows) > 0.0) is told


def test_a_moment_ago_is_up_to_the_two_before_a_jump_and_the_place_is_that_of_the_newest() -> None:
    rows = [*23 * [AT_REST], (20.1, 2.0), *4 * [AT_REST], (20.0, 0.5), (20.1, 0.5)]
    assert vanished(*rows) == 0.0
    assert vanished(*rows[:23], AT_REST, *rows[24:]) > 0.0
