"""Joint fit of a simulation and any set of effects, all parameters free, with noise of its own."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rig.diagnosis.noise import (
    LARGEST_ORDER,
    Array,
    Colour,
    Mask,
    Noise,
    ScatterWhitener,
    estimate_colour,
    estimate_scatter,
    judged,
    starts_of,
)
from rig.diagnosis.problem import Effect, Fields, Par, Problem, Values

LM_STEPS = 8
NOISE_ROUNDS = 25
QUICK_ROUNDS = 5
SETTLED_NATS = 0.1
CONVERGED_NATS = 0.03
PRIOR_SCALES = 1e3
SHIFT_ROUNDS = 6
# Small: what a direction has beyond the scatter's own is judged to a thousandth of it and less.
NUDGE = 1e-4


@dataclass(frozen=True)
class Whitener:
    """What turns raw rows of all channels into unit white rows; ``blind`` rows of the first are not judged."""

    problem: Problem
    noise: Noise
    scatter: ScatterWhitener | None
    secants: Array
    blind: Mask

    def predict(self, values: Fields) -> tuple[Array, ...]:
        """Prediction with every recording's own shifts in it."""
        for k, scatter in enumerate(self.problem.scatter if self.noise.shifts.size else ()):
            values = scatter.nudge(values, self.own_shifts[k])
        return self.problem.predict(values)

    @cached_property
    def own_shifts(self) -> Array:
        """Each quantity's shift at every sample of the first channel, shape (k, n)."""
        return np.ascontiguousarray(self.noise.shifts[self.problem.channels[0].recording].T)

    def residual(self, prediction: Sequence[Array]) -> Array:
        """White rows of what is measured minus predicted, the shifts' own part given back to the scatter."""
        rows = [c.observed - p for c, p in zip(self.problem.channels, prediction, strict=True)]
        if self.noise.shifts.size:
            rows[0] = rows[0] + np.einsum("nk,kn->n", self.secants, self.own_shifts)
        return self(rows)

    def __call__(self, parts: Sequence[Array]) -> Array:
        """Channels (n_c,) or (n_c, k), stacked to (n, k) white rows."""
        white = [
            colour.whiten(rows, keep) for colour, rows, keep in zip(self.noise.colours, parts, self.judged, strict=True)
        ]
        if self.scatter is not None:
            white[0] = self.scatter(white[0])
        return np.concatenate(white)

    @cached_property
    def judged(self) -> tuple[Mask, ...]:
        """Rows of each channel that count, by the longest memory, so that all models are scored on the same rows."""
        return tuple(_judged(self.problem, k, LARGEST_ORDER, self.blind) for k in range(len(self.noise.colours)))

    @cached_property
    def log_det(self) -> Array:
        """Per recording: log of the whitening Jacobian, shape (recordings,)."""
        total = np.zeros(self.problem.recordings)
        for k, (channel, colour) in enumerate(zip(self.problem.channels, self.noise.colours, strict=True)):
            rows = self.judged[k]
            total -= np.bincount(channel.recording[rows], minlength=len(total)) * np.log(colour.sd)
        return total + (self.scatter.log_det if self.scatter is not None else 0.0)


def _judged(problem: Problem, channel: int, order: int, blind: Mask) -> Mask:
    recording = problem.channels[channel].recording
    starts = starts_of(recording, problem.recordings)
    return judged(len(recording), starts, order, blind if channel == 0 else None)


@dataclass(frozen=True)
class Fit:
    """A fitted model: effects on, values of all parameters, and the per-recording sums evidence needs.

    ``names`` are the free parameters (p,) in internal scale; ``hessian`` (recordings, p, p), ``gradient``
    (recordings, p), ``loss`` (recordings,) are sums of white rows; ``raw`` is the Jacobian of the first channel (n, p).
    """

    problem: Problem
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


def free_parameters(problem: Problem, effects: Sequence[Effect]) -> tuple[Par, ...]:
    """Base parameters and those of the effects."""
    return problem.base + tuple(par for effect in effects for par in effect.pars)


