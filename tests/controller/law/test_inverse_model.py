"""The inverse tissue model: closed forms of elastic, damped, relaxing and rubbing tissue."""

import math

import pytest

from controller.law.inverse_model import Columns, GainRow, Inverse, columns, foresee, interpolate, resting

AHEAD = Inverse(damping_N_s_mm=0.0, ahead_mm_s=1e3)


def linear() -> Columns:
    """1 N/mm up to 10 N."""
    return columns([GainRow(force_N=at, depth_mm=at, tangent_N_mm=1.0, damping_N_s_mm=0.01) for at in (0.0, 10.0)])


def test_interpolation_is_linear_between_points_and_constant_beyond_them() -> None:
    assert [interpolate((0.0, 2.0, 3.0), (1.0, 3.0, 9.0), x) for x in (-1.0, 0.0, 1.0, 2.5, 5.0)] == [1, 1, 2, 6, 9]


def test_damping_slows_the_inverse_model_so_that_its_force_is_the_reference() -> None:
    damped = AHEAD._replace(damping_N_s_mm=0.05)
    ahead, _ = foresee(linear(), damped, resting(linear(), damped, 1.0), 2.0, 0.001)
    moved_mm = ahead.depth_mm - 1.0
    assert moved_mm + 0.05 * moved_mm / 0.001 == pytest.approx(1.0)


def test_the_inverse_of_a_model_with_memory_asks_for_the_force_that_the_tissue_with_memory_gives() -> None:
    """The tissue is stepped by its own exact recursion; only the discretisation of one cycle is left."""
    inverse = AHEAD._replace(ratio1=0.5, tau1_s=0.2)
    ahead, rest_N, transient_N = resting(linear(), inverse, 1.0), 1.0, 0.0
    for _ in range(400):
        before_mm = ahead.depth_mm
        ahead, _ = foresee(linear(), inverse, ahead, 3.0, 0.001)
        transient_N = transient_N * math.exp(-0.001 / 0.2) + 0.5 * (ahead.depth_mm - before_mm)
        rest_N += ahead.depth_mm - before_mm
    assert rest_N + transient_N == pytest.approx(3.0, abs=0.01)
    assert rest_N == pytest.approx(3.0, abs=0.3), "it creeps on to where the lasting force is the reference"


def test_the_inverse_of_a_model_with_friction_turns_the_guide_round_at_a_reversal() -> None:
    """Pushing in, the guide carries its level; on the way out it holds back as much."""
    inverse = AHEAD._replace(friction_N=0.2, friction_mm=0.05)
    places = []
    for reference_N in (3.0, 2.0):
        ahead = resting(linear(), inverse, 2.5)
        for _ in range(2000):
            ahead, foreseen_N = foresee(linear(), inverse, ahead, reference_N, 0.001)
        assert foreseen_N == pytest.approx(reference_N, abs=1e-6)
        places.append(ahead.depth_mm)
    assert places == pytest.approx([2.8, 2.2], abs=inverse.friction_mm)
