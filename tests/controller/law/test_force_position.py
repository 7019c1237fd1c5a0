"""The force law by itself: closed forms of each part, what samples and limits change, where it starts anew."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.law.force_position import (
    LINE_CYCLES,
    Correction,
    Expected,
    Feedback,
    ForceReading,
    Memory,
    Settings,
    begin,
    expect,
    increment,
    limit,
    react,
)
from controller.law.inverse_model import Columns, GainRow, Inverse, columns

DT_S = 0.001
NO_INVERSE = Inverse(damping_N_s_mm=0.0, ahead_mm_s=0.0)
PLAIN = Feedback(
    delay_s=0.0, lag1_s=0.0, lag2_s=0.0, crossover_rad_s=10.0, lead_s=0.0, drift_rad_s=0.0, drift_limit_mm_s=5.0,
    speed_limit_mm_s=1e9, search_mm_s=5.0, lost_N=0.0,
)  # fmt: skip
AHEAD = Settings(Inverse(damping_N_s_mm=0.0, ahead_mm_s=1000.0), PLAIN)
NONE = Correction(0.0, 0.0, 0.0, 0.0)


def linear(tangent_N_mm: float = 1.0, damping_N_s_mm: float = 0.01) -> Columns:
    """Up to 10 N."""
    return columns(
        [
            GainRow(
                force_N=force_N, depth_mm=force_N / tangent_N_mm, tangent_N_mm=tangent_N_mm,
                damping_N_s_mm=damping_N_s_mm,
            )
            for force_N in (0.0, 10.0)
        ]
    )  # fmt: skip


def holding(force_N: float = 3.0) -> Memory:
    return begin(linear(), NO_INVERSE, force_N)


def expected_after(feedback: Feedback, forces_N: list[float], start_N: float = 0.0) -> list[float]:
    """What is expected at each cycle for a series of forces foreseen."""
    expected = Expected((0.0,) * LINE_CYCLES, 0, start_N, start_N, start_N)
    found = []
    for force_N in forces_N:
        expected = expect(expected, feedback, force_N, DT_S)
        found.append(expected.force_N)
    return found


@pytest.mark.parametrize("cycles", [0, 1, 7, LINE_CYCLES - 2])
def test_what_is_foreseen_is_expected_a_delay_later_and_before_that_the_force_at_the_start(cycles: int) -> None:
    found = expected_after(PLAIN._replace(delay_s=cycles * DT_S), [float(1 + n) for n in range(60)], start_N=-1.0)
    assert found == pytest.approx([-1.0] * cycles + [float(1 + n) for n in range(60 - cycles)])


def test_part_of_a_cycle_of_delay_is_part_of_the_way_between_two() -> None:
    found = expected_after(PLAIN._replace(delay_s=2.25 * DT_S), [10.0 * n for n in range(20)])
    assert found[10:] == pytest.approx([10.0 * (n - 2.25) for n in range(10, 20)])


def test_a_ramp_is_expected_later_by_delay_and_both_lags() -> None:
    """The steady lag of a first-order lag behind a ramp is its time constant, also by implicit Euler."""
    feedback = PLAIN._replace(delay_s=0.004, lag1_s=0.003, lag2_s=0.005)
    assert expected_after(feedback, [n * DT_S for n in range(500)])[-1] == pytest.approx(0.499 - 0.012, abs=1e-9)


def test_an_error_that_stays_moves_stiff_tissue_at_the_crossover_times_error_over_stiffness() -> None:
    """Where B is nothing, w = wc e / k: an integral of force error over stiffness."""
    settings, memory = Settings(NO_INVERSE, PLAIN), holding()
    for cycle in range(200):
        step_mm, memory = increment(memory, linear(2.0, 1e-9), settings, 5.0, ForceReading(3.0, cycle), DT_S)
    assert step_mm == pytest.approx(10.0 * 2.0 / 2.0 * DT_S)


def test_damped_tissue_is_given_the_speed_that_its_force_needs() -> None:
    """k w + B dw/dt = r: the step response of 1 / (k + B s)."""
    correction, forces = NONE, []
    for _ in range(20_000):
        correction = react(correction, PLAIN, 1.0, 2.0, 0.1, 1e-5)
        forces.append(correction.speed_mm_s)
    assert forces[4999] == pytest.approx(10.0 / 2.0 * (1 - math.exp(-2.0 / 0.1 * 0.05)), rel=1e-3)


def test_two_leads_make_of_a_ramp_of_error_the_ramp_two_leads_earlier() -> None:
    """(1 + ta s)^2 of t is t + 2 ta; a lead of the wrong sign would give t - 2 ta."""
    feedback, correction = PLAIN._replace(lead_s=0.004, crossover_rad_s=1.0), NONE
    for cycle in range(100):
        before = correction
        correction = react(before, feedback, 0.5 * cycle * DT_S, 1e-9, 1.0, DT_S)
    gained_mm_s = correction.speed_mm_s - before.speed_mm_s  # B dw/dt = r with B 1
    assert gained_mm_s / DT_S == pytest.approx(0.5 * (0.099 + 0.008))


@given(st.integers(1, 20))
def test_a_slope_is_taken_over_the_time_between_samples(cycles: int) -> None:
    """A sample every so many cycles gives the same two leads of a steady ramp."""
    feedback, memory = PLAIN._replace(lead_s=0.02, crossover_rad_s=1.0), holding(0.0)
    settings, table = Settings(NO_INVERSE, feedback), linear(1e-9, 1.0)
    for cycle in range(20 * cycles + 1):
        sample = cycle // cycles
        _, memory = increment(memory, table, settings, 0.0, ForceReading(-sample * cycles * DT_S, sample), DT_S)
    assert memory.correction.led_N - memory.correction.error_N == pytest.approx(0.02)
    assert memory.since_s == pytest.approx(0.0)


def test_the_same_sample_is_acted_on_once_and_its_speed_kept() -> None:
    settings = Settings(NO_INVERSE, PLAIN)
    first_mm, memory = increment(holding(), linear(), settings, 5.0, ForceReading(3.0, 0), DT_S)
    again_mm, kept = increment(memory, linear(), settings, 5.0, ForceReading(3.0, 0), DT_S)
    assert first_mm == again_mm > 0
    assert (kept.correction, kept.since_s) == (memory.correction, DT_S)
    more_mm, _ = increment(kept, linear(), settings, 5.0, ForceReading(3.0, 1), DT_S)
    assert more_mm > first_mm


def test_the_second_integral_collects_the_feedbacks_speed_and_ends_at_its_limit() -> None:
    feedback = PLAIN._replace(drift_rad_s=3.0, drift_limit_mm_s=0.7)
    correction = limit(Correction(0.0, 0.0, 2.0, 0.1), feedback, 0.0, 0.01)
    assert correction.drift_mm_s == pytest.approx(0.1 + 3.0 * 2.0 * 0.01)
    for _ in range(50):
        correction = limit(correction, feedback, 0.0, 0.01)
    assert correction.drift_mm_s == 0.7
    for _ in range(100):
        correction = limit(correction._replace(speed_mm_s=-2.0), feedback, 0.0, 0.01)
    assert correction.drift_mm_s == -0.7


@given(st.floats(-100, 100), st.floats(-24, 24), st.floats(-5, 5))
def test_feedback_is_what_the_axis_is_given_and_no_more(speed: float, ahead: float, drift: float) -> None:
    found = limit(Correction(0.0, 0.0, speed, drift), PLAIN._replace(speed_limit_mm_s=30.0), ahead, 0.0)
    assert abs(ahead + found.speed_mm_s + found.drift_mm_s) <= 30.0 + 1e-9
    if abs(ahead + speed + drift) <= 30.0:
        assert found.speed_mm_s == speed


def test_a_limited_axis_winds_nothing_up() -> None:
    """Ten seconds against a limit, then the error turns: the tip turns with the next sample but for what B asks for."""
    settings, memory = Settings(NO_INVERSE, PLAIN._replace(speed_limit_mm_s=1.0)), holding()
    for cycle in range(10_000):
        step_mm, memory = increment(memory, linear(), settings, 9.0, ForceReading(3.0, cycle), DT_S)
    assert step_mm == pytest.approx(1.0 * DT_S)
    step_mm, _ = increment(memory, linear(), settings, -1.0, ForceReading(3.0, 10_000), DT_S)
    assert step_mm < 0


def test_a_change_of_tangent_and_damping_alone_moves_nothing() -> None:
    memory = holding()
    for table in (linear(0.1, 0.001), linear(9.0, 0.1)):
        step_mm, memory = increment(memory, table, Settings(NO_INVERSE, PLAIN), 3.0, ForceReading(3.0, 1), DT_S)
        assert step_mm == 0.0


def test_tangent_and_damping_are_those_at_the_force_measured() -> None:
    """Below 2 N four times as soft: the same error moves the tip four times as far, with B in proportion."""
    rows = [(0.0, 0.0, 0.5, 0.005), (2.0, 4.0, 0.5, 0.005), (2.001, 4.001, 2.0, 0.02), (10.0, 8.0, 2.0, 0.02)]
    table = columns([GainRow(**dict(zip(GainRow.model_fields, row, strict=True))) for row in rows])
    steps_mm = [
        increment(begin(table, NO_INVERSE, force_N), table, Settings(NO_INVERSE, PLAIN), force_N + 1.0,
                  ForceReading(force_N, 0), DT_S)[0]
        for force_N in (1.0, 5.0)
    ]  # fmt: skip
    assert steps_mm[0] == pytest.approx(4 * steps_mm[1])


def test_the_inverse_model_moves_by_what_the_reference_needs_and_feedback_then_sees_no_error() -> None:
    memory = begin(linear(), AHEAD.inverse, 3.0)
    step_mm, memory = increment(memory, linear(), AHEAD, 3.25, ForceReading(3.25, 0), DT_S)
    assert step_mm == pytest.approx(0.25)
    assert memory.correction.speed_mm_s == pytest.approx(0.0)


def test_a_jump_is_spread_at_the_speed_allowed_and_feedback_expects_no_more_than_that() -> None:
    slow = Settings(Inverse(0.0, 20.0), PLAIN)
    _, memory = increment(begin(linear(), slow.inverse, 1.0), linear(), slow, 5.0, ForceReading(1.0, 0), DT_S)
    assert memory.ahead.depth_mm == pytest.approx(1.02)
    assert memory.expected.force_N == pytest.approx(1.02)


def test_while_it_searches_everything_starts_anew_at_the_force_measured() -> None:
    settings = Settings(AHEAD.inverse, PLAIN._replace(lost_N=0.05, drift_rad_s=3.0, delay_s=0.005))
    memory = begin(linear(), AHEAD.inverse, 3.0)
    for cycle in range(50):
        _, memory = increment(memory, linear(), settings, 5.0, ForceReading(3.0, cycle), DT_S)
    assert memory.correction.drift_mm_s > 0
    step_mm, memory = increment(memory, linear(), settings, 5.0, ForceReading(0.02, 50), DT_S)
    assert step_mm == pytest.approx(5.0 * DT_S)
    assert memory.correction == NONE
    assert (memory.ahead.depth_mm, memory.expected.force_N) == pytest.approx((0.02, 0.02))
    _, memory = increment(memory, linear(), settings, 5.0, ForceReading(0.06, 51), DT_S)
    assert memory.expected.force_N == pytest.approx(0.02), "what was foreseen before the search is not expected"


def test_a_reference_below_contact_is_no_search() -> None:
    settings = Settings(NO_INVERSE, PLAIN._replace(lost_N=0.05))
    step_mm, _ = increment(holding(0.0), linear(), settings, 0.04, ForceReading(0.0, 0), DT_S)
    assert 0 < step_mm < 0.001
