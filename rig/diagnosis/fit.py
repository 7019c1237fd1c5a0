"""Joint fit of a simulation and any set of effects, all parameters free, with noise of its own."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rig.diagnosis.descent import descend, jacobian, on_bound, prior_precision
from rig.diagnosis.noise import Array, Colour, Mask, Noise, starts_of
from rig.diagnosis.problem import Effect, InverseProblem, Par, Values
from rig.diagnosis.whitening import Whitener, estimate, optimistic, shifted
from rig.remembered import known_of

LM_STEPS = 8
NOISE_ROUNDS = 25
QUICK_ROUNDS = 5
SETTLED_NATS = 0.1  # a thirtieth of the 3 nats that keep a cause
FALLS_APART_NATS = 0.1  # a row: noise 10 % larger, which a few rows judged anew do not make
FEWEST_ROWS = 30  # to judge a model by: they tell its noise to an eighth (1 / sqrt(60))
MOST_OF_ONE_ROW = 0.05  # a fair share is 1 in 15,000; what is known of a parameter then rests on twenty rows or more
BOUND_PASSES = 12


@dataclass(frozen=True)
class Fit:
    """A fitted model: effects on, values of all parameters, and the per-recording sums evidence needs.

    ``names`` are the free parameters (p,) in internal scale; ``hessian`` (recordings, p, p), ``gradient``
    (recordings, p), ``loss`` (recordings,) are sums of white rows; ``raw`` is the Jacobian of the first channel (n, p).
    """

    problem: InverseProblem
    effects: tuple[Effect, ...]
    values: Values
    whitener: Whitener
    free: tuple[Par, ...]
    prediction: tuple[Array, ...]
    jacobian: Array
    white: Array
    raw: Array
    hessian: Array
    gradient: Array
    loss: Array

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects switched on."""
        return tuple(effect.name for effect in self.effects)

    @cached_property
    def residual(self) -> Array:
        """Measured minus simulated on the first channel, no recording treated as special, shape (n,)."""
        return self.problem.channels[0].observed - self.problem.predict(self.values)[0]

    @cached_property
    def covariance(self) -> Array:
        """Of the free parameters in internal scale, shape (p, p)."""
        return np.asarray(np.linalg.inv(self.hessian.sum(axis=0) + np.diag(prior_precision(self.free))))


def held_values(problem: InverseProblem, effects: Sequence[Effect]) -> dict[str, float]:
    """Base parameters that stay at their null beside these effects."""
    return {par.name: par.null for par in problem.base if any(par.name in effect.holds for effect in effects)}


def free_parameters(problem: InverseProblem, effects: Sequence[Effect]) -> tuple[Par, ...]:
    """Base parameters, but those that an effect holds, and those of the effects."""
    held = held_values(problem, effects)
    base = tuple(par for par in problem.base if par.name not in held)
    return base + tuple(par for effect in effects for par in effect.pars)


def fit(
    problem: InverseProblem,
    effects: Sequence[Effect],
    start: Values,
    whitener: Whitener | None = None,
    rounds: int = NOISE_ROUNDS,
    enough: float = -np.inf,
) -> Fit:
    """Levenberg-Marquardt with noise and shifts re-estimated on the model's own residuals between rounds.

    One whose log likelihood is below ``enough`` after the second round stays as it is then.
    """
    free = free_parameters(problem, effects)
    values: Values = {**start, **{par.name: float(np.clip(start[par.name], par.low, par.high)) for par in free}}
    whitener = whitener or flat_noise(problem, [0.02 * float(np.std(c.observed)) for c in problem.channels])
    values, slopes = descend(free, values, whitener, 2 * LM_STEPS, confirm=False)
    level, best = -np.inf, (log_level(whitener, values), values, whitener)
    for number in range(rounds):
        whitener = estimate(problem, values, whitener)
        values, slopes = descend(free, values, whitener, LM_STEPS, slopes, confirm=False)
        reached = log_level(whitener, values)
        # Contact is a kink: a round may lead away. The best point seen is the fit.
        best = max(best, (reached, values, whitener), key=lambda point: point[0])
        if abs(reached - level) < SETTLED_NATS or (number > 0 and reached < enough):
            break
        level = reached
    _, values, whitener = best
    return assemble(problem, effects, descend(free, values, whitener, LM_STEPS)[0], whitener)


