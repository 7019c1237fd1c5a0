"""Held-out evidence: leave one recording out, in closed form, and what it costs to be fooled by chance.

Leaving recording i out moves the parameters by d_i = (H - H_i)^-1 (g - g_i), with H and g sums of white rows, so every
held-out log density is a few small matrices away from one joint fit. Exact for linear models.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rig.diagnosis.descent import prior_precision
from rig.diagnosis.fit import Fit, bounded, by_recording
from rig.diagnosis.noise import Array
from rig.diagnosis.problem import Effect, Values
from rig.diagnosis.whitening import NUDGE

DRAWS = 400  # 1/401 is a third of the least chance that a step of the search asks for, 0.03/4
FEWEST_TO_FLIP = 6  # in 31 ways: 1 in 32 is near the 3 % of the search; with five nothing would be rarer than 1 in 16
MOST_BITS = 40  # so many ways that 400 draws never meet, in a code of 64 bits
ALIAS_SHARE = 1e-6  # a complete imitation leaves 1e-11 by rounding, the next best cause 1e-2
PROBE = 0.1
PARTS = 8  # with four, one may hold all that a size is known by


def held_out_steps(hessian: Array, gradient: Array, ridge: Array) -> Array:
    """Change of the parameters when each recording is left out, shape (recordings, p)."""
    rest = hessian.sum(axis=0) - hessian + np.diag(ridge)
    return np.asarray(np.linalg.solve(rest, (gradient.sum(axis=0) - gradient)[..., None])[..., 0])


def jackknife(fit: Fit) -> Array:
    """Covariance of the parameters from what leaving out each recording does to them, shape (p, p).

    Unlike the curvature it does not believe the noise model: recordings that pull apart widen it (Miller 1974).
    """
    return _spread(held_out_steps(fit.hessian, fit.gradient, prior_precision(fit.free)))


def jackknife_along(fit: Fit, variable: Array) -> Array:
    """The same, leaving out each of ``PARTS`` equal parts of the first channel along ``variable``.

    Recordings that all lack the same cause agree with each other; the parts in which it acts do not agree with the
    others.
    """
    part = np.searchsorted(np.quantile(variable, np.linspace(0, 1, PARTS + 1)[1:-1]), variable)
    label = np.full(len(fit.white), PARTS)
    label[: len(part)] = part
    rows = [(fit.jacobian[label == k], fit.white[label == k]) for k in range(PARTS + 1)]
    hessian, gradient = (np.array(sums) for sums in zip(*((x.T @ x, x.T @ w) for x, w in rows), strict=True))
    return _spread(held_out_steps(hessian, gradient, prior_precision(fit.free))[:PARTS])


def _spread(steps: Array) -> Array:
    steps = steps - steps.mean(axis=0)
    return np.asarray((len(steps) - 1) / len(steps) * steps.T @ steps)


def held_out_log_density(fit: Fit) -> Array:
    """Log density of each recording under the fit without it, shape (recordings,), up to a common constant."""
    step = held_out_steps(fit.hessian, fit.gradient, prior_precision(fit.free))
    square = fit.loss - 2 * np.einsum("ri,ri->r", step, fit.gradient)
    square += np.einsum("ri,rij,rj->r", step, fit.hessian, step)
    return np.asarray(fit.whitener.log_det - 0.5 * square)


def held_out_square_error(fit: Fit) -> Array:
    """Mean square error of the first channel on each recording left out, shape (recordings,)."""
    step = held_out_steps(fit.hessian, fit.gradient, prior_precision(fit.free))
    recording = fit.problem.channels[0].recording
    error = fit.residual - np.einsum("np,np->n", fit.raw, step[recording])
    counts = np.bincount(recording, minlength=fit.problem.recordings)
    return np.bincount(recording, error**2, minlength=fit.problem.recordings) / np.maximum(counts, 1)


@dataclass(frozen=True)
class Direction:
    """One effect at one shape, as the white columns its amplitudes add to the present model."""

    effect: Effect
    shape: Values
    columns: tuple[int, ...]


@dataclass(frozen=True)
class Tangents:
    """The present model's columns (first) and those of all candidate directions, summed by recording."""

    base: int
    ridge: Array
    hessian: Array
    gradient: Array
    directions: tuple[Direction, ...]


