"""Levenberg-Marquardt on white rows, with a Jacobian that is corrected along the way and seldom computed anew."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.diagnosis.noise import Array
from rig.diagnosis.problem import Par, Values
from rig.diagnosis.whitening import NUDGE, Whitener

CONVERGED_NATS = 0.03  # a hundredth of the 3 nats that keep a cause
PRIOR_SCALES = 1e3
TRUSTED_SHARE = 0.3  # near the quarter below which trust-region methods doubt their model (Nocedal and Wright 2006)


def prior_precision(free: Sequence[Par]) -> Array:
    """A very weak pull that keeps a parameter the data do not see finite, shape (p,)."""
    return np.array([(1.0 if par.log else 1 / par.scale**2) / PRIOR_SCALES**2 for par in free])


def to_internal(par: Par, value: float) -> float:
    """Logarithm for scale parameters, the value itself otherwise."""
    return float(np.log(max(value, 1e-12))) if par.log else value


def from_internal(par: Par, inner: float) -> float:
    """Inverse of ``to_internal``, inside the bounds."""
    return float(np.clip(np.exp(min(inner, 50.0)) if par.log else inner, par.low, par.high))


def moved(par: Par, values: Values, change: float) -> Values:
    """``values`` with one parameter moved by ``change`` in internal scale."""
    return {**values, par.name: from_internal(par, to_internal(par, values[par.name]) + change)}


def on_bound(par: Par, value: float) -> bool:
    """Whether ``value`` stands on a bound, to a millionth of the range."""
    margin = 1e-6 * (par.high - par.low)
    return value <= par.low + (0 if par.log else margin) or value >= par.high - margin


def jacobian(whitener: Whitener, values: Values, free: Sequence[Par], prediction: Sequence[Array]) -> list[Array]:
    """Finite-difference change of each channel per internal unit, one (n_c, p) array per channel."""
    columns: list[list[Array]] = [[] for _ in prediction]
    for par in free:
        step = NUDGE * (1.0 if par.log else par.scale)
        ahead = moved(par, values, step)
        taken = to_internal(par, ahead[par.name]) - to_internal(par, values[par.name])
        if abs(taken) < 0.5 * step:
            ahead = moved(par, values, -step)
            taken = to_internal(par, ahead[par.name]) - to_internal(par, values[par.name])
        for stack, after, before in zip(columns, whitener.predict(ahead), prediction, strict=True):
            stack.append((after - before) / taken)
    return [np.stack(stack, axis=1) for stack in columns]


def corrected(slopes: Sequence[Array], change: Sequence[Array], step: Array, free: Sequence[Par]) -> list[Array]:
    """``slopes`` that agree with the prediction's ``change`` along ``step`` (Broyden 1965, in units of the scales)."""
    scales = np.array([1.0 if par.log else par.scale for par in free])
    along = step / scales**2
    along = along / max(float(along @ step), 1e-300)
    return [slope + np.outer(seen - slope @ step, along) for slope, seen in zip(slopes, change, strict=True)]


class Iterate(NamedTuple):
    """Where a descent is: what the values predict, its white residual, half the residual's sum of squares."""

    values: Values
    prediction: Sequence[Array]
    white: Array
    cost: float


def point_at(whitener: Whitener, values: Values) -> Iterate:
    """The point of ``values``."""
    prediction = whitener.predict(values)
    white = whitener.residual(prediction)
    return Iterate(values, prediction, white, 0.5 * float(white @ white))


def descend(
    free: Sequence[Par],
    values: Values,
    whitener: Whitener,
    steps: int,
    slopes: Sequence[Array] | None = None,
    confirm: bool = True,
) -> tuple[Values, Sequence[Array]]:
    """Values of least cost within ``steps``, and the Jacobian as known there.

    ``slopes`` from nearby saves computing them. They are corrected after every step, and computed anew where a step
    does much worse than they foretold. With ``confirm`` the end is reached with a Jacobian of its own.
    """
    here, damping, fresh = point_at(whitener, values), 1e-3, slopes is None
    slopes = jacobian(whitener, values, free, here.prediction) if slopes is None else slopes
    for _ in range(steps):
        columns = whitener(slopes)
        hessian, slope = columns.T @ columns, columns.T @ here.white
        below, damping = downhill(here, free, whitener, hessian, slope, damping, tries=6 if fresh else 2)
        if below is None and fresh:
            return here.values, slopes
        if below is None:
            fresh, slopes, damping = True, jacobian(whitener, here.values, free, here.prediction), 1e-3
            continue
        taken = np.array([to_internal(p, below.values[p.name]) - to_internal(p, here.values[p.name]) for p in free])
        foretold = float(slope @ taken - 0.5 * taken @ hessian @ taken)
        gain, damping = here.cost - below.cost, damping / 10
        change = [after - before for after, before in zip(below.prediction, here.prediction, strict=True)]
        here = below
        if gain < CONVERGED_NATS and (fresh or not confirm):
            return here.values, slopes
        if gain < max(CONVERGED_NATS, TRUSTED_SHARE * foretold):
            fresh, slopes = True, jacobian(whitener, here.values, free, here.prediction)
        else:
            fresh, slopes = False, corrected(slopes, change, taken, free)
    return here.values, slopes


def downhill(
    here: Iterate, free: Sequence[Par], whitener: Whitener, hessian: Array, slope: Array, damping: float, tries: int
) -> tuple[Iterate | None, float]:
    """The first of ``tries`` ever more damped steps that leads down, or None; and the damping reached."""
    for _ in range(tries):
        scaled = hessian + np.diag(damping * np.diag(hessian) + prior_precision(free) + 1e-30)
        trial = point_at(whitener, stepped(free, here.values, np.asarray(np.linalg.solve(scaled, slope), float)))
        if np.isfinite(trial.cost) and trial.cost < here.cost:
            return trial, damping
        damping = max(damping * 10, 1e-6)
    return None, damping


def stepped(free: Sequence[Par], values: Values, step: Array) -> Values:
    """``values`` moved by ``step`` in internal scale, no scale parameter by more than exp(2)."""
    for par, change in zip(free, step, strict=True):
        values = moved(par, values, float(np.clip(change, -2, 2)) if par.log else float(change))
    return values
