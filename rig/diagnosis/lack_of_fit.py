"""Test of lack of fit: does the residual depend on anything? Before any cause is named, and after.

Six bumps along each variable, added and times the simulated force, must predict recordings they have not seen, beyond
what the model's own parameters can imitate. The level is set by turning whole recordings round at random, with the
largest gain over all variables.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np

from rig.diagnosis.descent import prior_precision
from rig.diagnosis.evidence import Tangents, chance, chance_maxima, held_out
from rig.diagnosis.fit import Fit, by_recording
from rig.diagnosis.levels import label_dependence
from rig.diagnosis.noise import Array, starts_of
from rig.diagnosis.problem import Effect, InverseProblem

BUMPS = 6
# The fewest draws that reach the level (1/201); with `search.ALPHA` it stays below the 5 % of false alarms allowed.
DRAWS = 200
LEVEL = 0.005
# Ten recordings have so few orders that no pattern, however clear, is rarer than about 0.01: orders are only the check.
BETWEEN_LEVEL = 0.003
ORDER_LEVEL = 0.05
SMALLEST_SHARE = 0.004  # of the noise power: an error of 6 % of the noise's rms
MOST_UNNAMED = 0.1  # of what was named: the cause is known, if not its last detail
AMPLE_SHARE = 0.15  # of the noise power: an error of 0.4 of the noise's rms is no detail
RIDGE = 0.05
BETWEEN = ("session time", "cycle number", "speed", "temperature")
FEWEST_BETWEEN = 8  # below it Student's t of a trend would have to pass 5 at BETWEEN_LEVEL
BETWEEN_DRAWS = 999
TREND_NATS = 3.0  # odds of 20 to 1 (e^3)
EVEN_SHARE = 0.05  # of its mean: what varies less between recordings tells no trend from a level


@dataclass(frozen=True)
class LackOfFit:
    """Held-out gain [nats] and share of the judged noise power by variable, and the chance of the largest gain."""

    gains: Mapping[str, float]
    shares: Mapping[str, float]
    p_value: float
    between: tuple[str, ...] = ()
    between_p: float = 1.0

    @property
    def ranked(self) -> list[str]:
        """Variables, the most telling first."""
        return sorted(self.gains, key=lambda name: -self.gains[name])


def bumps(variable: Array) -> Array:
    """Gaussian bumps between the outer permilles, beyond which they stay; (n, 6), none where nothing varies.

    A fast cycle is over soon: a hundredth of the samples may hold all of the highest speed.
    """
    low, high = np.percentile(variable, [0.1, 99.9])
    if not high > low:
        return np.empty((len(variable), 0))
    centres = np.linspace(low, high, BUMPS)
    inside = np.clip(variable, low, high)[:, None]
    return np.asarray(np.exp(-0.5 * ((inside - centres) / (centres[1] - centres[0])) ** 2))


def variables(fit: Fit) -> dict[str, Array]:
    """The problem's variables and the simulated force."""
    return {**fit.problem.variables(), "force": fit.prediction[0] - fit.values.get("zero_N", 0.0)}


def assess_lack_of_fit(fit: Fit, rng: np.random.Generator) -> LackOfFit:
    """Test of the residual of ``fit`` against every variable."""
    problem, along = fit.problem, variables(fit)
    force = along["force"]
    scale = max(float(np.sqrt(np.mean(force**2))), 1e-12)
    blocks, groups, at = [fit.jacobian], dict[str, tuple[int, ...]](), fit.jacobian.shape[1]
    for name, variable in along.items():
        basis = bumps(variable)
        columns = np.concatenate([basis, basis * (force / scale)[:, None]], axis=1)
        others = [np.zeros((len(c.observed), columns.shape[1])) for c in problem.channels[1:]]
        white = fit.whitener([columns, *others])
        norm = np.sqrt((white**2).sum(axis=0))
        blocks.append(white / np.maximum(norm, 1e-9))
        groups[name] = tuple(range(at, at + columns.shape[1]))
        at += columns.shape[1]
    hessian, gradient, _ = by_recording(problem, np.concatenate(blocks, axis=1), fit.white)
    ridge = np.concatenate([prior_precision(fit.free), np.full(at - len(fit.free), RIDGE)])
    t = Tangents(len(fit.free), ridge, hessian, gradient, ())
    gains = _gains(groups, t, gradient[None])[0]
    p_value = chance(chance_maxima(t, rng, partial(_gains, groups), DRAWS), float(gains.max()))
    rows = max(float(np.count_nonzero(fit.whitener.judged[0])), 1.0)
    named = dict(zip(groups, map(float, gains), strict=True))
    shares = {name: 2 * gain / rows for name, gain in named.items()}
    return LackOfFit(named, shares, p_value, *with_labels(between_recordings(fit, rng), fit))


