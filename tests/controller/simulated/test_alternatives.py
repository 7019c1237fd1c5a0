"""What the force law is compared with: margins by python-control, errors by closed forms, and one judge for all."""

import math
from functools import cache
from itertools import product

import control
import numpy as np
import pytest

from controller.experiments import tracked
from controller.experiments.references import parse_reference
from controller.law.axis_response import rates_of
from controller.law.inverse_model import GainRow
from controller.law.synthesis import SPARE_S
from controller.loop.steps import Program
from controller.simulated.alternatives import alternative_runs as runs
from controller.simulated.alternatives.alternative_laws import axis_of, tissue_of, tuning_for
from controller.simulated.alternatives.alternative_tuning import (
    JUDGED_N,
    LEAST_N,
    Schedule,
    Tuning,
    fastest,
    tissue_at,
)
from mock_devices.testing.made.subjects import NAMES, subject
from rig.config.wiring import Wiring
from rig.results.tracking import AlternativeRun

WIRING = Wiring()
RATES = rates_of(WIRING)
STILL = 0.0, 1.0
BREATHES_MM, BREATHES_HZ = 1.5, 0.25


@cache
def program(name: str) -> Program:
    return tracked.plan_reference(parse_reference("stairs:4"), subject(name), WIRING)


@cache
def tuning(name: str, schedule: Schedule) -> Tuning:
    return tuning_for([runs.tracks(program(name))[0]], RATES, schedule)


def played(name: str, for_all: Tuning, breathing: tuple[float, float] = STILL) -> dict[str, AlternativeRun]:
    found = runs.alternative_runs(name, program(name), subject(name), breathing, RATES, for_all)
    return {run.law: run for run in found}


def margins_by_control(name: str, schedule: Schedule, found: Tuning) -> tuple[float, float]:
    """The smallest phase margin [deg] and gain margin at every depth, half to twice as stiff, 1 ms later.

    The controller as its difference equation in z, axis and tissue as transfer functions, the delay exact.
    """
    step = runs.tracks(program(name))[0]
    cycle_s, axis = RATES.cycle_s, axis_of(step)
    omega = np.geomspace(0.3, np.pi / cycle_s, 500)
    integrator = control.tf([cycle_s, 0], [1, -1], cycle_s)
    law = found.integral * (found.lead_s + integrator) * (1 + found.drift_rad_s * integrator)
    lags = control.tf([1], [axis.lag1_s, 1]) * control.tf([1], [axis.lag2_s, 1])
    same = law(np.exp(1j * omega * cycle_s)) * lags(1j * omega) * np.exp(-1j * omega * (axis.delay_s + SPARE_S))
    phases, gains = [], []
    rows = [row for row in step.gains if row.force_N >= LEAST_N]
    for row, stiffness in product((*rows[::5], rows[-1]), (0.5, 1.0, 2.0)):
        tissue = control.tf([step.damping_N_s_mm, stiffness * row.tangent_N_mm], [1])
        factor = row.depth_mm / row.force_N if schedule == "secant" else 1.0
        gain, phase_deg, *_ = control.stability_margins(control.frd(factor * same * tissue(1j * omega), omega))
        phases.append(phase_deg)
        gains.append(max(gain, 1 / gain))
    return min(phases), min(gains)


@pytest.mark.parametrize("schedule", ["constant", "secant"])
@pytest.mark.parametrize("name", NAMES)
def test_what_is_tuned_keeps_45_degrees_and_6_dB_by_another_programs_count(name: str, schedule: Schedule) -> None:
    phase_deg, gain = margins_by_control(name, schedule, tuning(name, schedule))
    # The search's grid has 100 frequencies and 13 depths.
    assert phase_deg > 44.0
    assert 20 * math.log10(gain) > 5.8


def test_a_model_that_ends_below_the_least_force_is_judged_at_its_last_depth() -> None:
    """F = k x to 0.2 N at 2 N/mm: every depth of it is as stiff as that."""
    rows = [GainRow(force_N=0.02 * at, depth_mm=0.01 * at, tangent_N_mm=2.0, damping_N_s_mm=0.01) for at in range(11)]
    found = tissue_at("constant", rows, 0.01)
    assert set(found.tangent_N_mm) == {2.0}
    assert found.judged.sum() == len(JUDGED_N)


def test_a_tenth_more_gain_would_not_keep_them() -> None:
    """The planted bug: a constant that is tuned above the margins it is said to keep."""
    found = tuning("average", "constant")
    phase_deg, gain = margins_by_control("average", "constant", found._replace(integral=1.1 * found.integral))
    assert phase_deg < 44.0 or 20 * math.log10(gain) < 5.8


def test_under_a_surface_that_moves_a_constant_is_wrong_by_its_speed_over_the_gain_and_half_the_gain_by_twice() -> None:
    """v / If whatever the stiffness is; the force law's second integral leaves a tenth of that."""
    step = runs.tracks(program("average"))[0]
    whole = fastest(axis_of(step), RATES, tissue_of(step, "constant"), Tuning(1.0, 0.006, 0.0))
    left_N = 2 * math.pi * BREATHES_HZ * BREATHES_MM / whole.integral
    for share in (1.0, 0.5):
        found = played("average", whole._replace(integral=share * whole.integral), (BREATHES_MM, BREATHES_HZ))
        constant, law = found["one constant for all"].worst, found[runs.LAW].worst
        assert constant.largest_error_N == pytest.approx(left_N / share, rel=0.12)
        assert law.largest_error_N and law.largest_error_N < 0.2 * left_N


def test_every_law_is_judged_on_the_same_jumps_and_a_gain_of_nothing_never_settles() -> None:
    found = played("firm", Tuning(0.0, 0.0, 0.0))
    assert list(found) == [
        runs.LAW, "constant", "one constant for all", "the study's secant", "variable admittance", "plain PI",
    ]  # fmt: skip
    assert found["one constant for all"].worst_of_wrong.settling_s is None
    # On tissue that is as the model says the inverse model does it all, and no feedback is faster than the axis.
    right = [found[law].worst.settling_s or math.inf for law in (runs.LAW, "constant")]
    assert right == pytest.approx([right[0]] * 2, abs=0.02)
    wrong = [found[law].worst_of_wrong.settling_s or math.inf for law in (runs.LAW, "constant")]
    assert 1.3 * wrong[0] < wrong[1]
