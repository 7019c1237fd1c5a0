"""The force law and its gains: closed forms, bumpless change, stable loops at every depth."""

import cmath
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.law.force_position import (
    Columns,
    GainRow,
    Memory,
    Settings,
    begin,
    columns,
    foresee,
    increment,
    interpolate,
)
from controller.law.gains import Design, margins, pi_gains, schedule
from mock_devices.testing.models import index_model
from rig.errors import UsageError

DESIGN = Design(bandwidth_Hz=34.0, delay_s=0.004, crossover_Hz=8.0, phase_margin_deg=60.0)
PLAIN = Settings(damping_N_s_mm=0.0, lag_s=0.0, ahead_mm_s=0.0, forgetting=0.0, drift_per_s=0.0, drift_limit_mm_s=5.0)
AHEAD = PLAIN._replace(ahead_mm_s=1000.0)


def row(force_N: float, depth_mm: float, integral: float = 1.0, proportional: float = 0.1) -> GainRow:
    return GainRow(
        force_N=force_N, depth_mm=depth_mm, tangent_N_mm=1.0, proportional_mm_N=proportional, integral_mm_N_s=integral
    )


def linear(integral: float = 1.0, proportional: float = 0.1) -> Columns:
    """1 N/mm up to 10 N."""
    return columns((row(0.0, 0.0, integral, proportional), row(10.0, 10.0, integral, proportional)))


def settled(error_N: float, force_N: float) -> Memory:
    """As after a long time at this error, without a reference model."""
    return begin(linear(), force_N, force_N)._replace(error_N=error_N)


def test_an_integral_alone_adds_its_gain_times_error_times_time() -> None:
    step_mm, memory = increment(settled(2.0, 3.0), linear(3.0), PLAIN, 5.0, 3.0, 3.0, 0.001)
    assert step_mm == pytest.approx(0.006)
    assert memory.error_N == 2.0


def test_a_change_of_gains_alone_moves_nothing() -> None:
    memory = settled(0.5, 3.0)
    for table in (linear(1e-9, 0.1), linear(1e-9, 9.0)):
        step_mm, memory = increment(memory, table, PLAIN, 3.5, 3.0, 3.0, 0.001)
        assert step_mm == pytest.approx(0.0, abs=1e-11)


def test_the_inverse_model_moves_by_what_the_reference_needs_and_feedback_then_sees_no_error() -> None:
    step_mm, memory = increment(begin(linear(), 3.0, 3.0), linear(), AHEAD, 3.25, 3.0, 3.0, 0.001)
    assert memory.ahead.depth_mm - 3.0 == pytest.approx(0.25)
    _, memory = increment(memory, linear(), AHEAD, 3.25, 3.25, 3.25, 0.001)
    assert memory.error_N == pytest.approx(0.0)
    assert step_mm > 0.25


def test_a_jump_is_spread_at_the_speed_allowed_and_feedback_expects_no_more_than_that() -> None:
    slow = PLAIN._replace(ahead_mm_s=20.0)
    _, memory = increment(begin(linear(), 1.0, 1.0), linear(), slow, 5.0, 1.0, 1.0, 0.001)
    assert memory.ahead.depth_mm == pytest.approx(1.02)
    assert memory.expected_N == pytest.approx(1.02)


def test_damping_slows_the_inverse_model_so_that_its_force_is_the_reference() -> None:
    damped = PLAIN._replace(ahead_mm_s=1000.0, damping_N_s_mm=0.05)
    _, memory = increment(begin(linear(), 1.0, 1.0), linear(), damped, 2.0, 1.0, 1.0, 0.001)
    moved_mm = memory.ahead.depth_mm - 1.0
    assert moved_mm + 0.05 * moved_mm / 0.001 == pytest.approx(1.0)


def test_interpolation_is_linear_between_points_and_constant_beyond_them() -> None:
    assert [interpolate((0.0, 2.0, 3.0), (1.0, 3.0, 9.0), x) for x in (-1.0, 0.0, 1.0, 2.5, 5.0)] == [1, 1, 2, 6, 9]


@pytest.mark.parametrize("truth", [0.6, 1.5])
def test_adaptation_finds_the_ratio_of_tissue_to_model_while_force_moves(truth: float) -> None:
    settings = AHEAD._replace(ahead_mm_s=24.0, forgetting=0.998)
    memory = begin(linear(), truth * 3.0, 3.0)
    for cycle in range(3000):
        depth_mm = 3.0 + math.sin(2 * math.pi * cycle / 1000)
        _, memory = increment(memory, linear(), settings, 3.0, truth * depth_mm, depth_mm, 0.001)
    assert memory.scale == pytest.approx(truth, rel=0.02)


def test_adaptation_stays_within_its_bounds_and_stands_still_where_nothing_moves() -> None:
    settings = AHEAD._replace(ahead_mm_s=24.0, forgetting=0.998)
    memory = begin(linear(), 3.0, 3.0)
    for _ in range(3000):
        _, memory = increment(memory, linear(), settings, 3.0, 3.0, 3.0, 0.001)
    assert memory.scale == 1.0
    for cycle in range(3000):
        depth_mm = 3.0 + math.sin(2 * math.pi * cycle / 1000)
        _, memory = increment(memory, linear(), settings, 3.0, 9.0 * depth_mm, depth_mm, 0.001)
    assert memory.scale == 2.0