def unexplained_variables(found: LackOfFit, named_nats: float) -> tuple[str, ...]:
    """Variables an unexplained residual depends on; none where it is chance, too small to matter, or mostly named.

    A residual is too small below 0.4 % of the noise power, or below a tenth of what the named causes explain: the
    library has then got the cause, if not its last detail. 15 % of the noise power always matters.
    """
    if found.between_p <= BETWEEN_LEVEL:
        return found.between
    best = found.ranked[0]
    named_it = found.gains[best] < MOST_UNNAMED * named_nats and found.shares[best] < AMPLE_SHARE
    matters = found.shares[best] >= SMALLEST_SHARE and not named_it
    if found.p_value > LEVEL or not matters:
        return ()
    return telling_variables(found)


def telling_variables(found: LackOfFit) -> tuple[str, ...]:
    """The variables that tell half as much as the best, or more."""
    return tuple(name for name in found.ranked if found.gains[name] >= 0.5 * found.gains[found.ranked[0]])


def between_recordings(fit: Fit, rng: np.random.Generator) -> tuple[tuple[str, ...], float]:
    """What the recordings' own shifts depend on: the largest correlation with a trend or a step.

    Its chance is taken among normal shifts, and the recordings' own in other orders must bear it out. Returns the
    variables of the largest correlation and its chance.
    """
    shifts = fit.whitener.noise.shifts
    count = len(shifts)
    if count < FEWEST_BETWEEN:
        return (), 1.0
    patterns, owners = _trends_and_steps(fit.problem)
    if not owners:
        return (), 1.0
    beside = beside_named(fit)
    basis = _unit(np.einsum("qrs,ps->qpr", beside, patterns))

    def strength(rows: Array) -> Array:
        """Correlation of rows (quantities, draws, recordings) with every pattern, (draws, patterns)."""
        own = _unit(np.einsum("qrs,qds->qdr", beside, rows))
        return np.asarray(np.abs(np.einsum("qpr,qdr->qdp", basis, own)).max(axis=0))

    observed = strength(shifts.T[:, None])[0]
    best = float(observed.max())
    orders = np.stack([rng.permutation(count) for _ in range(BETWEEN_DRAWS)])
    drawn = rng.standard_normal((shifts.shape[1], BETWEEN_DRAWS, count))
    p_order, p_normal = (
        float((1 + np.count_nonzero(strength(rows).max(axis=1) >= best)) / (1 + BETWEEN_DRAWS))
        for rows in (shifts.T[:, orders], drawn)
    )
    found = dict.fromkeys(owners[k] for k in np.argsort(-observed) if observed[k] > 0.95 * best)
    return tuple(found), p_normal if p_order <= ORDER_LEVEL else 1.0


def with_labels(found: tuple[tuple[str, ...], float], fit: Fit) -> tuple[tuple[str, ...], float]:
    """What own shifts depend on and its chance, or the label that they go with, where that is rarer by chance."""
    shifts = fit.whitener.noise.shifts
    if len(shifts) < FEWEST_BETWEEN or not fit.problem.labels:
        return found
    label, p_value = label_dependence(shifts, beside_named(fit), fit.problem.labels)
    return ((label,), p_value) if label is not None and p_value < found[1] else found


def beside_named(fit: Fit) -> Array:
    """Projectors (quantities, recordings, recordings) that take off the mean and what named causes can do to shifts.

    A step that a named trend has half explained is a step again beside it.
    """
    level = np.ones((len(fit.problem.scatter), fit.problem.recordings, 1))
    taken = [level, *(express_as_shifts(fit, effect) for effect in fit.effects if effect.between)]
    columns = np.concatenate(taken, axis=2)
    return np.eye(fit.problem.recordings) - columns @ np.linalg.pinv(columns, rcond=1e-6)


