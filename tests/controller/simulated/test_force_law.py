"""What the force law reaches in simulation on five subjects, and that each of its parts is what reaches it.

Bounds are goals set before the law was written (limb motion, wrong models, contact), as the worst of five subjects.
"""

import numpy as np
import pytest

from controller.experiments import tracking
from controller.law.stability import nearest
from controller.loop.steps import TrackForce
from controller.simulated.bench import SimulatedBench, follow, limb_of
from mock_devices.testing.made.law_in_simulation import (
    FORCES_N,
    WIRING,
    breathing_mN,
    changed,
    jumps,
    law,
    low_jumps,
    moved_mN,
    peak,
    rms_mN,
    sine_mN,
)
from mock_devices.testing.made.subjects import NAMES, RESPONSE, subject
from rig.simulation.axis_plant import ModelledLimb


@pytest.mark.parametrize(("force_N", "goal_mN"), zip(FORCES_N, (28, 34, 45, 77, 128), strict=True))
def test_a_limb_that_moves_half_a_millimetre_at_2_Hz_is_followed(force_N: float, goal_mN: float) -> None:
    assert moved_mN(force_N) < goal_mN


def test_without_its_second_integral_the_law_follows_no_limb() -> None:
    assert moved_mN(0.5, drift_rad_s=0.0) > 2 * moved_mN(0.5)


def test_told_one_stiffness_for_all_forces_the_law_follows_no_limb_at_low_force() -> None:
    def constant(name: str) -> TrackForce:
        stiffest = law(name).gains[-1]
        told = {"tangent_N_mm": stiffest.tangent_N_mm, "damping_N_s_mm": stiffest.damping_N_s_mm}
        return changed(name, gains=tuple(row.model_copy(update=told) for row in law(name).gains))

    worst = max(rms_mN(constant(name), name, 0.5, breathing_mm=0.5, breathing_Hz=2.0) for name in NAMES)
    assert worst > 2 * 28


@pytest.mark.parametrize(("force_N", "goal_mN"), [(0.5, 2.2), (10.0, 6.9)])
def test_breathing_is_followed(force_N: float, goal_mN: float) -> None:
    for name in NAMES:
        assert breathing_mN(name, force_N) < goal_mN


@pytest.mark.parametrize("force_N", [0.5, 10.0])
def test_a_limb_that_rests_is_left_at_rest(force_N: float) -> None:
    assert max(rms_mN(law(name), name, force_N) for name in NAMES) < 14


def test_a_contact_hardly_overshoots() -> None:
    assert max(peak(law(name), name) for name in NAMES) < 1.05


def test_a_law_that_does_not_start_anew_at_contact_presses_on_with_what_it_expected() -> None:
    assert max(peak(changed(name, contact_force_N=-1.0), name) for name in NAMES) > 1.3


@pytest.mark.parametrize("stiffness", [0.5, 1.0, 2.0])
def test_jumps_of_1_N_settle_on_tissue_half_and_twice_as_stiff_as_the_model(stiffness: float) -> None:
    for name in NAMES:
        overshoot, settling_s = jumps(law(name), name, tuple(map(float, range(1, 11))), stiffness)
        assert overshoot < (9.6 if stiffness != 1.0 else 2.5), name
        assert settling_s < (0.145 if stiffness != 1.0 else 0.09), name


@pytest.mark.parametrize("stiffness", [0.5, 1.0, 2.0])
def test_small_jumps_at_low_force_settle_likewise(stiffness: float) -> None:
    for name in NAMES:
        overshoot, settling_s = low_jumps(name, stiffness)
        assert overshoot < 14.6, name
        assert settling_s <= 0.103, name


def test_a_lead_of_the_wrong_sign_does_not_settle() -> None:
    step = changed("average", lead_s=-law("average").lead_s)
    trace = follow(step, np.full(4000, 2.0), SimulatedBench(limb_of(subject("average"))))
    assert np.std(trace.force_N[2000:]) > 0.1


@pytest.mark.parametrize(("frequency_Hz", "goal_mN"), [(0.5, 2.5), (1.0, 3.8), (2.0, 9.3), (5.0, 39.0), (10.0, 155.0)])
def test_sines_are_followed_on_tissue_half_and_twice_as_stiff_as_the_model(frequency_Hz: float, goal_mN: float) -> None:
    assert max(sine_mN(name, frequency_Hz, factor) for name in NAMES for factor in (0.5, 1.0, 2.0)) < goal_mN


@pytest.mark.parametrize("bug", [{"delay_s": 0.0, "lag1_s": 0.0}, {"preview_s": 0.0}], ids=["expected", "asked for"])
def test_a_force_that_is_expected_or_asked_for_at_the_wrong_time_is_seen_in_sines(bug: dict[str, float]) -> None:
    right_mN = max(sine_mN(name, 5.0, 1.0) for name in NAMES)
    assert max(sine_mN(name, 5.0, 1.0, **bug) for name in NAMES) > 2 * right_mN


def test_feedback_that_is_limited_by_the_axis_does_not_overshoot_when_it_comes_free() -> None:
    """Twice as soft a limb, a jump of 8 N: the axis is at its limit for a tenth of a second."""
    trace = follow(law("soft"), np.repeat((1.0, 9.0), 1500), SimulatedBench(limb_of(subject("soft"), 0.5)))
    assert np.max(trace.force_N) < 9.0 + 0.08 * 8.0


@pytest.mark.parametrize(("later_s", "phase_deg", "gain"), [(0.0, 58.0, 3.0), (0.001, 45.0, 2.0)])
def test_the_margins_over_half_to_twice_the_stiffness_are_those_that_the_documentation_states(
    later_s: float, phase_deg: float, gain: float
) -> None:
    for name in NAMES:
        loop = tracking.loop_for(subject(name), WIRING, RESPONSE)
        late = loop._replace(axis=RESPONSE._replace(delay_s=RESPONSE.delay_s + later_s))
        found = late.worst()
        assert found[0] > phase_deg - 0.5
        assert found[1] > 0.99 * gain
        assert loop.largest_sensitivity() < 1.7


@pytest.mark.parametrize(("share", "swings"), [(1.0, False), (2.0, True)], ids=["as stiff", "twice"])
def test_a_stiff_environment_is_met_without_swinging_up_to_the_stated_stiffness(share: float, swings: bool) -> None:
    """A spring in place of the limb, 0.5 mm away: `rig simulate` states up to which stiffness the loop is stable."""
    for name in NAMES:
        loop, rows = tracking.loop_for(subject(name), WIRING, RESPONSE), tracking.rows_of(subject(name))
        (row,) = nearest(rows, [0.5])
        damping = subject(name).damping_N_s_mm
        stiff_N_mm = share * row.tangent_N_mm * float(loop.at(row, damping).tolerated()[0])
        spring = ModelledLimb(np.array([0.0, 40.0]), np.array([0.0, 40.0 * stiff_N_mm]), damping)
        trace = follow(law(name), np.full(4000, 0.5), SimulatedBench(spring), clearance_mm=0.5)
        assert (np.ptp(trace.force_N[3000:]) > 0.3) == swings, name
