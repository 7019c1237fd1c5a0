"""What can be counted of one stream: its clock, its steps, where it is full; findings, quality and report say it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.recording.converter import Array, run_lengths

# Two samples always lie on a line; the third can contradict it.
LEAST_SAMPLES = 3
# A stream that lost three samples in a row still goes on; four are a hole.
GAP_PERIODS = 5.0
# The highest bit of a word, and those that servos give their loads in.
SIGN_BITS = (10, 11, 15, 23, 31)
# What passes a power of two goes by a step or two there, and by twice the power if that were a sign.
LESS_JUMP = 0.25


class Sampling(NamedTuple):
    """Of times that are numbers: median period, longest step [s], steps that are gaps, scatter of the others' period.

    ``lost`` samples are not after all before them, the first of them ``first_lost`` (counted from 1, 0 without one).
    """

    period_s: float
    longest_s: float
    gaps: int
    scatter: float
    lost: int
    first_lost: int


def in_order(values: Array) -> NDArray[np.bool_]:
    """Which of finite times, or of other values, lie beyond every earlier one."""
    return np.concatenate([[True], values[1:] > np.maximum.accumulate(values)[:-1]]) if values.size else values > 0


def sampling_of(time_s: Array) -> Sampling:
    """How times, shape (n,), follow each other; periods are NaN where most of them stand still."""
    time_s = time_s[np.isfinite(time_s)]
    if len(time_s) < 2:
        return Sampling(np.nan, np.nan, 0, np.nan, 0, 0)
    step_s = np.diff(time_s)
    period_s = float(np.median(step_s))
    lost = int(np.count_nonzero(~in_order(time_s)))
    first = int(np.argmax(step_s <= 0)) + 2 if lost else 0
    if period_s <= 0:
        return Sampling(np.nan, np.nan, 0, np.nan, lost, first)
    gaps = gaps_in(step_s, period_s)
    scatter = float(np.std(step_s[~gaps & (step_s > 0)])) / period_s
    return Sampling(period_s, float(step_s.max()), int(np.count_nonzero(gaps)), scatter, lost, first)


def gaps_in(step_s: Array, period_s: float) -> NDArray[np.bool_]:
    """Which steps of a clock leave a hole."""
    return step_s > GAP_PERIODS * period_s


def sample_noise(values: Array) -> float:
    """Standard deviation of one sample by third differences: at 10 Hz the first ones of a ramp are no noise."""
    return float(np.median(np.abs(np.diff(values, 3)))) / (0.6745 * np.sqrt(20)) if len(values) > 3 else 0.0


def sign_bit(value: Array, step: float) -> int | None:
    """The bit of counts of ``step``, none negative, that seems to be their sign: read so, they jump far less by it."""
    if not step or value.min() < 0 or value.max() >= step * 2.0 ** (SIGN_BITS[-1] + 1):
        return None
    counts = np.rint(value / step).astype(np.int64)
    bit = int(counts.max()).bit_length() - 1
    above = counts >= 1 << bit
    signed = np.where(above, (1 << bit) - counts, counts)
    jumps = np.flatnonzero(np.diff(above))
    less = np.abs(np.diff(signed)[jumps]).sum() <= LESS_JUMP * np.abs(np.diff(counts)[jumps]).sum()
    return bit if bit in SIGN_BITS and len(jumps) > 1 and less else None


def longest_repeat(value: Array) -> int:
    """How many samples in a row have one value, at most; 0 of none."""
    return int(run_lengths(np.diff(value) == 0).max(initial=0)) + 1 if value.size else 0


def despiked(values: Array) -> Array:
    """Median of three: one wrong sample is no contact and no peak."""
    if len(values) < LEAST_SAMPLES:
        return values
    before, after = values[:-2], values[2:]
    low, high = np.minimum(before, after), np.maximum(before, after)
    return np.concatenate([values[:1], np.maximum(low, np.minimum(high, values[1:-1])), values[-1:]])
