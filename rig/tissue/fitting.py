"""Fits a law to loading curves: parameters common to all trials, and each trial's own offset of contact.

Contact is known to a few hundredths of a millimetre at best and shifts the whole curve, so every trial carries an
offset, bounded by the interval of its contact. Curves are averaged over equal steps of depth first: each trial then
weighs the same, whatever its speed.

Where the law leaves residuals that hang together along depth (a stiffer trial, a wrong law), a trial's points say less
about its contact than their number suggests. A first fit measures that; the second holds each offset to the contact
found, in proportion: a penalty (offset / deviation of contact)^2 against residuals over their variance, widened by
(1 + r)/(1 - r) with r their correlation from step to step.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from rig.errors import DataError, UsageError
from rig.tissue.arrow import LeastSquares, Slopes, Values, minimise, normal_equations
from rig.tissue.history import History
from rig.tissue.laws import FloatArray, Law
from rig.trials.curves import Curve

BINS = 100  # steps of depth in a curve: 0.08 mm of 8 mm, wider than contact is known and narrower than any law bends
EARLY_SHARE = 0.25  # of the largest force: enough points for an offset, too few to tell how the curve goes on
EVALUATIONS = 300
LEAST_DEPTH_MM = 0.1  # contact is known to a few hundredths: from here on force over depth means something
BOUND_REACH = 1e-8  # the search holds a pushed parameter on its bound; this only forgives rounding
MOST_ALIKE = 0.99  # of neighbours: keeps (1 + r)/(1 - r) finite where residuals are one smooth curve


@dataclass(frozen=True)
class LawFit:
    """A law and the offset of contact found for each curve, with the residuals in force [N] of all fitted points.

    ``information`` is J'J over parameters, then offsets; ``curve_of`` says of each residual which curve it is of;
    ``holds_N2_mm2`` is the weight that held each offset to the contact found; ``known`` are the parameters not fitted.
    """

    law: Law
    offsets_mm: FloatArray
    residual_N: FloatArray
    curve_of: NDArray[np.intp]
    information: FloatArray
    holds_N2_mm2: FloatArray
    known: Mapping[str, float]

    @property
    def rmse_N(self) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residual_N**2)))

    @property
    def variance_N2(self) -> float:
        """Variance of a residual, as if residuals were independent but as informative as they are."""
        freedom = max(len(self.residual_N) - len(self.information), 1)
        same = np.diff(self.curve_of) == 0
        before, after = self.residual_N[:-1][same], self.residual_N[1:][same]
        alike = float(before @ after / max(float(before @ before), np.finfo(float).tiny))
        alike = float(np.clip(alike, 0.0, MOST_ALIKE))
        return float(np.sum(self.residual_N**2)) / freedom * (1 + alike) / (1 - alike)

    @property
    def at_bounds(self) -> tuple[str, ...]:
        """Parameters that the fit pushed against a bound: their intervals say nothing."""
        fitted = (p for p in self.law.parameters if p.name not in self.known)
        return tuple(p.name for p in fitted if min(p.value - p.lower, p.upper - p.value) < BOUND_REACH)


class Steps:
    """Averages columns of samples over equal steps of depth, curve by curve; steps without samples are left out.

    Model and measurement go through the same average, so a jump within a step biases nothing.
    """

    def __init__(self, curves: Sequence[Curve]) -> None:
        """``curve_of`` says of each step left, shape (m,), which curve it is of."""
        steps = np.concatenate([index * BINS + _step_of(curve.depth_mm) for index, curve in enumerate(curves)])
        used, self._step = np.unique(steps, return_inverse=True)
        self._count = np.bincount(self._step)
        self.curve_of: NDArray[np.intp] = used // BINS

    def mean(self, column: FloatArray) -> FloatArray:
        """The mean of each step, shape (m,)."""
        return np.asarray(np.bincount(self._step, column) / self._count)


def _step_of(depth_mm: FloatArray) -> NDArray[np.intp]:
    edges = np.linspace(depth_mm.min(), depth_mm.max(), BINS + 1)
    return np.clip(np.searchsorted(edges, depth_mm, side="right") - 1, 0, BINS - 1)


def fit_law(
    kind: type[Law], curves: Sequence[Curve], start: LawFit | None = None, known: Mapping[str, float] | None = None
) -> LawFit:
    """The law of least squares in force over all curves; ``start`` is a fit to the same curves to begin from.

    ``known`` gives parameters of the law that are not fitted, besides those the law knows itself. Raises DataError
    where there are no curves, too few points for the parameters, or no convergence.
    """
    data = _Data(kind, curves, start.known if start else {**kind.known, **(known or {})})
    size = len(kind.bounds) - len(data.known)
    if data.points_inside < size + len(curves):
        raise DataError(
            f"{data.points_inside} points in {len(curves)} trials are too few for the {size} parameters of the "
            f"{kind.name} law and each trial's contact; record more samples a trial, or more trials"
        )
    if start:
        return _solve(data, Values(start.law.values, start.offsets_mm), start.holds_N2_mm2)
    loose = np.zeros(len(curves))
    first = _solve(data, Values(kind.guess(*data.clearly_inside()).values, loose), loose)
    deviations_mm = np.array([curve.contact.likely_mm for curve in curves])
    return _solve(data, Values(first.law.values, first.offsets_mm), first.variance_N2 / deviations_mm**2)


def _solve(data: "_Data", start: Values, holds_N2_mm2: FloatArray) -> LawFit:
    """The fit with offsets held by these weights."""
    problem = LeastSquares(data.residuals, data.slopes, data.steps.curve_of, data.lower, data.upper, holds_N2_mm2)
    found = minimise(problem, start, EVALUATIONS)
    if found is None:
        raise DataError(
            f"the fit of the {data.kind.name} law did not settle in {EVALUATIONS} evaluations; look at the curves"
        )
    return LawFit(
        law=data.kind.from_values(found.common),
        offsets_mm=found.own,
        residual_N=data.residuals(found),
        curve_of=data.steps.curve_of,
        information=normal_equations(problem, data.slopes(found)).dense(),
        holds_N2_mm2=holds_N2_mm2,
        known=data.known,
    )


class _Data:
    """All curves end to end, and a law's residuals on them as functions of its parameters and the offsets."""

    def __init__(self, kind: type[Law], curves: Sequence[Curve], known: Mapping[str, float]) -> None:
        if not curves:
            raise DataError(f"no curves to fit the {kind.name} law to")
        self.kind, self.known = kind, known
        self._history = History.at(*(curve.time_s for curve in curves))
        self.steps = Steps(curves)
        self._depth_mm = np.concatenate([curve.depth_mm for curve in curves])
        self._force_N = np.concatenate([curve.force_N for curve in curves])
        self._rate_mm_s = np.concatenate([curve.rate_mm_s for curve in curves])
        self._curve_of = np.repeat(np.arange(len(curves)), [len(curve.depth_mm) for curve in curves])
        ranges, offsets = _ranges(kind, known), [curve.offset_bounds_mm for curve in curves]
        self.lower = Values(np.array([lower for lower, _ in ranges]), np.array([lower for lower, _ in offsets]))
        self.upper = Values(np.array([upper for _, upper in ranges]), np.array([upper for _, upper in offsets]))

    @property
    def points_inside(self) -> int:
        """Points beyond contact."""
        return int(np.count_nonzero(self.steps.mean(self._depth_mm) > 0))

    def clearly_inside(self) -> tuple[FloatArray, FloatArray]:
        """Depths and forces clearly beyond contact, for the law's own guess."""
        depth_mm, force_N = self.steps.mean(self._depth_mm), self.steps.mean(self._force_N)
        inside = (depth_mm > LEAST_DEPTH_MM) & (force_N > 0)
        if np.count_nonzero(inside) < len(self.kind.bounds):
            raise DataError(f"{np.count_nonzero(inside)} points deeper than {LEAST_DEPTH_MM:g} mm; go deeper")
        return depth_mm[inside], force_N[inside]

    def _forces(self, values: Values) -> FloatArray:
        return self.kind.from_values(values.common).force(self._depths(values), self._rate_mm_s, self._history)

    def _depths(self, values: Values) -> FloatArray:
        return np.asarray(self._depth_mm - values.own[self._curve_of])

    def residuals(self, values: Values) -> FloatArray:
        """Modelled minus measured force, shape (m,)."""
        return self.steps.mean(self._forces(values) - self._force_N)

    def slopes(self, values: Values) -> Slopes:
        """Forward differences over the parameters, which stay inside their bounds; exact over the offsets."""
        force_N, columns = self._forces(values), []
        for column, (value, upper) in enumerate(zip(values.common, self.upper.common, strict=True)):
            step = 1e-7 * max(abs(value), 1e-3)
            step = step if value + step <= upper else -step
            shifted = values.common.copy()
            shifted[column] += 0.0 if list(self.kind.bounds)[column] in self.known else step
            columns.append(self.steps.mean((self._forces(Values(shifted, values.own)) - force_N) / step))
        law = self.kind.from_values(values.common)
        stiffness_N_mm = law.path_stiffness(self._depths(values), self._rate_mm_s, self._history)
        return Slopes(np.column_stack(columns), self.steps.mean(-stiffness_N_mm))