def shifted(problem: Problem, values: Fields, shifts: Array) -> Fields:
    """Values (arrays on the first channel) with each recording's shifts (recordings, k) in them."""
    if not shifts.size:
        return values
    own = shifts[problem.channels[0].recording]
    for k, scatter in enumerate(problem.scatter):
        values = scatter.nudge(values, own[:, k])
    return values


def fit(
    problem: Problem,
    effects: Sequence[Effect],
    start: Values,
    whitener: Whitener | None = None,
    rounds: int = NOISE_ROUNDS,
    floor: float = -np.inf,
) -> Fit:
    """Levenberg-Marquardt with noise and shifts re-estimated on the model's own residuals between rounds.

    A model still below the log likelihood ``floor`` after two rounds is given up where it stands.
    """
    free = free_parameters(problem, effects)
    values: Values = {**start, **{par.name: float(np.clip(start[par.name], par.low, par.high)) for par in free}}
    if whitener is None:
        flat = [Colour(np.empty(0), max(float(np.std(c.observed)) * 0.02, 1e-9)) for c in problem.channels]
        noise = Noise(tuple(flat), np.empty(0), np.empty((0, 0)))
        blind = np.zeros(len(problem.channels[0].observed), bool)
        whitener = Whitener(problem, noise, None, np.empty((0, 0)), blind)
    values = _descend(free, values, whitener, 2 * LM_STEPS)
    level, best = -np.inf, (log_level(whitener, values), values, whitener)
    for done in range(rounds):
        whitener = estimate(problem, values, whitener)
        values = _descend(free, values, whitener, LM_STEPS)
        reached = log_level(whitener, values)
        # Contact is a kink: a round may lead away. The best point seen is the fit.
        best = max(best, (reached, values, whitener), key=lambda point: point[0])
        if abs(reached - level) < SETTLED_NATS or (done >= 1 and best[0] < floor):
            break
        level = reached
    return assemble(problem, effects, best[1], best[2])


def log_level(whitener: Whitener, values: Values) -> float:
    """Log likelihood of the judged rows at ``values``, up to a constant; minus infinity where numbers ran away."""
    white = whitener.residual(whitener.predict(values))
    reached = float(whitener.log_det.sum() - 0.5 * white @ white)
    return reached if np.isfinite(reached) else -np.inf


def least_squares(model: Fit) -> Fit:
    """The same model with the parameters that bring it closest to the readings, noise white, no recording special.

    What a person would call its best fit, and what its error in newtons is told by.
    """
    problem = model.problem
    spreads = [
        max(float(np.std(c.observed - p)), 1e-9) for c, p in zip(problem.channels, model.prediction, strict=True)
    ]
    noise = Noise(tuple(Colour(np.empty(0), spread) for spread in spreads), np.empty(0), np.empty((0, 0)))
    blind = np.zeros(len(problem.channels[0].observed), bool)
    whitener = Whitener(problem, noise, None, np.empty((0, 0)), blind)
    free = free_parameters(problem, model.effects)
    guess = {**problem.start(), **{par.name: model.values[par.name] for effect in model.effects for par in effect.pars}}
    ends = [_descend(free, start, whitener, 3 * LM_STEPS) for start in (model.values, guess)]
    return assemble(problem, model.effects, max(ends, key=lambda end: log_level(whitener, end)), whitener)


def first_fit(problem: Problem) -> Fit:
    """The simulation as it is, from its first guess."""
    rough = fit(problem, (), problem.start())
    wider = [optimistic(problem, rough.values, rough.whitener, wide) for wide in (1.0, 10.0)]
    bold = [attempt(problem, (), rough.values, whitener) for whitener in wider]
    best = max((rough, *(found for found in bold if found is not None)), key=level_of)
    return fit(problem, (), best.values, best.whitener)


def attempt(
    problem: Problem, effects: Sequence[Effect], start: Values, whitener: Whitener, floor: float = -np.inf
) -> Fit | None:
    """A fit, or None where its numbers ran away: a candidate that cannot be fitted is no candidate."""
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            # A frequency must not run away while the amplitude it belongs to is still nothing.
            fixed = {par.name for par in effects[-1].shapes} if effects else set[str]()
            free = [par for par in free_parameters(problem, effects) if par.name not in fixed]
            start = _descend(free, start, whitener, LM_STEPS) if fixed else start
            found = fit(problem, effects, start, whitener, QUICK_ROUNDS, floor)
    except np.linalg.LinAlgError:
        return None
    return found if np.isfinite(level_of(found)) and np.isfinite(found.hessian).all() else None


