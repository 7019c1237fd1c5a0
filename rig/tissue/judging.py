"""How wrong a fitted law is, in the study's terms: displacement at given forces, on fitted and on left-out curves."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from rig.errors import DataError
from rig.tissue.fitting import LawFit, early_offset, fit_law, residual_force
from rig.tissue.intervals import student_reach
from rig.tissue.laws import FloatArray, Law
from rig.trials.curves import Curve
from rig.trials.streams import in_order

ROWS = 10
JACKKNIFE_GROUPS = 5  # with fewer, Student's t reaches so far that an interval says nothing
MOST_GROUPS = 40  # an interval over 40 is 3 % wider than over any number (Student); each costs a fit of all curves
OVER_TRIALS, OVER_SUBJECTS = "jackknife over trials", "jackknife over subjects"
UNKNOWN_SHARE = 0.3  # of its range: a parameter drawn evenly from the whole of it deviates by 0.29
# A parabola follows any law over half a millimetre; five samples leave two to average over.
SMOOTH_MM = 0.5
LEAST_SMOOTHED = 5
LEAST_MEASURED_MM = 0.1  # a percentage of less is one of the uncertainty of contact


@dataclass(frozen=True)
class Errors:
    """Displacement of n curves at r given forces, measured and predicted; NaN where a curve did not reach the force.

    The error of a row is |predicted - measured| in mm, and the same in percent of measured; rows measured below 0.1 mm
    have no percentage. ``rmse_N`` is the root mean square of predicted minus measured force beyond contact.
    """

    force_N: FloatArray
    measured_mm: FloatArray
    predicted_mm: FloatArray
    rmse_N: float

    @property
    def error_mm(self) -> FloatArray:
        """Shape (n, r)."""
        return np.abs(self.predicted_mm - self.measured_mm)

    @property
    def error_percent(self) -> FloatArray:
        """Shape (n, r)."""
        measured = np.where(self.measured_mm >= LEAST_MEASURED_MM, self.measured_mm, np.nan)
        return np.asarray(100 * self.error_mm / measured)

    @property
    def max_error_mm(self) -> float:
        """Worst of all rows and curves."""
        return _largest(self.error_mm)

    @property
    def max_error_percent(self) -> float:
        """Worst of all rows and curves."""
        return _largest(self.error_percent)


def _largest(errors: FloatArray) -> float:
    known = errors[np.isfinite(errors)]
    if not len(known):
        raise DataError("no trial crosses a given force between two of its samples; record more samples a trial")
    return float(known.max())


@dataclass(frozen=True)
class Judged:
    """A fitted law, its covariance, intervals and errors; left-out errors are None where nothing can be left out.

    ``reach`` is how many standard errors an interval reaches from its middle.
    """

    fit: LawFit
    covariance: FloatArray
    reach: float
    intervals: dict[str, tuple[float, float]]
    interval_method: str
    fitted: Errors
    trials_left_out: Errors | None
    speeds_left_out: Errors | None
    subjects_left_out: Errors | None

    @property
    def law(self) -> Law:
        """The law fitted to all curves."""
        return self.fit.law


def given_forces(curves: Sequence[Curve], rows: int = ROWS) -> FloatArray:
    """Evenly spaced forces, shape (rows,), up to one that all trials reach but those that ended early.

    Early means a largest force below 80 % of the median trial's.
    """
    largest = np.array([curve.max_force_N for curve in curves])
    top_N = largest[largest >= 0.8 * np.median(largest)].min()
    return np.asarray(top_N * np.arange(1, rows + 1) / rows)


def displacement_at(curve: Curve, force_N: FloatArray) -> FloatArray:
    """Depth [mm] at which the curve first reaches each force; NaN where it does not.

    Dense samples: where the parabola of least squares through the samples within a quarter of a millimetre has that
    force. Sparse ones: by a monotone cubic (Fritsch and Carlson 1980) through the samples.
    """
    inside = curve.depth_mm > 0
    depth, force = curve.depth_mm[inside], curve.force_N[inside]
    higher = in_order(force)
    if np.count_nonzero(higher) < 2:
        return np.full_like(force_N, np.nan)
    nodes_N, nodes_mm = force[higher], depth[higher]
    if np.ptp(depth) / len(depth) > SMOOTH_MM / LEAST_SMOOTHED:
        return np.asarray(PchipInterpolator(nodes_N, nodes_mm, extrapolate=False)(force_N))
    first_mm = np.interp(force_N, nodes_N, nodes_mm, left=np.nan, right=np.nan)
    return np.array([_smoothed(depth, force, at, float(given)) for at, given in zip(first_mm, force_N, strict=True)])


def _smoothed(depth_mm: FloatArray, force_N: FloatArray, first_mm: float, given_N: float) -> float:
    """Depth near ``first_mm`` at which the local parabola has the given force."""
    near = np.abs(depth_mm - first_mm) <= SMOOTH_MM / 2
    if np.count_nonzero(near) < LEAST_SMOOTHED:
        return first_mm
    bend, slope, level = np.polyfit(depth_mm[near] - first_mm, force_N[near], 2)
    step_mm = (given_N - level) / slope
    # One more round of Newton's method puts the bend in.
    step_mm += (given_N - level - slope * step_mm - bend * step_mm**2) / (slope + 2 * bend * step_mm)
    return float(first_mm + np.clip(step_mm, -SMOOTH_MM / 2, SMOOTH_MM / 2))


class Prediction(NamedTuple):
    """A law applied to a curve: where the law puts contact, and where displacement is measured from, both in mm."""

    curve: Curve
    law: Law
    offset_mm: float
    origin_mm: float


def errors_of(predictions: Sequence[Prediction], force_N: FloatArray) -> Errors:
    """Errors of displacement at given forces; depths count from each prediction's origin."""
    measured = [displacement_at(p.curve, force_N) - p.origin_mm for p in predictions]
    predicted = [
        p.law.depth(force_N, float(np.median(p.curve.rate_mm_s))) + p.offset_mm - p.origin_mm for p in predictions
    ]
    residuals = np.concatenate([residual_force(p.law, p.curve, p.offset_mm)[1] for p in predictions])
    return Errors(force_N, np.array(measured), np.array(predicted), float(np.sqrt(np.mean(residuals**2))))