def flat_noise(problem: InverseProblem, spreads: Iterable[float]) -> Whitener:
    """White noise of a standard deviation for each channel, no recording special, no row left out."""
    noise = Noise(tuple(Colour(np.empty(0), max(sd, 1e-9)) for sd in spreads), np.empty(0), np.empty((0, 0)))
    return Whitener(problem, noise, None, np.empty((0, 0)), np.zeros(len(problem.channels[0].observed), bool))


def log_level(whitener: Whitener, values: Values) -> float:
    """Log likelihood of the judged rows at ``values``, up to a constant; minus infinity where numbers ran away."""
    white = whitener.residual(whitener.predict(values))
    reached = float(whitener.log_det.sum() - 0.5 * white @ white)
    return reached if np.isfinite(reached) else -np.inf


@known_of
def least_squares(model: Fit) -> Fit:
    """The same model with the parameters that bring it closest to the readings, noise white, no recording special.

    What a person would call its best fit, and what its error in newtons is told by.
    """
    problem = model.problem
    errors = (c.observed - p for c, p in zip(problem.channels, model.prediction, strict=True))
    whitener = flat_noise(problem, (float(np.std(error)) for error in errors))
    free = free_parameters(problem, model.effects)
    own = {par.name: model.values[par.name] for effect in model.effects for par in effect.pars}
    guess = {**problem.start(), **own, **held_values(problem, model.effects)}
    ends = [descend(free, start, whitener, 3 * LM_STEPS)[0] for start in (model.values, guess)]
    return assemble(problem, model.effects, max(ends, key=lambda end: log_level(whitener, end)), whitener)


def first_fit(problem: InverseProblem) -> Fit:
    """The simulation as it is, from its first guess."""
    rough = fit(problem, (), problem.start())
    wider = [optimistic(problem, rough.values, rough.whitener, wide) for wide in (1.0, 10.0)]
    quiet = [attempt(problem, (), rough.values, whitener) for whitener in wider]
    best = max((rough, *(found for found in quiet if found is not None)), key=level_of)
    return fit(problem, (), best.values, best.whitener)


def attempt(
    problem: InverseProblem, effects: Sequence[Effect], start: Values, whitener: Whitener, enough: float = -np.inf
) -> Fit | None:
    """A fit, or None where its numbers ran away: a candidate that cannot be fitted is no candidate."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            start = _anchored(problem, effects, start, whitener)
            found = fit(problem, effects, start, whitener, QUICK_ROUNDS, enough)
    except np.linalg.LinAlgError:
        return None
    return found if np.isfinite(level_of(found)) and np.isfinite(found.hessian).all() else None


def trial_fit(
    problem: InverseProblem, effects: Sequence[Effect], start: Values, whitener: Whitener
) -> tuple[Values, float] | None:
    """Where a fit under this very noise ends, and how well it explains the readings there; None as for ``attempt``."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            start = _anchored(problem, effects, start, whitener)
            values, _ = descend(free_parameters(problem, effects), start, whitener, LM_STEPS, confirm=False)
            reached = log_level(whitener, values)
    except np.linalg.LinAlgError:
        return None
    return (values, reached) if np.isfinite(reached) else None


def _anchored(problem: InverseProblem, effects: Sequence[Effect], start: Values, whitener: Whitener) -> Values:
    """Amplitudes fitted at the shapes given: a frequency must not run away while its amplitude is still nothing."""
    fixed = {par.name for par in effects[-1].shapes} if effects else set[str]()
    free = [par for par in free_parameters(problem, effects) if par.name not in fixed]
    return descend(free, start, whitener, LM_STEPS, confirm=False)[0] if fixed else start


def best_fit(problem: InverseProblem, effects: Sequence[Effect], start: Values, whitener: Whitener) -> Fit | None:
    """The better of two fits: from the noise of the model before, and from noise too small to hide an effect in."""
    tried = [attempt(problem, effects, start, w) for w in (whitener, optimistic(problem, start, whitener))]
    return max((t for t in tried if t is not None), key=level_of, default=None)


