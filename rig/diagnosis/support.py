"""What supports a name: evidence with its standard error, and less error on recordings left out. Both are needed.

A cause of the bench is judged with the tissue flexible: what any tissue could have done is no sign of it. One of the
tissue is judged by the simulation with and without it, recordings with terms of their own; one that differs between
recordings without these, and one that only a tracker sees by the tracker.
"""

from typing import NamedTuple

import numpy as np

from rig.diagnosis.descent import prior_precision
from rig.diagnosis.evidence import held_out_log_density, held_out_square_error, held_out_steps
from rig.diagnosis.fit import Fit, least_squares
from rig.diagnosis.floor import flexible_errors
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.left_out import LeftOut, left_out, with_own_terms
from rig.diagnosis.noise import Array, estimate_colour, starts_of
from rig.diagnosis.problem import Effect
from rig.tissue.intervals import student_reach

LEAST_NATS = 6.0  # odds of 400 to 1
LEAST_LOG_ERROR = 0.02  # of mean square: an error of 1 % less is what anybody would act on
STANDARD_ERRORS, ENOUGH_RECORDINGS = 2.0, 10  # below ten Student's t takes the place of 2


class Support(NamedTuple):
    """By recording: log density gained [nats], and by how much the log of the mean square error falls."""

    nats: Array
    log_error: Array

    @property
    def standard_error_nats(self) -> float:
        """Of the sum over recordings (Vehtari, Gelman, Gabry 2017)."""
        return float(np.sqrt(len(self.nats)) * self.nats.std(ddof=1))

    @property
    def holds(self) -> bool:
        """Whether both are larger than chance makes them, and large enough to matter."""
        count = len(self.nats)
        reach = STANDARD_ERRORS if count >= ENOUGH_RECORDINGS else student_reach(count - 1)
        uncertain = reach * float(self.log_error.std(ddof=1) / np.sqrt(count))
        likely = float(self.nats.sum()) > max(LEAST_NATS, reach * self.standard_error_nats)
        return likely and float(self.log_error.mean()) > max(LEAST_LOG_ERROR, uncertain)


def support_of(model: Fit, effect: Effect, without: Fit) -> Support:
    """What an effect of ``model`` gains over the best fit without it."""
    if isinstance(model.problem, IndentationProblem) and not (effect.between or "tracker" in effect.needs):
        return by_errors(model, *(errors_beside(model, effect) if effect.is_of_bench else errors_of(model, without)))
    nats = held_out_log_density(model) - held_out_log_density(without)
    # What is the mean of the recordings' own differences acts in each of them.
    ratio = pooled_log_ratio if effect.between and not effect.mean_of else _log_ratio
    return Support(nats, ratio(_squares(without, effect), _squares(model, effect)))


def errors_of(model: Fit, without: Fit) -> tuple[LeftOut, LeftOut]:
    """Errors of two simulations, the second first."""
    old, new = (left_out(with_own_terms(one, model.whitener.blind)) for one in (without, model))
    return old, new


def errors_beside(model: Fit, effect: Effect) -> tuple[LeftOut, LeftOut]:
    """Errors of a tissue of any elastic law beside causes of ``model``, first without the effect.

    It has any memory too, beside causes of the bench; none of its own where the effect is one of memory or rate.
    """
    own, remembers = with_own_terms(model, model.whitener.blind), not effect.is_of_rate
    beside = tuple(one for one in model.effects if one.is_of_bench or (one.is_of_rate and not remembers))
    rest = tuple(one for one in beside if one is not effect)
    return flexible_errors(own, rest, remembers), flexible_errors(own, beside, remembers)


def stands_on_any_law(model: Fit, effect: Effect) -> bool:
    """Whether a memory or a law of rate in ``model`` is supported whatever the elastic law; others were judged so."""
    return not effect.is_of_rate or by_errors(model, *errors_beside(model, effect)).holds


def by_errors(model: Fit, old: LeftOut, new: LeftOut) -> Support:
    """What errors on the rows of ``model`` gain over others."""
    nats = _log_density(model, new) - _log_density(model, old)
    return Support(nats[new.seen], _log_ratio(old.square_errors, new.square_errors))


def _log_density(model: Fit, errors: LeftOut) -> Array:
    """Log density of errors by recording, under coloured noise of their own, shape (recordings,)."""
    channel, rows = model.problem.channels[0], errors.judged
    starts = starts_of(channel.recording, model.problem.recordings)
    colour = estimate_colour(errors.residual, starts, model.whitener.blind, channel.memory)
    white = colour.whiten(errors.residual, rows)
    per_row = np.where(rows, -0.5 * white**2 - np.log(colour.sd), 0.0)
    return np.asarray(np.bincount(channel.recording, per_row, model.problem.recordings), float)


def _log_ratio(old: Array, new: Array) -> Array:
    return np.asarray(np.log(np.maximum(old, 1e-300) / np.maximum(new, 1e-300)))


def pooled_log_ratio(old: Array, new: Array) -> Array:
    """Log ratio of the mean squares of all recordings, as the jackknife's pseudo-values (Tukey 1958), (recordings,).

    What acts between recordings, as the first cycles do, may lie in two of twelve: most have nothing to gain.
    """
    count, floor = len(old), 1e-300
    rest = _log_ratio(np.maximum(old.sum() - old, floor), new.sum() - new)
    return np.asarray(count * _log_ratio(old.sum(), new.sum()) - (count - 1) * rest)


def _squares(model: Fit, effect: Effect) -> Array:
    """Mean square errors of recordings left out, where the effect shows, shape (recordings,)."""
    if "tracker" in effect.needs:
        return _tracker_squares(model)
    return held_out_square_error(least_squares(model))


def _tracker_squares(model: Fit) -> Array:
    """Mean square errors of the tracker on recordings left out, in units of its noise, shape (recordings,)."""
    recording, first = model.problem.channels[1].recording, len(model.problem.channels[0].observed)
    step = held_out_steps(model.hessian, model.gradient, prior_precision(model.free))[recording]
    white = model.white[first:] - np.einsum("np,np->n", model.jacobian[first:], step)
    count = np.bincount(recording, minlength=model.problem.recordings)
    return model.whitener.noise.colours[1].sd ** 2 * np.bincount(recording, white**2, len(count)) / np.maximum(count, 1)
