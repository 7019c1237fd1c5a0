"""What could have been reached: errors on recordings left out, from the noise alone up to the simulation as it is."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rig.diagnosis.bootstrap import bootstrap
from rig.diagnosis.descent import descend
from rig.diagnosis.estimates import ErrorBudget, Estimate, OwnSpread
from rig.diagnosis.fit import LM_STEPS, Fit, assemble, free_parameters
from rig.diagnosis.flexible import ROOM, Basis, Flexible
from rig.diagnosis.indentation import IndentationProblem
from rig.diagnosis.left_out import LeftOut, left_out, with_own_terms
from rig.diagnosis.noise import Array, Mask
from rig.diagnosis.observations import rounding_N
from rig.diagnosis.problem import Effect
from rig.diagnosis.repeats import compare_repeats
from rig.diagnosis.whitening import Whitener
from rig.remembered import known_of
from rig.simulation.drive import MeasuredMotion
from rig.trials.segments import Kind, rows_in, segments_of

WINDOW_S = 1.0  # a window of noise: longer ones hold drift, which the zero of a recording does not take
# About a line 12 readings give a deviation to a fifth (1 / sqrt(20)); of three windows one knock spoils no median.
FEWEST_IN_WINDOW, FEWEST_WINDOWS = 12, 3
CLEAR_SHARE = 0.05  # of the depth above contact, as much as contacts differ between recordings
SETTLED_S = 0.5  # of a hold: relaxation is no noise
# Below it there is nothing to explain: an error a tenth above what can be reached is not told from it.
WORTH_EXPLAINING = 1.10


@dataclass(frozen=True, kw_only=True)
class JudgedErrors(ErrorBudget):
    """The budget, and sample by sample the errors of the simulation as it is and with what was named."""

    base: LeftOut
    extended: LeftOut


def error_budget(before: Fit, after: Fit) -> JudgedErrors:
    """The errors of the simulation before and after what was named, and what a better one could have reached."""
    problem, blind = after.problem, after.whitener.blind
    assert isinstance(problem, IndentationProblem)
    own = with_own_terms(after, blind)
    own_before = closest_before(before, after) if after.effects else own
    extended = left_out(own)
    base = without_causes(own, own_before) if after.effects else extended
    # Contact has local minima, and a model that misses much may stand in one.
    flexible = _least([flexible_errors(start, (), True) for start in (own, *([own_before] if after.effects else []))])
    bench = tuple(effect for effect in after.effects if effect.is_of_bench)
    floor = _least([left_out(own_before), extended, flexible, *([flexible_errors(own, bench, True)] if bench else [])])
    repeats = compare_repeats(extended, problem.data.drive, contacts_mm(own))
    return JudgedErrors(
        base=base, extended=extended, base_N=base.rms, extended_N=extended.rms, flexible_N=flexible.rms,
        floor_N=floor.rms, noise_N=noise_N(own), repeatability_N=repeats.pure_error_N if repeats else None,
        shared_by_repeats=repeats.shared if repeats else None, scatter=own_spread(own),
        explained_share=explained_share(base.square_errors, extended.square_errors, floor.square_errors),
        stiffness_N_mm=stiffness_N_mm(own),
    )  # fmt: skip


def closest_before(before: Fit, after: Fit) -> Fit:
    """The simulation as it was, with own terms, from the better of its own values and those of the final model."""
    null = {par.name: par.null for effect in after.effects for par in effect.pars}
    starts = before, replace(after, effects=(), values={**after.values, **null})
    return min((with_own_terms(one, after.whitener.blind) for one in starts), key=lambda own: left_out(own).rms)


def without_causes(own: Fit, own_before: Fit) -> LeftOut:
    """Errors of the simulation as it is, where what recordings have of their own stays as the causes named leave it.

    Terms fitted again would take up what a cause does between recordings, as softening by cycles or a drift of zero do.
    """
    problem, noise = own.problem, own.whitener.noise
    held = Whitener(problem, noise, None, np.zeros_like(own.whitener.secants), own.whitener.blind)
    free = free_parameters(problem, ())
    null = {par.name: par.null for effect in own.effects for par in effect.pars}
    ends = (descend(free, start, held, 3 * LM_STEPS)[0] for start in ({**own.values, **null}, own_before.values))
    return _least([left_out(assemble(problem, (), end, held)) for end in ends])


def _least(found: Sequence[LeftOut]) -> LeftOut:
    return min(found, key=lambda errors: errors.rms)


def contacts_mm(own: Fit) -> Array:
    """Place of contact of each recording, shape (recordings,)."""
    return np.asarray(own.values["surface_mm"] + own.values["contact_offset_mm"] + own.whitener.noise.shifts[:, 1])


def own_spread(own: Fit) -> dict[str, OwnSpread]:
    """How recordings differ in what each has of its own."""
    deviations = own.whitener.noise.shifts.std(axis=0, ddof=1)
    return {s.name: OwnSpread(float(sd), s.unit) for s, sd in zip(own.problem.scatter, deviations, strict=True)}


def stiffness_N_mm(own: Fit) -> float | None:
    """How force rises with depth where the tip presses, rms over judged rows [N/mm]; None where it does not."""
    slope = own.whitener.secants[:, 1][own.whitener.judged[0]]
    return float(np.sqrt(np.mean(slope[slope != 0] ** 2))) if slope.any() else None


@known_of
def flexible_errors(own: Fit, causes: tuple[Effect, ...], remembers: bool) -> LeftOut:
    """Errors of the flexible tissue, with memory or without, and these causes beside it, each as the model has it.

    Of a model whose tip never reaches the tissue its own: there is no depth to lay another tissue over.
    """
    assert isinstance(own.problem, IndentationProblem)
    drive = own.problem.data.drive
    deepest_mm = float((drive.position_mm - contacts_mm(own)[drive.recording]).max())
    if deepest_mm <= 0:
        return left_out(own)
    columns = [cause_force(own, cause) for cause in causes]
    stacked = np.stack(columns, axis=1) if columns else np.empty((drive.size, 0))
    return Flexible(Basis(drive, ROOM * deepest_mm, remembers), own, stacked).left_out()


def cause_force(own: Fit, cause: Effect) -> Array:
    """What a cause adds to the force in a model, all else as it is there [N], shape (n,)."""
    off = {**own.values, **{par.name: par.null for par in cause.amplitudes}}
    return np.asarray(own.prediction[0] - own.whitener.predict(off)[0])


def explained_share(base: Array, extended: Array, floor: Array) -> Estimate | None:
    """(base - extended) / (base - floor) of mean square errors, each of shape (recordings,), bootstrapped over them.

    None where little could be gained.
    """
    if not base.any() or base.mean() <= WORTH_EXPLAINING**2 * floor.mean():
        return None
    return bootstrap(np.stack([base, extended, floor], axis=1), _share)


def _share(squares: Array) -> Array:
    """Share explained of what could be, or of the least that is worth it, from mean squares along the first axis."""
    base, extended, floor = squares
    return np.asarray((base - extended) / np.maximum(base - floor, base - base / WORTH_EXPLAINING**2))


def noise_N(own: Fit) -> float | None:
    """Noise of force in the air, less what named causes do there, else where the tip stands still in the tissue [N].

    No less than what steps of the converter round off, which a reading that rests on one does not show. None where the
    tip is at neither.
    """
    assert isinstance(own.problem, IndentationProblem)
    data, drive = own.problem.data, own.problem.data.drive
    contact_mm, seen = contacts_mm(own), np.ones(drive.size, bool) if data.unseen is None else ~data.unseen
    clear_mm = CLEAR_SHARE * float((drive.position_mm - contact_mm[drive.recording]).max())
    above = seen & _rows_in(drive, contact_mm - clear_mm, "air")
    found = _window_variances(drive, data.force_N - own.prediction[0], above, 1)
    if len(found) < FEWEST_WINDOWS:
        # In holds once most of the tissue's relaxation is over.
        found = _window_variances(drive, data.force_N, seen & _rows_in(drive, contact_mm, "hold", SETTLED_S), 2)
    return max(float(np.sqrt(np.median(found))), rounding_N(data.step_N)) if len(found) >= FEWEST_WINDOWS else None


def _rows_in(drive: MeasuredMotion, surfaces_mm: Array, kind: Kind, after_s: float = 0.0) -> Mask:
    parts = (slice(begin, end) for begin, end in pairwise(drive.starts))
    motions = ((drive.time_s[part], drive.position_mm[part]) for part in parts)
    found = (
        rows_in(segments_of(time_s, position_mm, surface_mm), kind, time_s, after_s)
        for (time_s, position_mm), surface_mm in zip(motions, surfaces_mm, strict=True)
    )
    return np.concatenate(list(found))


def _window_variances(drive: MeasuredMotion, force_N: Array, rows: Mask, degree: int) -> list[float]:
    """Variance of force about a polynomial in each window of rows that follow one another."""
    length = max(FEWEST_IN_WINDOW, round(WINDOW_S / drive.period_s))
    edges = np.flatnonzero((np.diff(rows.astype(np.int8), prepend=0, append=0) != 0) | np.append(drive.first, True))
    found = []
    for begin, end in pairwise(edges):
        for first in range(begin, end, length) if rows[begin] else ():
            part = force_N[first : min(first + length, end)]
            if len(part) >= FEWEST_IN_WINDOW:
                left = part - np.polynomial.Polynomial.fit(np.arange(len(part)), part, degree)(np.arange(len(part)))
                found.append(float(left @ left) / (len(part) - degree - 1))
    return found
