"""From a tissue model to the table that the force law runs on, and to the span of tissue that the law must hold."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controller.law.inverse_model import GainRow
from controller.law.loop_response import Rates
from controller.law.synthesis import LARGEST_STIFFNESS, LEAST_STIFFNESS, Span
from rig.errors import UsageError
from rig.tissue.control_table import control_rows
from rig.tissue.laws import FloatArray, Law
from rig.tissue.model import Model
from rig.tissue.summary import ControlRow

# The law divides by k + B s: with B smaller than this share of k its gain rises until the sensor's noise is all it has.
LEAST_DAMPING_S = 0.0015
# Up to here the force limit keeps what the tissue bears below 16.5 N at 30 mm/s (tests/controller/safety).
STIFFEST_N_MM, STIFFEST_SLOW_N_MM = 20.0, 10.0
FAST_SAMPLE_S = 0.0021  # a sensor of 500 Hz or more counts as fast; the slow one that was simulated has 100 Hz
SPAN_ROWS = 6


class Known(NamedTuple):
    """A model's law as `control_rows` takes it."""

    law: Law
    covariance: FloatArray
    reach: float


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

    Raises UsageError for a model whose damping is not known, or whose tissue may be stiffer than the limit.
    """
    shown = [rows[round(at)] for at in np.linspace(0, len(rows) - 1, SPAN_ROWS)]
    known = control_rows(Known(model.law, model.covariance, _reach(model)), [row.force_N for row in shown])
    _refuse_undamped(model, known)
    _refuse_stiff(known, rates)
    middle = known[len(known) // 2]
    return Span(
        tuple(row.tangent_N_mm / row.damping_N_s_mm for row in shown),
        tuple(model.damping_N_s_mm / row.damping_N_s_mm for row in shown),
        (
            min(LEAST_STIFFNESS, *(row.tangent_low_N_mm / row.tangent_N_mm for row in known)),
            max(LARGEST_STIFFNESS, *(row.tangent_high_N_mm / row.tangent_N_mm for row in known)),
        ),
        (
            middle.damping_low_N_s_mm / middle.damping_N_s_mm,
            middle.damping_high_N_s_mm / middle.damping_N_s_mm,
        ),
    )


def _reach(model: Model) -> float:
    """How many standard errors the model's intervals reach from their middle."""
    halves = {name: 0.5 * (high - low) for name, (low, high) in model.intervals.items()}
    errors = {name: error for name, error in model.standard_errors.items() if error > 0 and name in halves}
    return max((halves[name] / error for name, error in errors.items()), default=0.0)


def _refuse_flat(depths_mm: Sequence[float], forces: Sequence[float], tangents: Sequence[float]) -> None:
    for at, (depth_mm, tangent) in enumerate(zip(depths_mm, tangents, strict=True)):
        if not tangent > 0 or (at and forces[at] <= forces[at - 1]):
            raise UsageError(
                f"the model's tangent stiffness at {depth_mm:.3g} mm is {tangent:.3g} N/mm; gains need it above 0:"
                " use a model fitted up to that depth, of a law that is stiff from contact on (rig fit --model index)"
            )


def _refuse_undamped(model: Model, known: Sequence[ControlRow]) -> None:
    low = min(row.damping_low_N_s_mm for row in known)
    if not (model.damping_N_s_mm > 0 and low > 0):
        high = max(row.damping_high_N_s_mm for row in known)
        raise UsageError(
            f"the model's damping is {model.damping_N_s_mm:.3g} N s/mm, {low:.3g} to {high:.3g}; the force law needs"
            " it above 0 with its whole interval: fit trials of several speeds (rig fit --model index)"
        )


def _refuse_stiff(known: Sequence[ControlRow], rates: Rates) -> None:
    stiffest = max(known, key=lambda row: row.tangent_high_N_mm)
    limit = STIFFEST_N_MM if rates.sample_s <= FAST_SAMPLE_S else STIFFEST_SLOW_N_MM
    if stiffest.tangent_high_N_mm > limit:
        raise UsageError(
            f"at {stiffest.force_N:.3g} N the tissue may have {stiffest.tangent_high_N_mm:.3g} N/mm, above the"
            f" {limit:g} N/mm up to which the force limit holds with this sensor: track lower forces"
        )