def judge(fit: LawFit, curves: Sequence[Curve], force_N: FloatArray, origins_mm: FloatArray) -> Judged:
    """Judges the fit, and fits of its law to all but one trial, all but one speed and all but one subject in turn.

    ``origins_mm``, shape (n,), is where displacement is measured from, relative to the contact found: the same for all
    laws that are compared.
    """
    origin = {curve.name: float(origin) for curve, origin in zip(curves, origins_mm, strict=True)}
    here = [
        Prediction(curve, fit.law, float(offset), origin[curve.name])
        for curve, offset in zip(curves, fit.offsets_mm, strict=True)
    ]
    # Cycles of one recording share its day, site and rest: they leave together, unless there is no other.
    recordings = {curve.trial for curve in curves}
    trials = _without_each(curves, fit, lambda curve: curve.trial if len(recordings) > 1 else curve.name)
    speeds = _without_each(curves, fit, lambda curve: curve.speed_mm_s)
    subjects = _without_each(curves, fit, lambda curve: curve.subject)
    by_subject = list({id(law): law for _, law in subjects}.values())
    by_trial = list({id(law): law for _, law in trials}.values())
    covariance, method = _covariance(fit, by_trial, by_subject)
    groups = len(by_subject) if method == OVER_SUBJECTS else max(len(by_trial), 1)
    return Judged(
        fit=fit,
        covariance=covariance,
        reach=student_reach(groups - 1),
        intervals=_intervals(fit.law, covariance, groups),
        interval_method=method,
        fitted=errors_of(here, force_N),
        trials_left_out=_left_out(trials, origin, force_N),
        speeds_left_out=_left_out(speeds, origin, force_N),
        subjects_left_out=_left_out(subjects, origin, force_N),
    )