def tangents(fit: Fit, effects: Sequence[Effect]) -> Tangents:
    """White columns of every effect that is off, at every shape it may take, beside those of the fit."""
    problem, stacked, directions = fit.problem, list[Array](), list[Direction]()
    for effect in effects:
        for shape in effect.shape_starts(problem, fit.values, problem.channels[0].observed - fit.prediction[0]):
            first = fit.jacobian.shape[1] + len(stacked)
            for amplitude in effect.amplitudes:
                stacked.append(white_direction(fit, effect, amplitude.name, shape))
            count = len(effect.amplitudes)
            directions.append(Direction(effect, shape, tuple(range(first, first + count))))
    columns = np.concatenate([fit.jacobian, np.stack(stacked, axis=1)], axis=1) if stacked else fit.jacobian
    hessian, gradient, _ = by_recording(problem, columns, fit.white)
    amplitudes = [par for d in directions for par in d.effect.amplitudes]
    ridge = np.concatenate([prior_precision(fit.free), [1 / (1e3 * par.scale) ** 2 for par in amplitudes]])
    return Tangents(len(fit.free), ridge, hessian, gradient, tuple(directions))


def white_direction(fit: Fit, effect: Effect, amplitude: str, shape: Values) -> Array:
    """White change of all channels per unit of ``amplitude`` at ``shape``, shape (n,)."""
    par = next(p for p in effect.amplitudes if p.name == amplitude)
    values = {**fit.values, **{p.name: p.null for p in effect.amplitudes}, **shape}
    step = (NUDGE if effect.between else PROBE) * par.scale
    ahead = fit.whitener.predict({**values, amplitude: par.null + step})
    white = fit.whitener([(a - b) / step for a, b in zip(ahead, fit.prediction, strict=True)])
    return bounded(white[:, None])[:, 0]


def linear_gains(t: Tangents, gradients: Array) -> Array:
    """Held-out gain of each direction for given gradients (draws, recordings, P); shape (draws, directions).

    A one-sided effect whose amplitude comes out below its null has no gain; what a scan had to try is taken off.
    """
    base = held_out(t, tuple(range(t.base)), gradients)[0]
    gains = np.empty((len(gradients), len(t.directions)))
    for k, direction in enumerate(t.directions):
        index = tuple(range(t.base)) + direction.columns
        score, amplitude = held_out(t, index, gradients)
        gains[:, k] = score - base
        if direction.effect.one_sided:
            gains[amplitude[:, -1] <= 0, k] = -np.inf
    return gains


def held_out(t: Tangents, index: tuple[int, ...], gradients: Array) -> tuple[Array, Array]:
    """Total held-out score (draws,) and full-data solution (draws, q) of the model with columns ``index``."""
    block = t.hessian[:, index][:, :, index]
    total = block.sum(axis=0) + np.diag(t.ridge[list(index)])
    rest = np.linalg.pinv(total - block, hermitian=True)
    g = gradients[:, :, list(index)]
    everything = g.sum(axis=1)
    step = np.einsum("rij,brj->bri", rest, everything[:, None] - g)
    score = np.einsum("bri,bri->b", step, g) - 0.5 * np.einsum("bri,rij,brj->b", step, block, step, optimize=True)
    return score, everything @ np.linalg.pinv(total, hermitian=True)


def amplitudes_of(t: Tangents, direction: Direction) -> Array:
    """Linear estimate of the direction's amplitudes from the data, shape (k,)."""
    index = list(range(t.base)) + list(direction.columns)
    total = t.hessian.sum(axis=0)[np.ix_(index, index)] + np.diag(t.ridge[index])
    return np.asarray((np.linalg.pinv(total, hermitian=True) @ t.gradient.sum(axis=0)[index])[t.base :])


