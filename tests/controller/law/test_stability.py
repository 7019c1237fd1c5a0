"""What is said of a loop's stability and reach: the same at every depth, and in closed form where there is one."""

import math

import numpy as np
import pytest

from controller.law.inverse_model import GainRow
from controller.law.loop_response import Constants, Rates
from controller.law.stability import ForceLoop, loop_for, nearest
from controller.law.synthesis import Span
from rig.config.axis_response import AxisResponse

AXIS = AxisResponse(0.002, 0.0025, 0.0037, 0.0067)
FAST = Rates(0.001, 0.001)
SPAN = Span((20.0, 80.0, 300.0), (1.0, 1.0, 1.0))
LOOP = loop_for(AXIS, FAST, SPAN)


def test_every_tissue_is_the_same_plant() -> None:
    """Crossovers agree to the sampling's share of them, from 20 to 300 rad/s of k / B."""
    found = LOOP.margins()
    assert np.ptp(found.crossover_rad_s) < 0.05 * np.mean(found.crossover_rad_s)
    assert np.ptp(found.phase_deg) < 6.0


def test_the_worst_of_the_span_is_worse_than_the_model_and_better_than_was_asked_for_with_delay_to_spare() -> None:
    phase_deg, gain = LOOP.worst()
    assert 45.0 < phase_deg < np.min(LOOP.margins().phase_deg)
    assert 2.0 < gain < np.min(LOOP.margins().gain)


def test_stiffer_tissue_has_less_margin_and_no_more_than_the_one_tolerated() -> None:
    at = LOOP.at(GainRow(force_N=1.0, depth_mm=1.0, tangent_N_mm=0.8, damping_N_s_mm=0.01), 0.01)
    assert at.span.corners_rad_s == (80.0,)
    factor = float(at.tolerated()[0])
    phases = [float(at.margins(stiffness).phase_deg[0]) for stiffness in (1.0, 2.0, 0.99 * factor, 1.2 * factor)]
    assert phases == sorted(phases, reverse=True)
    assert phases[2] > 0 > phases[3]


def test_motion_below_all_corners_is_left_as_two_integrals_leave_it() -> None:
    """|S| of w^2 / (wc wd): at 0.05 Hz, far below wd."""
    slow = 2 * math.pi * 0.05
    law = LOOP.law
    assert LOOP.left_of_motion(0.05) == pytest.approx(slow**2 / (law.crossover_rad_s * law.drift_rad_s), rel=0.05)


def test_sensitivity_is_no_larger_than_margins_of_45_degrees_allow_and_no_smaller_than_1() -> None:
    """A loop at a distance d from -1 everywhere has at least 2 asin(d / 2) of phase margin (textbook)."""
    largest = LOOP.largest_sensitivity()
    assert 1.0 < largest < 2.5
    phase_deg, _ = LOOP.worst()
    assert phase_deg >= math.degrees(2 * math.asin(0.5 / largest)) - 0.1


def test_a_slow_law_plays_back_less_noise() -> None:
    slow = ForceLoop(AXIS, FAST, Constants(10.0, 0.0, 2.0), SPAN)
    assert slow.noise_share() < 0.5 * LOOP.noise_share()


def test_the_row_nearest_to_a_force_stands_for_it() -> None:
    rows = [GainRow(force_N=at, depth_mm=at, tangent_N_mm=1.0, damping_N_s_mm=0.01) for at in (0.0, 1.0, 2.0)]
    assert [row.force_N for row in nearest(rows, (0.4, 0.6, 9.0))] == [0.0, 1.0, 2.0]