def _ranges(kind: type[Law], known: Mapping[str, float]) -> list[tuple[float, float]]:
    """Lowest and highest value of each parameter; a known one has one value. Raises UsageError for unknown names."""
    strange = [name for name in known if name not in kind.bounds]
    if strange:
        raise UsageError(f"the {kind.name} law has no parameter {strange[0]}; it has {', '.join(kind.bounds)}")
    return [(known.get(name, b.lower), known.get(name, b.upper)) for name, b in kind.bounds.items()]


def early_offset(law: Law, curve: Curve) -> float:
    """Offset of contact [mm] for a curve the law was not fitted to, from its first quarter of force alone.

    So a left-out trial tells where it begins, as contact does on the bench, and nothing of how it goes on.
    """
    steps = Steps([curve])
    history = History.at(curve.time_s)
    early = steps.mean(curve.force_N) <= EARLY_SHARE * curve.max_force_N

    def misfit(offset_mm: float) -> float:
        modelled_N = law.force(curve.depth_mm - offset_mm, curve.rate_mm_s, history)
        return float(np.sum(steps.mean(modelled_N - curve.force_N)[early] ** 2))

    return float(minimize_scalar(misfit, bounds=curve.offset_bounds_mm, method="bounded").x)


def residual_force(law: Law, curve: Curve, offset_mm: float) -> tuple[FloatArray, FloatArray]:
    """Depth from contact [mm] and modelled minus measured force [N], both averaged over steps beyond contact."""
    steps, depth_mm = Steps([curve]), curve.depth_mm - offset_mm
    modelled_N = law.force(depth_mm, curve.rate_mm_s, History.at(curve.time_s))
    depths, residuals = steps.mean(depth_mm), steps.mean(modelled_N - curve.force_N)
    return depths[depths > 0], residuals[depths > 0]
