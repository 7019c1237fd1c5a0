"""Least squares for many curves at once: some parameters common to all, one of its own for each.

The normal equations are an arrow: a small corner for the common parameters, a diagonal for the own ones, and a border
between them. Eliminating the diagonal leaves a system as small as the law, so a step costs no more than evaluating
residuals, and no threaded linear algebra runs beside a real-time loop. Steps are damped as Marquardt's (1963) and turn
with curved valleys (geodesic acceleration: Transtrum and Sethna, "Improvements to the Levenberg-Marquardt algorithm",
2012). Parameters stay inside their bounds: one that is pushed against a bound is held there for the step.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.tissue.laws import FloatArray

TOLERANCE = 1e-12  # of the cost: less than a sum of 1e4 squares in double precision can resolve
# A search this long that gained less than a thousandth in its second half lies on the floor of a flat valley.
VALLEY, LONG_SEARCH = 1e-3, 100
LARGEST_TURN = 0.75  # Transtrum and Sethna (2012): beyond it the turn is no small correction of the step
PROBE = 0.1  # of the step, likewise theirs
FIRST_DAMPING = 1e-3  # Marquardt's
LARGEST_DAMPING = 1e10  # shortens a step until nothing in double precision moves
EDGE_DAMPING = 1e3  # at a smooth minimum far longer steps than these no longer go up
BESIDE = 0.05  # of the range of an own parameter: past the edge, and near enough to find its valley again


class Values(NamedTuple):
    """Common parameters, shape (p,), and own parameters, shape (n,)."""

    common: FloatArray
    own: FloatArray


class Slopes(NamedTuple):
    """Derivatives of the residuals: by common parameter, shape (m, p), and by their curve's own one, shape (m,)."""

    common: FloatArray
    own: FloatArray


class Arrow(NamedTuple):
    """J'J in blocks: corner (p, p), border (p, n), diagonal (n,)."""

    corner: FloatArray
    border: FloatArray
    diagonal: FloatArray

    def dense(self) -> FloatArray:
        """The whole matrix, common parameters first."""
        return np.block([[self.corner, self.border], [self.border.T, np.diag(self.diagonal)]])


class LeastSquares(NamedTuple):
    """``residuals`` gives shape (m,); ``curve_of``, shape (m,), says of each which curve it is of.

    ``holds``, shape (n,), are weights that pull the own parameters to zero: each adds hold * own^2 to the sum.
    """

    residuals: Callable[[Values], FloatArray]
    slopes: Callable[[Values], Slopes]
    curve_of: NDArray[np.intp]
    lower: Values
    upper: Values
    holds: FloatArray


def minimise(problem: LeastSquares, start: Values, evaluations: int) -> Values | None:
    """The values of least squares near ``start``; None where they are not reached in so many evaluations.

    In a valley, where the data cannot tell parameters apart, the sum hardly falls in the end: that is reached too.
    Where damping lets the force of a moving tip jump at contact, a search can end at the edge of the jump, on which an
    own parameter puts a sample: it begins once more on either side, and the lowest end counts.
    """
    found, at_edge = _descend(problem, start, evaluations)
    if found is None or not at_edge:
        return found
    shift = BESIDE * (problem.upper.own - problem.lower.own)
    both = (_descend(problem, found._replace(own=found.own + way * shift), evaluations)[0] for way in (-1, 1))
    ends = [found, *(end for end in both if end is not None)]
    return min(ends, key=lambda end: _cost(problem, end, problem.residuals(end)))


def _descend(problem: LeastSquares, start: Values, evaluations: int) -> tuple[Values | None, bool]:
    """Where the search ends, and whether at an edge: only the shortest of steps did not go up."""
    values = _clipped(problem, start)
    residuals, damping = problem.residuals(values), FIRST_DAMPING
    cost = _cost(problem, values, residuals)
    slopes = problem.slopes(values)
    halfway = cost
    for evaluation in range(evaluations):
        halfway = cost if evaluation == evaluations // 2 else halfway
        trial = _step(problem, values, residuals, slopes, damping)
        trial_residuals = problem.residuals(trial)
        trial_cost = _cost(problem, trial, trial_residuals)
        if trial_cost < cost:
            gained, cost = cost - trial_cost, trial_cost
            values, residuals, slopes = trial, trial_residuals, problem.slopes(trial)
            damping = max(damping / 10, TOLERANCE)
            if gained <= TOLERANCE * cost:
                return values, damping > EDGE_DAMPING
        else:
            damping *= 4
            if damping > LARGEST_DAMPING or trial_cost <= cost * (1 + TOLERANCE):
                return values, damping > EDGE_DAMPING
    return (values if evaluations >= LONG_SEARCH and halfway - cost <= VALLEY * cost else None), False


