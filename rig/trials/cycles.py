"""One trial as three aligned arrays, on the force sensor's own time base."""

from dataclasses import dataclass

import numpy as np

from rig.trials.findings import Array
from rig.trials.trial import Trial, drop_unusable


@dataclass(frozen=True)
class IndentationCycle:
    """One trial at the capture times of force; force is compressive but not yet zeroed.

    Arrays have shape (n,); ``speed_mm_s`` is the speed asked for, NaN where nobody said.
    """

    name: str
    speed_mm_s: float
    time_s: Array
    force_N: Array
    position_mm: Array


def cycle_of(trial: Trial) -> IndentationCycle:
    """The trial, cleaned, with position at the times of force; raises DataError where too little is left."""
    sound = drop_unusable(trial)
    force_s, axis_s = (_from(sound.force_s[0], at_s) for at_s in (sound.force_s, sound.axis_s))
    position_mm = np.interp(force_s, axis_s, sound.axis_mm)
    return IndentationCycle(trial.name, trial.speed_mm_s, force_s, sound.force_N, position_mm)


def _from(start_s: float, at_s: Array) -> Array:
    """Times from the start, in whole nanoseconds: how far into a session the trial was made leaves no digit in them."""
    return np.asarray(np.rint((at_s - start_s) * 1e9) * 1e-9)