def best_fit(problem: Problem, effects: Sequence[Effect], start: Values, whitener: Whitener) -> Fit | None:
    """The better of two fits: from the noise of the model before, and from noise too small to hide an effect in."""
    tried = [attempt(problem, effects, start, w) for w in (whitener, optimistic(problem, start, whitener))]
    return max((t for t in tried if t is not None), key=level_of, default=None)


def bold_fit(
    problem: Problem, effects: Sequence[Effect], start: Values, whitener: Whitener, floor: float = -np.inf
) -> Fit | None:
    """A fit from noise too small to hide an effect in."""
    return attempt(problem, effects, start, optimistic(problem, start, whitener), floor)


def bold_view(model: Fit) -> Fit:
    """The model refitted and judged as if all of its misfit called for an explanation: for looking, not for judging."""
    problem = model.problem
    whitener = optimistic(problem, model.values, model.whitener)
    free = free_parameters(problem, model.effects)
    return assemble(problem, model.effects, _descend(free, model.values, whitener, LM_STEPS), whitener)


def level_of(model: Fit) -> float:
    """Log likelihood of the judged rows, up to a constant."""
    return float(model.whitener.log_det.sum() - 0.5 * model.loss.sum())


def refreshed(model: Fit) -> Fit:
    """The same model with the rows it cannot judge marked anew from where it now sees the contact."""
    values = shifted(model.problem, model.values, model.whitener.noise.shifts)
    whitener = replace(model.whitener, blind=model.problem.blind(values))
    return fit(model.problem, model.effects, model.values, whitener)


def optimistic(problem: Problem, values: Values, before: Whitener, wide: float = 1.0) -> Whitener:
    """Noise as if the model were right: white, small scatter, no shifts, so that effects and not noise must explain.

    ``wide`` widens the scatter: different specimens are not one specimen touched again.
    """
    colours = (quietest(problem, values), *before.noise.colours[1:])
    steps = wide * np.array([scatter.step for scatter in problem.scatter])
    shifts = np.zeros((problem.recordings, len(steps)))
    noise = Noise(colours, steps, shifts)
    if not problem.scatter:
        return replace(before, noise=replace(noise, scatter_sd=np.empty(0), shifts=np.empty((0, 0))))
    secants = secants_of(problem, values, shifts, problem.predict(values)[0])
    starts = starts_of(problem.channels[0].recording, problem.recordings)
    scatter = ScatterWhitener.of(colours[0].whiten(secants, before.judged[0]), steps, starts)
    return Whitener(problem, noise, scatter, secants, before.blind)