def low_noise_refit(
    problem: InverseProblem, effects: Sequence[Effect], start: Values, before: Whitener, enough: float = -np.inf
) -> Fit | None:
    """A fit from noise too small to hide an effect in."""
    return attempt(problem, effects, start, optimistic(problem, start, before), enough)


def low_noise_view(model: Fit) -> Fit:
    """The model refitted and judged as if all of its misfit called for an explanation: for looking, not for judging."""
    problem = model.problem
    whitener = optimistic(problem, model.values, model.whitener)
    free = free_parameters(problem, model.effects)
    return assemble(problem, model.effects, descend(free, model.values, whitener, LM_STEPS)[0], whitener)


def level_of(model: Fit) -> float:
    """Log likelihood of the judged rows, up to a constant."""
    return float(model.whitener.log_det.sum() - 0.5 * model.loss.sum())


def refreshed(model: Fit) -> Fit:
    """The same model with the rows it cannot judge marked anew from where it now sees the contact.

    Once only: a model that is wrong about something else walks away from the rows taken from it. One that falls apart
    on the new rows stays as it was, but for what nobody saw.
    """
    values = shifted(model.problem, model.values, model.whitener.noise.shifts)
    fresh = _judged_without(model, model.problem.blind(values))
    if _level_of_a_row(fresh) > _level_of_a_row(model) - FALLS_APART_NATS:
        return fresh
    # Nothing is about a contact that lies nowhere.
    unseen = model.problem.blind({**values, "surface_mm": np.inf})
    return _judged_without(model, unseen) if (unseen & ~model.whitener.blind).any() else model


def _judged_without(model: Fit, blind: Mask) -> Fit:
    return fit(model.problem, model.effects, model.values, replace(model.whitener, blind=blind))


def _level_of_a_row(model: Fit) -> float:
    rows = [np.count_nonzero(keep) for keep in model.whitener.judged]
    return level_of(model) / sum(rows) if rows[0] >= FEWEST_ROWS else -np.inf


def assemble(problem: InverseProblem, effects: Sequence[Effect], values: Values, whitener: Whitener) -> Fit:
    """Per-recording sums at ``values``; parameters standing on a bound are held there."""
    prediction = whitener.predict(values)
    free = tuple(par for par in free_parameters(problem, effects) if not on_bound(par, values[par.name]))
    raw = jacobian(whitener, values, free, prediction)
    columns, white = bounded(whitener(raw)), whitener.residual(prediction)
    hessian, gradient, loss = by_recording(problem, columns, white)
    return Fit(
        problem, tuple(effects), values, whitener, free, prediction, columns, white, raw[0], hessian, gradient, loss
    )


def bounded(columns: Array) -> Array:
    """White columns (n, p) in which no row holds more than a twentieth of what all of them know of a direction.

    Contact and release are kinks: a fit that is wrong about something else comes to rest with a kink on a sample, whose
    derivative would then outweigh the whole recording (bounded influence, Mallows 1975).
    """
    for _ in range(BOUND_PASSES):
        leverage = ((columns @ np.linalg.pinv(columns.T @ columns, hermitian=True)) * columns).sum(axis=1)
        if leverage.max(initial=0.0) <= 1.5 * MOST_OF_ONE_ROW:
            break
        columns = columns * np.sqrt(np.minimum(1.0, MOST_OF_ONE_ROW / np.maximum(leverage, 1e-300)))[:, None]
    return columns


def by_recording(problem: InverseProblem, columns: Array, white: Array) -> tuple[Array, Array, Array]:
    """Sums over the rows of each recording: X'X (r, p, p), X'w (r, p), w'w (r,)."""
    count, width = problem.recordings, columns.shape[1]
    hessian, gradient, loss = np.zeros((count, width, width)), np.zeros((count, width)), np.zeros(count)
    offset = 0
    for channel in problem.channels:
        starts = starts_of(channel.recording, count) + offset
        for i in range(count):
            rows, w = columns[starts[i] : starts[i + 1]], white[starts[i] : starts[i + 1]]
            hessian[i] += rows.T @ rows
            gradient[i] += rows.T @ w
            loss[i] += w @ w
        offset += len(channel.observed)
    return hessian, gradient, loss
