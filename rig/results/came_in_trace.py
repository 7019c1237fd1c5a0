"""What is drawn of a recording that came in: few samples that look like all of them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.recording.converter import Array
from rig.trials.streams import gaps_in, sampling_of
from rig.trials.thinning import extremes

# Two a pixel of the widest panel of a picture with several.
POINTS = 500


class Points(NamedTuple):
    """Samples of force [N] by time [s] from the first, and by position [mm]; each of shape (n,)."""

    time_s: Array
    place_mm: Array
    force_N: Array


@dataclass(frozen=True)
class RecordingTrace:
    """What is drawn of a recording: few samples that look like all, where force is full, where its clock has holes.

    ``points`` without force are the motion by itself; ``full`` counts samples of which ``at_end`` are some.
    """

    points: Points
    at_end: Points
    full: int
    gaps_s: tuple[tuple[float, float], ...]


def trace_of(time_s: Array, force_N: Array, place_mm: Array, full: NDArray[np.bool_]) -> RecordingTrace:
    """What is to be drawn of samples, shape (n,), of which some are ``full``; a number nobody knows is NaN."""
    every = Points(time_s - float(time_s.min(initial=np.inf)), place_mm, force_N)
    at_end = Points(*(values[full] for values in every))
    count = int(np.count_nonzero(full))
    return RecordingTrace(_look_alike(every), _look_alike(at_end), count, tuple(_gaps(every.time_s)))


def _gaps(time_s: Array) -> Iterator[tuple[float, float]]:
    for at in np.flatnonzero(gaps_in(np.diff(time_s), sampling_of(time_s).period_s)):
        yield float(time_s[at]), float(time_s[at + 1])


def _look_alike(every: Points) -> Points:
    """Smallest and largest value of each stretch of the way and the time: a ramp is as short as its hold is long."""
    value = every.force_N if np.isfinite(every.force_N).any() else every.place_mm
    steps = np.abs(np.diff(every.place_mm, prepend=every.place_mm[:1]))
    way = np.cumsum(np.nan_to_num(steps))
    share = way / max(float(way.max(initial=0.0)), 1e-12) + np.arange(len(way)) / max(len(way), 1)
    known = np.flatnonzero(np.isfinite(value))
    kept = known[extremes(value[known], POINTS, share[known])]
    return Points(*(values[kept] for values in every))
