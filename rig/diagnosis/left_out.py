"""Error on recordings left out, each with its own contact, zero and stiffness: what of a model is shared is judged.

Shared parameters come from the other recordings; the recording's own three are fitted to it again, alike for all
models. Otherwise a model that is right of the tissue would be as wrong as specimens and wells differ.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from rig.diagnosis.descent import descend, prior_precision
from rig.diagnosis.evidence import held_out_steps
from rig.diagnosis.fit import LM_STEPS, Fit, assemble, free_parameters
from rig.diagnosis.noise import LARGEST_ORDER, Array, Colour, Index, Mask, Noise, ScatterWhitener, judged, starts_of
from rig.diagnosis.problem import InverseProblem, Values
from rig.diagnosis.whitening import Whitener, secants_of, shifted
from rig.remembered import known_of

# Wells of one plate differ by some tenths in stiffness, and touches of one tissue by some hundredths of the depth.
STIFFNESS_SD = 0.3
CONTACT_SHARE = 0.05
LARGEST_STEP = np.array([1.0, 3.0, np.inf])  # standard deviations that own terms move in one round: contact is a kink
ROUNDS = 3  # the third moves contact by less than a micrometre on sessions of the mock bench


@dataclass(frozen=True)
class LeftOut:
    """Measured minus predicted on each recording left out [N], shape (n,); only ``judged`` rows count."""

    residual: Array
    judged: Mask
    recording: Index

    @cached_property
    def seen(self) -> Mask:
        """Recordings of which any row is judged, shape (recordings,)."""
        return np.bincount(self.recording[self.judged], minlength=self.recordings) > 0

    @cached_property
    def square_errors(self) -> Array:
        """Mean square of each recording of which any row is judged, shape (judged recordings,)."""
        rows = self.judged
        sums = np.bincount(self.recording[rows], self.residual[rows] ** 2, self.recordings)
        return sums[self.seen] / np.bincount(self.recording[rows], minlength=self.recordings)[self.seen]

    @property
    def recordings(self) -> int:
        """How many were left out in turn."""
        return int(self.recording[-1]) + 1

    @property
    def rms(self) -> float:
        """Root of the mean over recordings; 0 where no row is judged."""
        return float(np.sqrt(self.square_errors.mean())) if self.seen.any() else 0.0


def own_deviations(problem: InverseProblem, values: Values) -> Array:
    """Prior standard deviations of a recording's own log stiffness, contact and zero; the zero is all but free."""
    deepest = problem.variables()["depth"].max() - values["surface_mm"]
    range_N = float(np.ptp(problem.channels[0].observed))
    return np.array([STIFFNESS_SD, CONTACT_SHARE * max(float(deepest), 1e-3), 10 * range_N])


@known_of
def with_own_terms(model: Fit, blind: Mask) -> Fit:
    """The model closest to the readings when every recording has its own stiffness, contact and zero; noise white."""
    problem, free = model.problem, free_parameters(model.problem, model.effects)
    values, slopes, deviations = model.values, None, own_deviations(problem, model.values)
    whitener = own_whitener(problem, model.whitener, values, model.whitener.noise.shifts, deviations, blind)
    best = values, whitener
    for _ in range(ROUNDS):
        values, slopes = descend(free, values, whitener, LM_STEPS, slopes, confirm=False)
        shifts = _moved(whitener, values, deviations)
        whitener = own_whitener(problem, whitener, values, shifts, deviations, blind)
        # Contact is a kink: a round may lead away.
        best = min(best, (values, whitener), key=lambda point: point[1].noise.colours[0].sd)
    return assemble(problem, model.effects, *best)


def own_whitener(
    problem: InverseProblem, before: Whitener, values: Values, shifts: Array, deviations: Array, blind: Mask
) -> Whitener:
    """White noise as large as the error is, with ``deviations`` between recordings, linear about their own shifts."""
    starts = starts_of(problem.channels[0].recording, problem.recordings)
    keep = judged(len(blind), starts, LARGEST_ORDER, blind)
    prediction = problem.predict(shifted(problem, values, shifts))[0]
    error = (problem.channels[0].observed - prediction)[keep]
    colour = Colour(np.empty(0), max(float(np.sqrt(np.mean(error**2))), 1e-9))
    secants = secants_of(problem, values, shifts, prediction)
    scatter = ScatterWhitener.of(colour.whiten(secants, keep), deviations, starts)
    noise = Noise((colour, *before.noise.colours[1:]), deviations, shifts)
    return Whitener(problem, noise, scatter, secants, blind)


def _moved(whitener: Whitener, values: Values, deviations: Array) -> Array:
    """Each recording's own shifts, fitted again at ``values`` to its rows, shape (recordings, 3)."""
    channel, shifts, sd = whitener.problem.channels[0], whitener.noise.shifts, whitener.noise.colours[0].sd
    whole = channel.observed - whitener.predict(values)[0] + (whitener.secants * shifts[channel.recording]).sum(axis=1)
    found = own_steps(whitener.secants, whole, channel.recording, whitener.judged[0], sd / deviations)
    reach = LARGEST_STEP * deviations
    return np.asarray(shifts + np.clip(found - shifts, -reach, reach))


def left_out(own: Fit) -> LeftOut:
    """Errors of a model with own terms on recordings left out, the first channel's."""
    recording = own.problem.channels[0].recording
    step, keep = held_out_steps(own.hessian, own.gradient, prior_precision(own.free)), own.whitener.judged[0]
    error = own.problem.channels[0].observed - own.prediction[0] - np.einsum("np,np->n", own.raw, step[recording])
    noise = own.whitener.noise
    steps = own_steps(own.whitener.secants, error, recording, keep, noise.colours[0].sd / noise.scatter_sd)
    return LeftOut(error - np.einsum("nk,nk->n", own.whitener.secants, steps[recording]), keep, recording)


def own_steps(columns: Array, error: Array, recording: Index, keep: Mask, tightness: Array) -> Array:
    """What own terms with ``columns`` (n, k) take off ``error`` (n,) in each recording, shape (recordings, k).

    ``tightness`` is the noise over the terms' prior standard deviations, shape (k,).
    """
    found = []
    for begin, end in pairwise(starts_of(recording, int(recording[-1]) + 1)):
        rows, left = columns[begin:end][keep[begin:end]], error[begin:end][keep[begin:end]]
        found.append(np.linalg.solve(rows.T @ rows + np.diag(tightness**2), rows.T @ left))
    return np.stack(found)