def express_as_shifts(fit: Fit, effect: Effect) -> Array:
    """What a named effect does to the recordings as if it were shifts, (quantities, recordings, parameters)."""
    names = {par.name for par in effect.pars}
    columns = [k for k, par in enumerate(fit.free) if par.name in names]
    colour, keep = fit.whitener.noise.colours[0], fit.whitener.judged[0]
    secants, moves = colour.whiten(fit.whitener.secants, keep), colour.whiten(fit.raw[:, columns], keep)
    starts = starts_of(fit.problem.channels[0].recording, fit.problem.recordings)
    return np.stack([np.linalg.lstsq(secants[i:j], moves[i:j], rcond=None)[0] for i, j in pairwise(starts)], axis=1)


def find_better_trends(effect: Effect, after: Fit, without: Fit) -> tuple[str, ...]:
    """Variables a plain step or trend over which predicts the recordings' shifts better than a named effect does.

    Judged on the model without the effect, each recording left out; what was tried is taken off the evidence.
    """
    if not effect.between or after.problem.recordings < FEWEST_BETWEEN:
        return ()
    patterns, owners = _trends_and_steps(after.problem)
    own, shifts = express_as_shifts(after, effect), without.whitener.noise.shifts.T
    size = np.abs(own[:, :, 0]).max(axis=1) / np.maximum(without.whitener.noise.scatter_sd, 1e-12)
    quantity = int(size.argmax())
    if np.ptp(own[quantity, :, 0]) < EVEN_SHARE * np.abs(own[quantity, :, 0]).max():
        return ()
    if not owners:
        return ()
    level = np.ones((after.problem.recordings, 1))
    mine = _press_log_density(np.concatenate([level, own[quantity]], axis=1), shifts[quantity])
    plain = np.array([_press_log_density(np.column_stack([level, pattern]), shifts[quantity]) for pattern in patterns])
    cost = np.log(len(np.unique(patterns.round(9), axis=0)))
    if plain.max() - mine - cost < TREND_NATS:
        return ()
    return tuple(dict.fromkeys(owner for owner, nats in zip(owners, plain, strict=True) if nats > plain.max() - 0.5))


def _press_log_density(columns: Array, shifts: Array) -> float:
    """Log density of shifts (recordings,) each left out of a least-squares fit, up to a constant (Allen's PRESS)."""
    hat = columns @ np.linalg.pinv(columns)
    errors = (shifts - hat @ shifts) / np.maximum(1 - np.diag(hat), 1e-9)
    return float(-0.5 * len(shifts) * np.log(max(float(errors @ errors), 1e-300)))


def _trends_and_steps(problem: InverseProblem) -> tuple[Array, list[str]]:
    """Patterns (patterns, recordings) of every variable that differs between recordings, and the variable of each."""
    recording, patterns, owners = problem.channels[0].recording, [np.empty((0, problem.recordings))], list[str]()
    for name, values in problem.variables().items():
        mean = np.bincount(recording, values) / np.bincount(recording)
        if name in BETWEEN and np.ptp(mean) > 0:
            patterns.append(_patterns(mean))
            owners += [name] * len(patterns[-1])
    return np.concatenate(patterns), owners


def _unit(rows: Array) -> Array:
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=-1, keepdims=True), 1e-300))


def _patterns(mean: Array) -> Array:
    """A straight trend and every step with at least three recordings on each side, rows (patterns, recordings)."""
    rank = np.argsort(np.argsort(mean, kind="stable"), kind="stable")
    steps = [np.where(rank >= k, 1.0, 0.0) for k in range(3, len(mean) - 2)]
    return np.stack([mean - mean.mean(), *steps])


def _gains(groups: Mapping[str, tuple[int, ...]], t: Tangents, gradients: Array) -> Array:
    own = tuple(range(t.base))
    base = held_out(t, own, gradients)[0]
    return np.stack([held_out(t, own + columns, gradients)[0] - base for columns in groups.values()], axis=1)