def normal_equations(problem: LeastSquares, slopes: Slopes) -> Arrow:
    """J'J with the holds, in blocks."""
    count = len(problem.holds)
    border = [np.bincount(problem.curve_of, column * slopes.own, count) for column in slopes.common.T]
    diagonal = np.bincount(problem.curve_of, slopes.own**2, count) + problem.holds
    return Arrow(np.einsum("ij,ik->jk", slopes.common, slopes.common), np.array(border), diagonal)


def _step(problem: LeastSquares, values: Values, residuals: FloatArray, slopes: Slopes, damping: float) -> Values:
    count = len(problem.holds)
    downhill = Values(
        -np.einsum("ij,i->j", slopes.common, residuals),
        -np.bincount(problem.curve_of, slopes.own * residuals, count) - problem.holds * values.own,
    )
    arrow = normal_equations(problem, slopes)
    free = [_free(v, d, low, up) for v, d, low, up in zip(values, downhill, problem.lower, problem.upper, strict=True)]
    step = _solve(arrow, downhill, free, damping)
    bend = _bend(problem, values, residuals, slopes, step)
    turn = _solve(arrow, bend, free, damping)
    if _length(turn, arrow) > LARGEST_TURN * _length(step, arrow):
        turn = Values(np.zeros_like(step.common), np.zeros_like(step.own))
    return _clipped(problem, Values(*(v + s + t / 2 for v, s, t in zip(values, step, turn, strict=True))))


def _bend(problem: LeastSquares, values: Values, residuals: FloatArray, slopes: Slopes, step: Values) -> Values:
    """-J' r'' with r'' the second derivative of the residuals along the step.

    It turns the step along a curved valley, which a straight one leaves at once.
    """
    ahead = _clipped(problem, Values(*(v + PROBE * s for v, s in zip(values, step, strict=True))))
    moved = Values(*((a - v) / PROBE for a, v in zip(ahead, values, strict=True)))
    straight = slopes.common @ moved.common + slopes.own * moved.own[problem.curve_of]
    second = 2 / PROBE * ((problem.residuals(ahead) - residuals) / PROBE - straight)
    return Values(
        -np.einsum("ij,i->j", slopes.common, second),
        np.asarray(-np.bincount(problem.curve_of, slopes.own * second, len(problem.holds)), float),
    )


def _length(step: Values, arrow: Arrow) -> float:
    """Of a step, each parameter in units of its own effect."""
    return float(np.sqrt(np.diag(arrow.corner) @ step.common**2 + arrow.diagonal @ step.own**2))


def _solve(arrow: Arrow, downhill: Values, free: list[NDArray[np.bool_]], damping: float) -> Values:
    """The damped step over the free parameters, zero for the held ones."""
    common, own = free
    diagonal = np.where(own, arrow.diagonal * (1 + damping), np.inf)
    diagonal = np.where(diagonal > 0, diagonal, np.inf)
    scale = np.diag(arrow.corner)
    corner = arrow.corner + np.diag(damping * np.where(scale > 0, scale, 1.0))
    reduced = corner - np.einsum("jn,kn->jk", arrow.border / diagonal, arrow.border)
    wanted = downhill.common - np.einsum("jn,n->j", arrow.border / diagonal, downhill.own)
    step = np.zeros(len(common))
    if common.any():
        step[common] = np.linalg.lstsq(reduced[np.ix_(common, common)], wanted[common], rcond=None)[0]
    return Values(step, (downhill.own - np.einsum("jn,j->n", arrow.border, step)) / diagonal)


def _free(values: FloatArray, downhill: FloatArray, lower: FloatArray, upper: FloatArray) -> NDArray[np.bool_]:
    return np.asarray(~(((values <= lower) & (downhill < 0)) | ((values >= upper) & (downhill > 0))))


def _clipped(problem: LeastSquares, values: Values) -> Values:
    return Values(*(np.clip(v, low, up) for v, low, up in zip(values, problem.lower, problem.upper, strict=True)))


def _cost(problem: LeastSquares, values: Values, residuals: FloatArray) -> float:
    return float(np.sum(residuals**2) + np.sum(problem.holds * values.own**2))
