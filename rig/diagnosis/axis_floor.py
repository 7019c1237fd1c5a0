"""How well any smooth law could predict an axis: a flexible alternative that knows no cause.

Effort = inertia x acceleration + a smooth function of velocity for each direction + a smooth function of position,
fitted by penalised least squares; each block is predicted from the others (downdates of one Gram matrix).
"""

from typing import NamedTuple

import numpy as np

from rig.diagnosis.axis import AxisProblem
from rig.diagnosis.descent import prior_precision
from rig.diagnosis.estimates import Estimate
from rig.diagnosis.evidence import held_out_steps
from rig.diagnosis.fit import Fit, least_squares
from rig.diagnosis.floor import explained_share
from rig.diagnosis.noise import Array, Index

SPEED_KNOTS = 8  # for each direction: a Stribeck curve of a twentieth of the speed takes three
PLACE_KNOTS = 12
RIDGE = 1e-3  # of the rows: a bump no row lies under stays 0


class AxisErrors(NamedTuple):
    """Mean square errors of blocks left out, each of shape (blocks,): as it was, with what was named, a smooth law."""

    base: Array
    extended: Array
    smooth: Array


def flexible_error(problem: AxisProblem) -> Array:
    """Mean square error on each block left out, shape (blocks,), over the rows that are judged."""
    m, judged = problem.motion, ~problem.blind({})
    speed = np.abs(m.velocity)
    fast = hats(np.sqrt(np.minimum(speed, 1.0)), SPEED_KNOTS)
    forward = m.velocity > 0
    columns = np.concatenate([
        m.acceleration[:, None], fast * forward[:, None], fast * ~forward[:, None],
        hats(m.position - m.position.min(), PLACE_KNOTS)[:, 1:],
    ], axis=1)[judged]  # fmt: skip
    effort, block = m.effort[judged], m.block[judged]
    gram, cross = (_by_block(rows, block, problem.recordings) for rows in _products(columns, effort))
    ridge = RIDGE * len(effort) / columns.shape[1] * np.eye(columns.shape[1])
    rest = gram.sum(axis=0) - gram + ridge
    own = np.linalg.solve(rest, (cross.sum(axis=0) - cross)[..., None])[..., 0]
    return block_means((effort - np.einsum("np,np->n", columns, own[block])) ** 2, block, problem.recordings)


def _products(columns: Array, effort: Array) -> tuple[Array, Array]:
    return columns[:, :, None] * columns[:, None, :], columns * effort[:, None]


def _by_block(rows: Array, block: Index, blocks: int) -> Array:
    found = np.zeros((blocks, *rows.shape[1:]))
    np.add.at(found, block, rows)
    return found


def hats(along: Array, count: int) -> Array:
    """Linear B-splines of ``along`` (n,) on ``count`` even knots from 0 to its largest, shape (n, count)."""
    place = np.clip(along / max(float(along.max()), 1e-300), 0, 1) * (count - 1)
    return np.asarray(np.maximum(1 - np.abs(place[:, None] - np.arange(count)), 0.0))


def held_out_error(model: Fit) -> Array:
    """The same of a model at its least-squares best, over the same rows."""
    best = least_squares(model)
    problem = best.problem
    assert isinstance(problem, AxisProblem)
    step = held_out_steps(best.hessian, best.gradient, prior_precision(best.free))
    block, judged = problem.motion.block, ~problem.blind({})
    error = best.residual - np.einsum("np,np->n", best.raw, step[block])
    return block_means(error[judged] ** 2, block[judged], problem.recordings)


def left_out_errors(before: Fit, after: Fit) -> AxisErrors:
    """Of both models and of any smooth law, over the same rows."""
    problem = after.problem
    assert isinstance(problem, AxisProblem)
    return AxisErrors(held_out_error(before), held_out_error(after), flexible_error(problem))


def share_of(errors: AxisErrors) -> Estimate | None:
    """How much of what could be taken off the error the second model takes; None where that is little."""
    floor = min(errors, key=lambda squares: float(squares.mean()))
    return explained_share(errors.base, errors.extended, floor)


def block_means(values: Array, block: Index, blocks: int) -> Array:
    """Mean of ``values`` in each block, 0 where it has none."""
    return np.bincount(block, values, minlength=blocks) / np.maximum(np.bincount(block, minlength=blocks), 1)
