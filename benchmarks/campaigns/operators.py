"""What a cause would have done to a measured session, computed from its own signals and no simulation.

Causes of force and time act on these. Where the tip would have been elsewhere, force is what was measured at that
place on the same way, in or out.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from benchmarks.forms.bench import cogging
from rig.trials.trial import Trial, TrialSet, drop_unusable

Array = NDArray[np.float64]
PLACES, EACH = 80, 2  # of a curve, 0.1 mm of a stroke of 8, or as many as have two samples each
SMOOTH = 7  # places: half a millimetre, far below what a curve of tissue bends in
LEAST_WAY_MM = 1e-6  # per sample, or per second: rounding of a position at rest
MOVING = 0.2  # of a stroke's usual speed: holds tell nothing of a curve, they relax
PITCH_MM, MOTION_HZ, CYCLES, LENGTH_MM, EXPONENT = 1.3, 0.27, 2.0, 0.1, 0.4


class Stroke(NamedTuple):
    """A recording at the times of force: time [s], force [N], place into the tissue [mm], each shape (n,)."""

    time_s: Array
    force_N: Array
    place_mm: Array

    @property
    def way_mm(self) -> Array:
        """Travel to each sample."""
        return np.diff(self.place_mm, prepend=self.place_mm[0])

    def moved(self, further_mm: Array) -> "Stroke":
        """As it would be if the tip had been ``further_mm`` further in at each time, by the curves of its own ways."""
        speed = _smoothed(self.way_mm)
        moving = np.abs(speed) > MOVING * float(np.quantile(np.abs(speed), 0.9))
        outward = moving & (speed < 0)
        change = np.empty_like(self.force_N)
        for measured, on_way in ((moving & ~outward, ~outward), (outward, outward)):
            curve = _curve(self.place_mm[measured], self.force_N[measured])
            here = self.place_mm[on_way]
            change[on_way] = curve(here + further_mm[on_way]) - curve(here)
        return self._replace(force_N=self.force_N + change)


def _smoothed(way_mm: Array) -> Array:
    return np.asarray(savgol_filter(way_mm, min(11, len(way_mm) // 2 * 2 - 1), 1))


def _curve(place_mm: Array, force_N: Array) -> Callable[[Array], Array]:
    """Mean force over place, straight on beyond its ends."""
    places = min(PLACES, len(place_mm) // EACH)
    if places < SMOOTH or np.ptp(place_mm) < LEAST_WAY_MM:
        return np.zeros_like
    edges = np.linspace(place_mm.min(), place_mm.max(), places + 1)
    number = np.clip(np.searchsorted(edges, place_mm, side="right") - 1, 0, places - 1)
    counts = np.bincount(number, minlength=places)
    held = counts > 0
    middle = 0.5 * (edges[1:] + edges[:-1])
    means = np.interp(middle, middle[held], np.bincount(number, force_N, places)[held] / counts[held])
    means = savgol_filter(means, SMOOTH, 2)
    first, last = (means[1] - means[0]) / (middle[1] - middle[0]), (means[-1] - means[-2]) / (middle[1] - middle[0])

    def force(at_mm: Array) -> Array:
        before, beyond = np.minimum(at_mm - middle[0], 0), np.maximum(at_mm - middle[-1], 0)
        return np.asarray(np.interp(at_mm, middle, means) + first * before + last * beyond)

    return force


class Session(NamedTuple):
    """What an operator may ask of the whole session: the middle of its time [s] and this recording's number."""

    middle_s: float
    number: int


class Operator(NamedTuple):
    """A cause: the stroke with ``size`` of it; the size's name in an answer ("" where it has none), and a size
    for a session that states none. ``also`` are further names that are right for it."""

    parameter: str
    usual: float
    act: Callable[[Stroke, float, Session], Stroke]
    also: frozenset[str] = frozenset()


def _dahl(stroke: Stroke, newton: float, _: Session) -> Stroke:
    """Dahl's friction, pushed back at the start; exact for each step of the way."""
    share, now = np.empty_like(stroke.force_N), -1.0
    for k, way in enumerate(stroke.way_mm):
        side = np.sign(way)
        now = side + (now - side) * np.exp(-abs(way) / LENGTH_MM) if way else now
        share[k] = now
    return stroke._replace(force_N=stroke.force_N + newton * share)


def _dead_band(stroke: Stroke, width_mm: float, _: Session) -> Stroke:
    """The tip stays behind on the way out until the axis has come back by the width."""
    tip, behind = stroke.place_mm[0], np.empty_like(stroke.place_mm)
    for k, place in enumerate(stroke.place_mm):
        tip = min(max(tip, place), place + width_mm)
        behind[k] = tip - place
    return stroke.moved(behind)


