"""From a tissue model to the table that the force law runs on, and to the span of tissue that the law must hold."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controller.law.inverse_model import GainRow
from controller.law.loop_response import Rates
from controller.law.synthesis import LARGEST_STIFFNESS, LEAST_STIFFNESS, Span
from rig.errors import UsageError
from rig.tissue.intervals import STEP, carried
from rig.tissue.laws import FloatArray, Law
from rig.tissue.model import Model

# The law divides by k + B s: with B smaller than this share of k its gain rises until the sensor's noise is all it has.
LEAST_DAMPING_S = 0.0015
# Up to here the force limit keeps what the tissue bears below 16.5 N at 30 mm/s (tests/controller/safety).
STIFFEST_N_MM, STIFFEST_SLOW_N_MM = 20.0, 10.0
FAST_SAMPLE_S = 0.0021  # a sensor of 500 Hz or more counts as fast; the slow one that was simulated has 100 Hz
SPAN_ROWS = 6


class DampingUnknown(UsageError):
    """The trials of a model leave open whether the tissue damps at all."""


class TissueBounds(NamedTuple):
    """Tangent [N/mm] and damping [N s/mm] at some depths, the least and the largest of their intervals, shape (n,)."""

    depth_mm: FloatArray
    middle: FloatArray
    low: FloatArray
    high: FloatArray


def gain_rows(model: Model, depths_mm: Sequence[float]) -> tuple[GainRow, ...]:
    """Force, tangent and damping at each depth; force must grow with depth, tangent stiffness must be positive."""
    forces = [model.force_N(depth_mm) for depth_mm in depths_mm]
    tangents = [model.tangent_N_mm(depth_mm) for depth_mm in depths_mm]
    _refuse_flat(depths_mm, forces, tangents)
    damping = model.damping_N_s_mm
    return tuple(
        GainRow(force_N=f, depth_mm=d, tangent_N_mm=k, damping_N_s_mm=max(damping, LEAST_DAMPING_S * k))
        for f, d, k in zip(forces, depths_mm, tangents, strict=True)
    )


def span_of(model: Model, rows: Sequence[GainRow], rates: Rates) -> Span:
    """The tissue to be held: half to twice the model, or its own interval where that is wider.

    Raises DampingUnknown, and UsageError for a model whose tissue may have no stiffness, or more than the limit.
    """
    shown = [rows[round(at)] for at in np.linspace(0, len(rows) - 1, SPAN_ROWS)]
    tangent, damping = known_at(model, np.array([row.depth_mm for row in shown]))
    _refuse_undamped(damping)
    _refuse_unsure(tangent)
    _refuse_stiff(tangent, rates)
    return Span(
        tuple(row.tangent_N_mm / row.damping_N_s_mm for row in shown),
        tuple(model.damping_N_s_mm / row.damping_N_s_mm for row in shown),
        (
            min(LEAST_STIFFNESS, float(np.min(tangent.low / tangent.middle))),
            max(LARGEST_STIFFNESS, float(np.max(tangent.high / tangent.middle))),
        ),
        (float(np.min(damping.low / damping.middle)), float(np.max(damping.high / damping.middle))),
    )


def known_at(model: Model, depth_mm: FloatArray) -> tuple[TissueBounds, TissueBounds]:
    """Tangent and damping with their intervals: those of the parameters carried through (delta method)."""
    here = _tangent_and_damping(model.law, depth_mm)
    reach = carried(model.law, _reaches(model), lambda law: _tangent_and_damping(law, depth_mm))
    low, high = np.where(here - reach > STEP * here, here - reach, 0.0), here + reach  # slopes are as exact as STEP
    return TissueBounds(depth_mm, here[0], low[0], high[0]), TissueBounds(depth_mm, here[1], low[1], high[1])


def _tangent_and_damping(law: Law, depth_mm: FloatArray) -> FloatArray:
    return np.array([law.tangent_stiffness(depth_mm), law.damping(depth_mm)])


def _reaches(model: Model) -> FloatArray:
    """The covariance, with how far each parameter's interval reaches to its farther side for its standard error."""
    sides = [max(abs(bound - p.value) for bound in model.intervals[p.name]) for p in model.law.parameters]
    errors = np.sqrt(np.diag(model.covariance))
    products = np.outer(errors, errors)
    correlation = np.divide(model.covariance, products, out=np.eye(len(errors)), where=products > 0)
    return np.asarray(correlation * np.outer(sides, sides))


def _refuse_flat(depths_mm: Sequence[float], forces: Sequence[float], tangents: Sequence[float]) -> None:
    for at, (depth_mm, tangent) in enumerate(zip(depths_mm, tangents, strict=True)):
        if not tangent > 0 or (at and forces[at] <= forces[at - 1]):
            raise UsageError(
                f"the model's tangent stiffness at {depth_mm:.3g} mm is {tangent:.3g} N/mm; gains need it above 0:"
                " use a model fitted up to that depth, of a law that is stiff from contact on (rig fit --model index)"
            )


def _refuse_undamped(damping: TissueBounds) -> None:
    """Raises DampingUnknown where B may be 0: the law divides by it at the frequencies that count."""
    at = int(np.argmin(damping.low))
    if not damping.low[at] > 0:
        raise DampingUnknown(
            f"the model's damping is {damping.middle[at]:.3g} N s/mm, {damping.low[at]:.3g} to {damping.high[at]:.3g};"
            " the force law needs it above 0 with its whole interval: fit trials of several speeds"
            " (rig fit --model index)"
        )


def _refuse_unsure(tangent: TissueBounds) -> None:
    at = int(np.argmin(tangent.low))
    if not tangent.low[at] > 0:
        raise UsageError(
            f"at {tangent.depth_mm[at]:.3g} mm the model's stiffness is {tangent.middle[at]:.3g} N/mm, 0 to"
            f" {tangent.high[at]:.3g}; the force law needs it above 0 with its whole interval: fit more trials"
        )


def _refuse_stiff(tangent: TissueBounds, rates: Rates) -> None:
    at = int(np.argmax(tangent.high))
    limit = STIFFEST_N_MM if rates.sample_s <= FAST_SAMPLE_S else STIFFEST_SLOW_N_MM
    if tangent.high[at] > limit:
        raise UsageError(
            f"at {tangent.depth_mm[at]:.3g} mm the tissue may have {tangent.high[at]:.3g} N/mm, above the"
            f" {limit:g} N/mm up to which the force limit holds with this sensor: fit trials that press less deep"
        )