def estimate(problem: Problem, values: Values, before: Whitener) -> Whitener:
    """Noise from the residuals at ``values``: each recording's shifts, their scatter, and the colour of the rest.

    The model is linearised at each recording's own shifts (first-order conditional estimation, Lindstrom and Bates
    1990), not at their mean: contact is a kink, where the two differ by more than the noise.
    """
    starts = [starts_of(c.recording, problem.recordings) for c in problem.channels]
    noise, blinds = before.noise, [before.blind, *[None] * (len(problem.channels) - 1)]
    if not problem.scatter:
        parts = zip(problem.channels, problem.predict(values), starts, blinds, strict=True)
        colours = tuple(estimate_colour(c.observed - p, s, b, c.memory) for c, p, s, b in parts)
        return replace(before, noise=Noise(colours, np.empty(0), np.empty((0, 0))))
    fresh, keep = noise.shifts.size == 0, before.judged[0]
    steps = np.array([scatter.step for scatter in problem.scatter])
    shifts = np.zeros((problem.recordings, len(steps))) if fresh else noise.shifts
    sd = steps if fresh else noise.scatter_sd
    # A first colour taken before the shifts are known would be a random walk that hides them: start white.
    colour = quietest(problem, values) if fresh else noise.colours[0]
    observed, recording = problem.channels[0].observed, problem.channels[0].recording
    for _ in range(SHIFT_ROUNDS if fresh else SHIFT_ROUNDS // 2):
        prediction = problem.predict(shifted(problem, values, shifts))
        secants = secants_of(problem, values, shifts, prediction[0])
        whole = observed - prediction[0] + np.einsum("nk,nk->n", secants, shifts[recording])
        sd, found = estimate_scatter(colour.whiten(whole, keep), colour.whiten(secants, keep), starts[0], sd)
        reach = 5 * np.minimum(np.maximum(steps, sd), 10 * steps)
        shifts = shifts + np.clip(found - shifts, -reach, reach)
        left = observed - problem.predict(shifted(problem, values, shifts))[0]
        colour = estimate_colour(left, starts[0], blinds[0], problem.channels[0].memory)
    prediction = problem.predict(shifted(problem, values, shifts))
    secants = secants_of(problem, values, shifts, prediction[0])
    others = list(zip(problem.channels, prediction, starts, strict=True))[1:]
    colours = (colour, *(estimate_colour(channel.observed - part, start) for channel, part, start in others))
    scatter = ScatterWhitener.of(colour.whiten(secants, keep), sd, starts[0])
    return Whitener(problem, Noise(colours, sd, shifts), scatter, secants, before.blind)


def quietest(problem: Problem, values: Values) -> Colour:
    """White noise as large as the residual's change from sample to sample."""
    residual = problem.channels[0].observed - problem.predict(values)[0]
    return Colour(np.empty(0), max(float(np.std(np.diff(residual))) / np.sqrt(2), 1e-9))


def secants_of(problem: Problem, values: Values, shifts: Array, prediction: Array) -> Array:
    """Change of the first channel per unit of each scattering quantity, at the given shifts, shape (n, k)."""
    columns = []
    for k, scatter in enumerate(problem.scatter):
        ahead = shifts.copy()
        ahead[:, k] += NUDGE * scatter.step
        columns.append((problem.predict(shifted(problem, values, ahead))[0] - prediction) / (NUDGE * scatter.step))
    return np.stack(columns, axis=1)


def _descend(free: Sequence[Par], values: Values, whitener: Whitener, steps: int) -> Values:
    prediction = whitener.predict(values)
    white = whitener.residual(prediction)
    cost, damping = 0.5 * float(white @ white), 1e-3
    for _ in range(steps):
        columns = whitener(jacobian(whitener, values, free, prediction))
        hessian, slope = columns.T @ columns, columns.T @ white
        for _ in range(6):
            scaled = hessian + np.diag(damping * np.diag(hessian) + prior_precision(free) + 1e-30)
            step = np.linalg.solve(scaled, slope)
            trial = values
            for par, change in zip(free, step, strict=True):
                trial = moved(par, trial, float(np.clip(change, -2, 2)) if par.log else float(change))
            new_prediction = whitener.predict(trial)
            new_white = whitener.residual(new_prediction)
            new_cost = 0.5 * float(new_white @ new_white)
            if np.isfinite(new_cost) and new_cost < cost:
                break
            damping = max(damping * 10, 1e-6)
        else:
            return values
        gain, cost = cost - new_cost, new_cost
        values, prediction, white, damping = trial, new_prediction, new_white, damping / 10
        if gain < CONVERGED_NATS:
            return values
    return values


def assemble(problem: Problem, effects: Sequence[Effect], values: Values, whitener: Whitener) -> Fit:
    """Per-recording sums at ``values``; parameters standing on a bound are held there."""
    prediction = whitener.predict(values)
    free = tuple(par for par in free_parameters(problem, effects) if not on_bound(par, values[par.name]))
    raw = jacobian(whitener, values, free, prediction)
    columns, white = whitener(raw), whitener.residual(prediction)
    hessian, gradient, loss = by_recording(problem, columns, white)
    return Fit(
        problem, tuple(effects), values, whitener, free, prediction, columns, white, raw[0], hessian, gradient, loss
    )


def on_bound(par: Par, value: float) -> bool:
    """Whether ``value`` stands on a bound, to a millionth of the range."""
    margin = 1e-6 * (par.high - par.low)
    return value <= par.low + (0 if par.log else margin) or value >= par.high - margin


def by_recording(problem: Problem, columns: Array, white: Array) -> tuple[Array, Array, Array]:
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