def _ripple(stroke: Stroke, amplitude_mm: float, _: Session) -> Stroke:
    return stroke.moved(amplitude_mm * np.sin(2 * np.pi * stroke.place_mm / PITCH_MM + 0.7))


def _moving_surface(stroke: Stroke, amplitude_mm: float, _: Session) -> Stroke:
    return stroke.moved(-amplitude_mm * np.sin(2 * np.pi * MOTION_HZ * stroke.time_s + 0.7))


def _soft_frame(stroke: Stroke, mm_per_N: float, _: Session) -> Stroke:
    return stroke.moved(-mm_per_N * (stroke.force_N - np.quantile(stroke.force_N, 0.02)))


def _drift(stroke: Stroke, newton_per_h: float, session: Session) -> Stroke:
    return stroke._replace(force_N=stroke.force_N + newton_per_h * (stroke.time_s - session.middle_s) / 3600)


def _low_pass(stroke: Stroke, tau_s: float, _: Session) -> Stroke:
    """First order; exact for a force that holds between samples."""
    kept = np.exp(-np.diff(stroke.time_s, prepend=stroke.time_s[0]) / tau_s)
    seen, now = np.empty_like(stroke.force_N), stroke.force_N[0]
    for k, (share, force) in enumerate(zip(kept, stroke.force_N, strict=True)):
        now = force + (now - force) * share
        seen[k] = now
    return stroke._replace(force_N=seen)


def _late(stroke: Stroke, seconds: float, _: Session) -> Stroke:
    return stroke._replace(time_s=stroke.time_s + seconds)


def _magnets(stroke: Stroke, newton: float, _: Session) -> Stroke:
    return stroke._replace(force_N=stroke.force_N + cogging(stroke.place_mm, newton, PITCH_MM, 0.7))


def _cycles(stroke: Stroke, share: float, session: Session) -> Stroke:
    zero_N = np.quantile(stroke.force_N, 0.02)
    gain = 1 + share * np.exp(-session.number / CYCLES)
    return stroke._replace(force_N=zero_N + (stroke.force_N - zero_N) * gain)


def _rate(stroke: Stroke, newton: float, _: Session) -> Stroke:
    """Drag by a power of speed, where the tip is in contact: the force is a twentieth of its largest above its zero."""
    step_s = np.maximum(np.diff(stroke.time_s, prepend=stroke.time_s[0] - 1), LEAST_WAY_MM)
    speed = _smoothed(stroke.way_mm / step_s)
    zero_N, top_N = np.quantile(stroke.force_N, [0.02, 0.98])
    inside = stroke.force_N > zero_N + 0.05 * (top_N - zero_N)
    drag_N = newton * np.sign(speed) * (np.abs(speed) / 10) ** EXPONENT
    return stroke._replace(force_N=stroke.force_N + inside * drag_N)


# Without a tracker a soft frame is a softer tissue of another shape; a drag beside the tissue's own leaves no exponent
# that could be known, and a damper that depends on speed another way is what memory looks like.
OPERATORS: Mapping[str, Operator] = {
    "time_offset": Operator("time_offset_s", 0.02, _late),
    "friction": Operator("friction_N", 0.2, _dahl),
    "backlash": Operator("backlash_mm", 0.3, _dead_band),
    "position_ripple": Operator("ripple_mm", 0.05, _ripple),
    "zero_drift": Operator("zero_drift_N_h", 10.0, _drift),
    "filter_lag": Operator("filter_lag_s", 0.02, _low_pass),
    "frame_compliance": Operator("frame_compliance_mm_N", 0.03, _soft_frame, frozenset({"elastic_law", "substrate"})),
    "rate_law": Operator("", 0.1, _rate, frozenset({"relaxation"})),
    "preconditioning": Operator("preconditioning_gain", 0.25, _cycles),
    "surface_motion": Operator("surface_motion_mm", 0.2, _moving_surface),
    "cogging": Operator("cogging_N", 0.1, _magnets),
}


def plant(session: TrialSet, cause: str, size: float) -> TrialSet:
    """The session as it would have been with ``size`` of the cause in it."""
    sound = [drop_unusable(trial) for trial in session.trials]
    middle_s = 0.5 * float(sound[0].force_s[0] + sound[-1].force_s[-1])
    planted = (_planted(trial, cause, size, Session(middle_s, number)) for number, trial in enumerate(sound))
    return replace(session, trials=tuple(planted))


def _planted(trial: Trial, cause: str, size: float, session: Session) -> Trial:
    place_mm = np.interp(trial.force_s, trial.axis_s, trial.axis_mm)
    changed = OPERATORS[cause].act(Stroke(trial.force_s, trial.force_N, place_mm), size, session)
    return replace(trial, force_s=changed.time_s, force_N=changed.force_N)