def _without_each(
    curves: Sequence[Curve], fit: LawFit, group: Callable[[Curve], str | float]
) -> list[tuple[Curve, Law]]:
    """Each curve with the law fitted to the curves of all other groups; empty where there is but one group.

    Of more than MOST_GROUPS some leave together, or the time would grow with the square of the trials.
    """
    pairs: list[tuple[Curve, Law]] = []
    names = list(dict.fromkeys(group(curve) for curve in curves))
    count = min(len(names), MOST_GROUPS)
    for leaving in (set(names[first::count]) for first in range(count if count > 1 else 0)):
        kept = np.array([group(curve) not in leaving for curve in curves])
        start = replace(fit, offsets_mm=fit.offsets_mm[kept], holds_N2_mm2=fit.holds_N2_mm2[kept])
        law = fit_law(type(fit.law), [c for c, keep in zip(curves, kept, strict=True) if keep], start).law
        pairs += [(c, law) for c, keep in zip(curves, kept, strict=True) if not keep]
    return pairs


def _left_out(pairs: Sequence[tuple[Curve, Law]], origin: Mapping[str, float], force_N: FloatArray) -> Errors | None:
    if not pairs:
        return None
    return errors_of([Prediction(c, law, early_offset(law, c), origin[c.name]) for c, law in pairs], force_N)


def _covariance(fit: LawFit, by_trial: Sequence[Law], by_subject: Sequence[Law]) -> tuple[FloatArray, str]:
    """Of the parameters, shape (p, p): by leaving out subjects or trials where there are enough, else residuals."""
    from_residuals = _residual_covariance(fit)
    for laws, method in ((by_subject, OVER_SUBJECTS), (by_trial, OVER_TRIALS)):
        if len(laws) >= JACKKNIFE_GROUPS:
            values = np.array([law.values for law in laws])
            centred = values - values.mean(axis=0)
            found = (len(laws) - 1) / len(laws) * centred.T @ centred
            return _with_unknown(found, from_residuals, fit.law), method
    return from_residuals, "least squares, residuals correlated along depth"


def _residual_covariance(fit: LawFit) -> FloatArray:
    """From the curvature of the sum of squares; a parameter the data say nothing of is uncertain by its whole range."""
    ranges = np.array([0.0 if p.name in fit.known else p.upper - p.lower for p in fit.law.parameters])
    free = np.flatnonzero(np.concatenate([ranges > 0, np.ones(len(fit.offsets_mm), bool)]))
    weight = fit.information / max(fit.variance_N2, np.finfo(float).tiny)
    fitted = np.flatnonzero(ranges)
    weight[fitted, fitted] += ranges[fitted] ** -2
    scale = 1.0 / np.sqrt(np.diag(weight)[free])
    inverse = np.linalg.pinv(weight[np.ix_(free, free)] * np.outer(scale, scale), hermitian=True)
    covariance = np.zeros((len(ranges), len(ranges)))
    block = (inverse * np.outer(scale, scale))[: len(fitted), : len(fitted)]
    covariance[np.ix_(fitted, fitted)] = block
    return covariance


def _with_unknown(covariance: FloatArray, from_residuals: FloatArray, law: Law) -> FloatArray:
    """The covariance, but of parameters the data say nothing of as the residuals have it: they only stayed put."""
    ranges = np.array([p.upper - p.lower for p in law.parameters])
    unknown = np.sqrt(np.diag(from_residuals)) > UNKNOWN_SHARE * ranges
    kept = np.where(unknown[:, None] | unknown, 0.0, covariance)
    return np.asarray(kept + np.diag(np.where(unknown, np.diag(from_residuals), 0.0)))


def _intervals(law: Law, covariance: FloatArray, groups: int) -> dict[str, tuple[float, float]]:
    """Student's intervals at ``LEVEL``, kept inside each parameter's bounds."""
    reach = student_reach(groups - 1) * np.sqrt(np.diag(covariance))
    return {
        p.name: (max(p.value - r, p.lower), min(p.value + r, p.upper))
        for p, r in zip(law.parameters, map(float, reach), strict=True)
    }
