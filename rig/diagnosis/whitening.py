"""What turns residuals into unit white rows, and how it is estimated from a model's own residuals."""

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
from rig.diagnosis.problem import InverseProblem, Values
from rig.tissue.index_law import Fields

SHIFT_ROUNDS = 6
# Small: what a direction has beyond the scatter's own is judged to a thousandth of it and less.
NUDGE = 1e-4


@dataclass(frozen=True)
class Whitener:
    """What turns raw rows of all channels into unit white rows; ``blind`` rows of the first are not judged."""

    problem: InverseProblem
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

    @cached_property
    def of_shifts(self) -> Array:
        """What the shifts add to the first channel, linear about them, shape (n,)."""
        return np.asarray(np.einsum("nk,kn->n", self.secants, self.own_shifts))

    def residual(self, prediction: Sequence[Array]) -> Array:
        """White rows of what is measured minus predicted, the shifts' own part given back to the scatter."""
        rows = [c.observed - p for c, p in zip(self.problem.channels, prediction, strict=True)]
        if self.noise.shifts.size:
            rows[0] += self.of_shifts
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
        count = self.problem.recordings
        parts = [(one.recording, None if k else self.blind) for k, one in enumerate(self.problem.channels)]
        return tuple(judged(len(rows), starts_of(rows, count), LARGEST_ORDER, blind) for rows, blind in parts)

    @cached_property
    def log_det(self) -> Array:
        """Per recording: log of the whitening Jacobian, shape (recordings,)."""
        total = np.zeros(self.problem.recordings)
        for k, (channel, colour) in enumerate(zip(self.problem.channels, self.noise.colours, strict=True)):
            rows = self.judged[k]
            total -= np.bincount(channel.recording[rows], minlength=len(total)) * np.log(colour.sd)
        return total + (self.scatter.log_det if self.scatter is not None else 0.0)


def shifted(problem: InverseProblem, values: Fields, shifts: Array) -> Fields:
    """Values (arrays on the first channel) with each recording's shifts (recordings, k) in them."""
    if not shifts.size:
        return values
    own = shifts[problem.channels[0].recording]
    for k, scatter in enumerate(problem.scatter):
        values = scatter.nudge(values, own[:, k])
    return values


def quietest(problem: InverseProblem, values: Values) -> Colour:
    """White noise as large as the residual's change from sample to sample."""
    residual = problem.channels[0].observed - problem.predict(values)[0]
    return Colour(np.empty(0), max(float(np.std(np.diff(residual))) / np.sqrt(2), 1e-9))


def secants_of(problem: InverseProblem, values: Values, shifts: Array, prediction: Array) -> Array:
    """Change of the first channel per unit of each scattering quantity, at the given shifts, shape (n, k)."""
    columns = []
    for k, scatter in enumerate(problem.scatter):
        ahead = shifts.copy()
        ahead[:, k] += NUDGE * scatter.step
        columns.append((problem.predict(shifted(problem, values, ahead))[0] - prediction) / (NUDGE * scatter.step))
    return np.stack(columns, axis=1)


def optimistic(problem: InverseProblem, values: Values, before: Whitener, wide: float = 1.0) -> Whitener:
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


def estimate(problem: InverseProblem, values: Values, before: Whitener) -> Whitener:
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
    prediction = problem.predict(shifted(problem, values, shifts))
    for _ in range(SHIFT_ROUNDS if fresh else SHIFT_ROUNDS // 3):
        secants = secants_of(problem, values, shifts, prediction[0])
        whole = observed - prediction[0] + np.einsum("nk,nk->n", secants, shifts[recording])
        sd, found = estimate_scatter(colour.whiten(whole, keep), colour.whiten(secants, keep), starts[0], sd)
        reach = 5 * np.minimum(np.maximum(steps, sd), 10 * steps)
        shifts = shifts + np.clip(found - shifts, -reach, reach)
        prediction = problem.predict(shifted(problem, values, shifts))
        colour = estimate_colour(observed - prediction[0], starts[0], blinds[0], problem.channels[0].memory)
    secants = secants_of(problem, values, shifts, prediction[0])
    others = list(zip(problem.channels, prediction, starts, strict=True))[1:]
    colours = (colour, *(estimate_colour(channel.observed - part, start) for channel, part, start in others))
    scatter = ScatterWhitener.of(colour.whiten(secants, keep), sd, starts[0])
    return Whitener(problem, Noise(colours, sd, shifts), scatter, secants, before.blind)
