"""What a sensor's converter leaves in its values: the step they are multiples of, and the ends of its range."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FLAT_SAMPLES = 8  # a converter that is full repeats its last value; eight in a row are no noise
# A sensor that stands still repeats values as well; a full one for much longer than anywhere else.
FLAT_FOLD = 4
# With fewer steps over its range a value lasts because the steps are coarse.
LEAST_STEPS = 20
# Enough for the steps of a converter to show, few enough to sort in a millisecond.
STEP_SAMPLES = 10_000
# Text and factors of units leave an error of rounding at the sixteenth digit; sensors have steps down to 24 bits.
ROUNDING_SHARE, FINEST_SHARE = 1e-9, 3e-8
# An amplifier that is full lets the noise of its converter through: four deviations of two steps, to either side; of
# what lies further off, no more than two samples in a row.
RIPPLE_STEPS, FURTHER_SAMPLES = 16, 2
# Samples whose slope can be told: of as long a way into the end as lies in it, and no fewer.
BEFORE = 3
# At a smooth peak, whatever the tissue remembers, the way on would add up to eight times what force changes by.
MISSED_FOLD = 20
# Of the way that a slope is told by: where a rest ends, noise over next to no way is any slope.
FURTHEST_FOLD = 5
# Of the travel: where the tip turns, force stands while a drive takes up its lost motion, a few tenths of a millimetre.
LOST_SHARE = 0.1


def resolution(value: Array) -> float:
    """The step that all finite values are multiples of, apart from an offset: Euclid's algorithm on their differences.

    0 where there is none: fewer than two values, or as fine as rounding.
    """
    thinned = value[:: -(-len(value) // STEP_SAMPLES)] if len(value) else value
    levels = np.unique(thinned)
    steps, span = np.diff(levels), float(np.ptp(levels)) if levels.size else 0.0
    largest = max(span, float(np.abs(levels).max(initial=0.0)))
    rounding, finest = ROUNDING_SHARE * largest, FINEST_SHARE * largest
    steps = steps[steps > rounding]
    found = float(steps.min(initial=np.inf))
    while finest < found < np.inf:
        left = np.abs(steps - found * np.round(steps / found))
        left = left[left > max(rounding, 1e-3 * found)]
        if not left.size:
            return found
        found = float(left.min())
    return 0.0


def at_the_end_of_range(value: Array, place: Array | None = None) -> NDArray[np.bool_]:
    """Which of the finite values, shape (n,), a full sensor cut off: a largest or smallest one that lasts.

    Either it lasts for longer than values do in between, where what a recording starts at is where it rests, and no end
    of range: a tared sensor whose noise is below its step reads the same all through the air. Or it stands, but for a
    few steps of ripple, while the tip, at ``place`` (n,), goes on by what would have changed it by far more.
    """
    full = _lasting(value)
    return full if place is None or full.any() else _standing(value, place)


def ends_of_range(value: Array, full: NDArray[np.bool_]) -> tuple[float, ...]:
    """The end, or both, at which the values that are ``full`` stand."""
    cut_off = value[full]
    if not cut_off.size:
        return ()
    low, high = float(cut_off.min()), float(cut_off.max())
    if high - low > 0.5 * np.ptp(value):
        return low, high
    return (high,) if high == value.max() else (low,)


def run_lengths(mark: NDArray[np.bool_]) -> NDArray[np.int64]:
    """For each element the length of the run of marks it lies in, 0 where it is not marked; shape (n,)."""
    edges = np.flatnonzero(np.diff(mark.astype(np.int8), prepend=0, append=0))
    lengths = np.zeros(len(mark), np.int64)
    lengths[mark] = np.repeat(edges[1::2] - edges[::2], edges[1::2] - edges[::2])
    return lengths


def _lasting(value: Array) -> NDArray[np.bool_]:
    if len(value) < FLAT_SAMPLES:
        return np.zeros(len(value), bool)
    span = float(np.ptp(value))
    ends = [np.abs(value - end) <= ROUNDING_SHARE * span for end in (value.max(), value.min())]
    ends = [end for end in ends if not end[0]]
    if max(map(np.count_nonzero, ends), default=0) < FLAT_SAMPLES:
        return np.zeros(len(value), bool)
    between = np.diff(value, prepend=np.nan) == 0
    for end in ends:
        between &= ~end
    held = int(run_lengths(between).max(initial=0))
    full = [end for end in ends if run_lengths(end).max(initial=0) >= max(FLAT_SAMPLES, FLAT_FOLD * held + 1)]
    if not full or span <= LEAST_STEPS * resolution(value):
        return np.zeros(len(value), bool)
    return np.asarray(np.logical_or.reduce(full))


def _standing(value: Array, place: Array) -> NDArray[np.bool_]:
    full, ripple = np.zeros(len(value), bool), RIPPLE_STEPS * resolution(value)
    if not 0 < LEAST_STEPS * ripple < np.ptp(value):
        return full
    air = float(value[:FLAT_SAMPLES].mean())  # what a recording starts at is where force rests, before and after
    for end in (end for end in (value.max(), value.min()) if abs(air - end) > 2 * ripple):
        far = np.abs(value - end) > ripple
        for start, stop in _runs(~far | (run_lengths(far) <= FURTHER_SAMPLES)):
            full[start:stop] = _missed(value, place, start, stop) > MISSED_FOLD * ripple
    return full


def _runs(mark: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """From where to where marks last for long, with samples before them."""
    edges = np.flatnonzero(np.diff(mark.astype(np.int8), prepend=0, append=0)).tolist()
    yield from (
        (start, stop) for start, stop in list(pairwise(edges))[::2] if start >= BEFORE and stop - start >= FLAT_SAMPLES
    )


def _missed(value: Array, place: Array, start: int, stop: int) -> float:
    """What the way between two samples, on or clearly back, would have changed, by the slope of the way there."""
    first = max(start - max(BEFORE, stop - start), 0)
    way = float(place[start - 1] - place[first])
    slope = abs(float(value[start - 1] - value[first])) / abs(way) if way else 0.0
    on = np.sign(way) * (place[start:stop] - place[start])
    further = max(float(on.max()), float(-on.min()) - LOST_SHARE * float(np.ptp(place)))
    return slope * further if further <= FURTHEST_FOLD * abs(way) else 0.0
