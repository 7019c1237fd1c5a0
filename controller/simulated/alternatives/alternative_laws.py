"""The alternatives, each made of the force law's own track step: the same tissue, axis, inverse model and limits."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from controller.law.inverse_model import Columns, columns
from controller.law.loop_response import Rates
from controller.loop.steps import TrackForce
from controller.simulated.alternatives.alternative_law import (
    AlternativeColumns,
    AlternativeFeedback,
    AlternativeSettings,
)
from controller.simulated.alternatives.alternative_tuning import (
    DRIFTS_RAD_S,
    Schedule,
    TissueAt,
    Tuning,
    factors,
    fastest,
    tissue_at,
    tuned,
)
from rig.config.axis_response import AxisResponse

# A mass that answers a third as fast as the axis: what an admittance filters the sensor's noise with.
MASS_S = 0.015
VARY = 1.0  # damping halves where the error is all of the force: more, and the margins of the half would be lost


class Alternative(NamedTuple):
    """A law as it is run, and how early it is asked."""

    table: AlternativeColumns
    settings: AlternativeSettings
    preview_s: float


def pi(step: TrackForce, schedule: Schedule, tuning: Tuning, ahead: bool = True) -> Alternative:
    """PI with gains by ``schedule``; ``ahead``: with inverse model, expectation and preview."""
    integral = tuning.integral * factors(schedule, step.gains)
    tissue = Columns(*map(np.array, columns(step.gains)))
    table = AlternativeColumns(*tissue, tuning.lead_s * integral, integral)
    inverse, common = step.settings
    inverse = inverse if ahead else inverse._replace(ahead_mm_s=0.0)
    vary = VARY if tuning.mass_s else 0.0
    feedback = AlternativeFeedback(common, tuning.drift_rad_s, ahead, tuning.mass_s, vary)
    return Alternative(table, AlternativeSettings(inverse, feedback), step.preview_s if ahead else 0.0)


def admittance(step: TrackForce, rates: Rates) -> Alternative:
    """Admittance with variable damping, as robots for massage and ultrasound have it: one damper for a subject."""
    slow = fastest(axis_of(step), rates, tissue_of(step, "constant"), Tuning(1.0, 0.0, 0.0, MASS_S))
    return pi(step, "constant", slow._replace(integral=slow.integral / (1 + VARY)), ahead=False)


def alternatives(step: TrackForce, rates: Rates, for_all: Tuning) -> Iterator[tuple[str, Alternative]]:
    """Each by its name, tuned for the tissue of ``step`` but the one constant ``for_all``."""
    yield "constant", pi(step, "constant", tuning_for([step], rates, "constant"))
    yield "one constant for all", pi(step, "constant", for_all)
    yield "the study's secant", pi(step, "secant", tuning_for([step], rates, "secant"))
    yield "variable admittance", admittance(step, rates)
    yield "plain PI", pi(step, "constant", tuning_for([step], rates, "constant", (0.0,)), ahead=False)


def tuning_for(
    steps: Sequence[TrackForce], rates: Rates, schedule: Schedule, drifts_rad_s: Sequence[float] = DRIFTS_RAD_S
) -> Tuning:
    """The best for the tissues of all ``steps`` together, on the axis of the first."""
    return tuned(axis_of(steps[0]), rates, [tissue_of(step, schedule) for step in steps], drifts_rad_s)


def tissue_of(step: TrackForce, schedule: Schedule) -> TissueAt:
    """The tissue that a step knows."""
    return tissue_at(schedule, step.gains, step.damping_N_s_mm)


def axis_of(step: TrackForce) -> AxisResponse:
    """The axis that a step knows."""
    return AxisResponse(step.delay_s, step.lag1_s, step.lag2_s, step.preview_s)
