"""Is anything left, and what does it depend on? Asked before any cause is named and after.

Six bumps along each variable, added and times the simulated force, must predict recordings they have not seen, beyond
what the model's own parameters can imitate. The level is set by turning whole recordings round at random, with the
largest gain over all variables.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rig.diagnosis.descent import prior_precision
from rig.diagnosis.evidence import FEWEST_TO_FLIP, Tangents, chance, chance_draws, flipped_draws, held_out
from rig.diagnosis.fit import Fit, by_recording
from rig.diagnosis.noise import Array

BUMPS = 6
DRAWS = 200
LEVEL = 0.005
# Ten recordings have so few orders that no pattern, however clear, is rarer than about 0.01: orders are only the check.
BETWEEN_LEVEL = 0.003
ORDER_LEVEL = 0.05
WORTH_SHARE = 0.004
MOST_UNNAMED = 0.1
AMPLE_SHARE = 0.15
RIDGE = 0.05
BETWEEN = ("session time", "stroke number", "speed", "temperature")
FEWEST_BETWEEN = 8
BETWEEN_DRAWS = 999


@dataclass(frozen=True)
class Leftover:
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
    """Gaussian bumps between the 1st and 99th percentile, shape (n, 6); none where the variable is constant."""
    low, high = np.percentile(variable, [1, 99])
    if not high > low:
        return np.empty((len(variable), 0))
    centres = np.linspace(low, high, BUMPS)
    return np.asarray(np.exp(-0.5 * ((variable[:, None] - centres) / (centres[1] - centres[0])) ** 2))


def variables(fit: Fit) -> dict[str, Array]:
    """The problem's variables and the simulated force."""
    return {**fit.problem.variables(), "force": fit.prediction[0] - fit.values.get("zero_N", 0.0)}


def leftover(fit: Fit, rng: np.random.Generator) -> Leftover:
    """Test of the residual of ``fit`` against every variable."""
    problem, force = fit.problem, fit.prediction[0] - fit.values.get("zero_N", 0.0)
    scale = max(float(np.sqrt(np.mean(force**2))), 1e-12)
    blocks, groups, at = [fit.jacobian], dict[str, tuple[int, ...]](), fit.jacobian.shape[1]
    for name, variable in variables(fit).items():
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
    gains = _gains(t, groups, gradient[None])[0]
    null = [_gains(t, groups, chance_draws(t, rng, DRAWS)).max(axis=1)]
    if problem.recordings >= FEWEST_TO_FLIP:
        null.append(_gains(t, groups, flipped_draws(t, rng, DRAWS)).max(axis=1))
    p_value = chance((null[0], null[1] if len(null) > 1 else np.empty(0)), float(gains.max()))
    rows = float(sum(np.count_nonzero(keep) for keep in fit.whitener.judged[:1]))
    named = dict(zip(groups, map(float, gains), strict=True))
    shares = {name: 2 * gain / rows for name, gain in named.items()}
    return Leftover(named, shares, p_value, *between_recordings(fit, rng))


def judged_leftover(found: Leftover, named_nats: float) -> tuple[str, ...]:
    """Variables an unexplained leftover depends on; none where it is chance, too small to matter, or mostly named.

    A leftover is too small below 0.4 % of the noise power, or below a tenth of what the named causes explain: the
    library has then got the cause, if not its last detail. 15 % of the noise power always matters.
    """
    if found.between_p <= BETWEEN_LEVEL:
        return found.between
    best = found.ranked[0]
    named_it = found.gains[best] < MOST_UNNAMED * named_nats and found.shares[best] < AMPLE_SHARE
    matters = found.shares[best] >= WORTH_SHARE and not named_it
    if found.p_value > LEVEL or not matters:
        return ()
    return tuple(name for name in found.ranked if found.gains[name] >= 0.5 * found.gains[best])


def between_recordings(fit: Fit, rng: np.random.Generator) -> tuple[tuple[str, ...], float]:
    """What the recordings' own shifts depend on: the largest correlation with a trend or a step.

    Its chance is taken among normal shifts, and the recordings' own in other orders must bear it out. Returns the
    variables of the largest correlation and its chance.
    """
    shifts = fit.whitener.noise.shifts
    count = len(shifts)
    if count < FEWEST_BETWEEN:
        return (), 1.0
    recording = fit.problem.channels[0].recording
    means = {name: np.bincount(recording, values) / np.bincount(recording) for name, values in
             fit.problem.variables().items() if name in BETWEEN}  # fmt: skip
    patterns, owners = [], []
    for name, mean in means.items():
        if np.ptp(mean) > 0:
            for pattern in _patterns(mean):
                patterns.append(pattern)
                owners.append(name)
    if not patterns:
        return (), 1.0
    basis, scores = np.stack(patterns), _standard(shifts.T)
    strength = np.abs(basis @ scores.T)  # (patterns, quantities)
    best = float(strength.max())
    orders = np.stack([rng.permutation(count) for _ in range(BETWEEN_DRAWS)])
    shuffled = scores[:, orders]
    drawn = _standard(rng.standard_normal((len(scores), BETWEEN_DRAWS, count)))
    p_order, p_normal = (_rarity(basis, rows, best) for rows in (shuffled, drawn))
    p_value = p_normal if p_order <= ORDER_LEVEL else 1.0
    strongest = strength.max(axis=1)
    found = dict.fromkeys(owners[k] for k in np.argsort(-strongest) if strongest[k] > 0.95 * best)
    return tuple(found), float(p_value)


def _rarity(basis: Array, rows: Array, best: float) -> float:
    """Share of draws, rows (quantities, draws, recordings), with a correlation of at least ``best`` somewhere."""
    null = np.abs(np.einsum("pr,qdr->dpq", basis, rows)).max(axis=(1, 2))
    return float((1 + np.count_nonzero(null >= best)) / (1 + len(null)))


def _standard(rows: Array) -> Array:
    centred = rows - rows.mean(axis=-1, keepdims=True)
    return np.asarray(centred / np.maximum(np.linalg.norm(centred, axis=-1, keepdims=True), 1e-300))


def _patterns(mean: Array) -> Array:
    """A straight trend and every step with at least three recordings on each side, unit rows (patterns, recordings)."""
    rank = np.argsort(np.argsort(mean, kind="stable"), kind="stable")
    steps = [np.where(rank >= k, 1.0, 0.0) for k in range(3, len(mean) - 2)]
    return _standard(np.stack([mean, *steps]))


def _gains(t: Tangents, groups: Mapping[str, tuple[int, ...]], gradients: Array) -> Array:
    own = tuple(range(t.base))
    base = held_out(t, own, gradients)[0]
    return np.stack([held_out(t, own + columns, gradients)[0] - base for columns in groups.values()], axis=1)