def information(t: Tangents, direction: Direction) -> tuple[Array, Array]:
    """Information on the amplitudes alone, and after everything in the model is refitted, each (k, k)."""
    total = t.hessian.sum(axis=0)
    own = total[np.ix_(direction.columns, direction.columns)]
    across = total[np.ix_(range(t.base), direction.columns)]
    model = total[: t.base, : t.base] + np.diag(t.ridge[: t.base])
    return own, own - across.T @ np.linalg.solve(model, across)


def is_alias(t: Tangents, direction: Direction) -> bool:
    """Whether the model's own parameters imitate the direction completely."""
    own, left = information(t, direction)
    return bool(np.trace(left) <= ALIAS_SHARE * np.trace(own))


def chance_draws(t: Tangents, rng: np.random.Generator, draws: int) -> Array:
    """Gradients under the present model: Gaussian with covariance H_i, shape (draws, recordings, P)."""
    normal = rng.standard_normal((draws, *t.hessian.shape[:2]))
    return np.asarray(np.einsum("rij,brj->bri", covariance_root(t.hessian), normal))


def covariance_root(covariance: Array) -> Array:
    """Roots R of covariances (n, p, p) with R R' = covariance: unit by unit the symmetric root of the correlation.

    That one is unique and continuous; eigenvectors have signs, and turn round with the last digits.
    """
    size = np.sqrt(np.maximum(np.einsum("rii->ri", covariance), 1e-300))
    weights, vectors = np.linalg.eigh(covariance / (size[:, :, None] * size[:, None, :]))
    symmetric = np.einsum("rik,rk,rjk->rij", vectors, np.sqrt(np.maximum(weights, 0.0)), vectors)
    return np.asarray(size[:, :, None] * symmetric)


def flipped_draws(t: Tangents, rng: np.random.Generator, draws: int) -> Array:
    """The data's own gradients with whole recordings turned round, shape (draws, recordings, P).

    No draw turns all or none of them: that is what was observed, and is counted once already.
    """
    return np.asarray(_signs(len(t.hessian), rng, draws)[..., None] * t.gradient)


def _signs(recordings: int, rng: np.random.Generator, draws: int) -> Array:
    """Different ways to turn recordings round, the last one never: all there are, or ``draws`` of them."""
    free = min(recordings - 1, MOST_BITS)
    ways = 2**free - 1
    codes = 1 + (np.arange(ways) if ways <= draws else rng.choice(ways, draws, replace=False))
    turned = (codes[:, None] >> np.arange(free)) & 1
    return np.concatenate([1.0 - 2.0 * turned, np.ones((len(codes), recordings - free))], axis=1)


def chance_maxima(
    t: Tangents, rng: np.random.Generator, gains: Callable[[Tangents, Array], Array] = linear_gains, draws: int = DRAWS
) -> tuple[Array, Array]:
    """Largest of ``gains`` when nothing is hidden: parametric and sign-flip draws, each (draws,)."""
    parametric = gains(t, chance_draws(t, rng, draws)).max(axis=1)
    if len(t.hessian) < FEWEST_TO_FLIP:
        return parametric, np.empty(0)
    return parametric, gains(t, flipped_draws(t, rng, draws)).max(axis=1)


def chance(maxima: tuple[Array, Array], gain: float) -> float:
    """Probability of at least ``gain`` by chance: the larger of the two nulls, never 0.

    Few recordings can be turned in few ways; where none of them reaches ``gain`` the drawn null alone speaks.
    """
    drawn, turned = (np.count_nonzero(m >= gain) for m in maxima)
    rarity = (1 + drawn) / (1 + len(maxima[0]))
    return float(max(rarity, (1 + turned) / (1 + len(maxima[1])) if turned else 0.0))