@given(tangent=st.floats(0.05, 10.0), damping=st.floats(0.0, 0.05), crossover=st.floats(0.5, 8.0))
def test_the_open_loop_crosses_unity_where_it_was_told_with_the_margin_asked_or_more(
    tangent: float, damping: float, crossover: float
) -> None:
    design = Design(34.0, 0.002, crossover, 60.0)
    proportional, integral = pi_gains(tangent, damping, design)
    found = margins((proportional, integral), tangent, damping, design)
    wc, axis = 2 * math.pi * found.crossover_Hz, 2 * math.pi * 34.0
    plant = (tangent + 1j * wc * damping) * axis / (axis + 1j * wc) * cmath.exp(-1j * wc * 0.002)
    loop = (proportional + integral / (1j * wc)) * plant
    assert abs(loop) == pytest.approx(1.0, rel=1e-9)
    assert math.degrees(cmath.phase(loop)) + 180.0 == pytest.approx(found.phase_deg, abs=1e-6)
    assert found.phase_deg >= 60.0 - 1e-6
    assert found.gain >= design.gain_margin - 1e-6
    assert found.crossover_Hz <= crossover * (1 + 1e-9)


def test_without_damping_the_crossover_is_the_one_asked_for() -> None:
    assert margins(pi_gains(1.0, 0.0, DESIGN), 1.0, 0.0, DESIGN).crossover_Hz == pytest.approx(8.0)


def test_the_secant_reads_the_plant_low_and_so_makes_the_loop_faster_than_designed_where_tissue_stiffens() -> None:
    model = index_model(0.12, 0.22, 0.0)
    depth_mm = model.depth_mm(10.0)
    rows = {choice: schedule(model, DESIGN, (0.0, depth_mm), choice)[-1] for choice in ("tangent", "secant")}
    ratio = rows["secant"].integral_mm_N_s / rows["tangent"].integral_mm_N_s
    assert ratio == pytest.approx(1 + 0.22 * depth_mm)


def test_constant_gains_and_admittance_are_the_same_at_every_depth_and_admittance_knows_no_inverse() -> None:
    model = index_model(0.12, 0.22, 0.0)
    for choice in ("constant", "admittance"):
        rows = schedule(model, DESIGN, (0.0, 4.0, 8.0), choice)
        assert len({row.integral_mm_N_s for row in rows}) == 1
    assert {row.proportional_mm_N for row in schedule(model, DESIGN, (0.0, 4.0, 8.0), "admittance")} == {0.0}


def test_a_model_without_tangent_stiffness_is_refused_with_the_depth() -> None:
    flat = index_model(0.12, 0.22, 0.0)
    with pytest.raises(UsageError, match=r"tangent stiffness at -1 mm is 0 N/mm; gains need it above 0"):
        schedule(flat, DESIGN, (-1.0, 1.0))


def test_a_loop_that_half_as_stiff_again_tissue_would_make_fragile_is_refused() -> None:
    with pytest.raises(UsageError, match=r"50 % stiffer than the model would leave .* deg of phase margin"):
        pi_gains(1.0, 0.0, Design(34.0, 0.004, 20.0, 21.0, gain_margin=1.01))


def test_gains_of_another_stiffness_that_make_the_loop_unstable_on_the_model_are_refused_with_its_margins() -> None:
    stiffening = index_model(0.01, 0.9, 0.0, force_N=11.0)
    depths = [0.1 * stiffening.valid.depth_mm * part for part in range(1, 11)]
    schedule(stiffening, DESIGN, depths, "tangent")
    with pytest.raises(UsageError, match=r"secant gains for 8 Hz are unstable where the model has .* N/mm: phase"):
        schedule(stiffening, DESIGN, depths, "secant")


def test_gains_are_in_proportion_to_compliance() -> None:
    soft, stiff = pi_gains(0.5, 0.0, DESIGN), pi_gains(5.0, 0.0, DESIGN)
    assert soft[1] == pytest.approx(10 * stiff[1])


def test_a_margin_that_the_delay_forbids_is_refused() -> None:
    with pytest.raises(UsageError, match=r"lower loop\.crossover_Hz"):
        pi_gains(1.0, 0.0, Design(1.0, 0.1, 5.0, 89.0))


def test_the_inverse_of_a_model_with_memory_asks_for_the_force_that_the_tissue_with_memory_gives() -> None:
    """The tissue is stepped by its own exact recursion; only the discretisation of one cycle is left."""
    settings = AHEAD._replace(ahead_mm_s=1e3, ratio1=0.5, tau1_s=0.2)
    ahead, rest_N, transient_N = begin(linear(), 1.0, 1.0).ahead, 1.0, 0.0
    for _ in range(400):
        before_mm = ahead.depth_mm
        ahead, _ = foresee(linear(), settings, ahead, 1.0, 3.0, 0.001)
        transient_N = transient_N * math.exp(-0.001 / 0.2) + 0.5 * (ahead.depth_mm - before_mm)
        rest_N += ahead.depth_mm - before_mm
    assert rest_N + transient_N == pytest.approx(3.0, abs=0.01)
    assert rest_N == pytest.approx(3.0, abs=0.3), "it creeps on to where the lasting force is the reference"


def test_the_inverse_of_a_model_with_friction_turns_the_guide_round_at_a_reversal() -> None:
    """Pushing in, the guide carries its level; on the way out it holds back as much."""
    settings = AHEAD._replace(friction_N=0.2, friction_mm=0.05)
    places = []
    for reference_N in (3.0, 2.0):
        ahead = begin(linear(), 2.5, 2.5, settings.friction_N).ahead
        for _ in range(2000):
            ahead, foreseen_N = foresee(linear(), settings, ahead, 1.0, reference_N, 0.001)
        assert foreseen_N == pytest.approx(reference_N, abs=1e-6)
        places.append(ahead.depth_mm)
    assert places == pytest.approx([2.8, 2.2], abs=settings.friction_mm)
