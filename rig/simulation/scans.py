"""Friction and lost motion as associative scans: memory without a loop over samples.

Each takes flat arrays in which recordings follow one another; ``first`` marks where a recording starts and memory is
cleared. Two steps of a play are again one of the same kind, so log2(n) doublings give all (Hillis, Steele 1986).
"""

import numpy as np
from numpy.typing import NDArray

from rig.remembered import remembered
from rig.tissue.history import recurrence

Array = NDArray[np.float64]


@remembered
def dahl(position: Array, first: NDArray[np.bool_], length: float, start: float = 0.0) -> Array:
    """Friction state z in -1..1 of ``dz/dx = (1 - sgn(v) z) / length`` (Dahl 1968), from ``start`` on."""
    travel = np.where(first, 0.0, np.diff(position, prepend=position[:1]))
    decay = np.exp(-np.abs(travel) / length)
    return recurrence(np.where(first, 0.0, decay), np.where(first, start, (1 - decay) * np.sign(travel)))


@remembered
def play(position: Array, first: NDArray[np.bool_], width: float) -> Array:
    """Follower of a drive with dead band ``width`` that touches it in forward motion: x <= y <= x + width."""
    low, high = position.copy(), np.where(first, position, position + width)
    step = 1
    while step < len(low) and np.any(low < high):
        lower = np.clip(low[:-step], low[step:], high[step:])
        high[step:] = np.clip(high[:-step], low[step:], high[step:])
        low[step:] = lower
        step *= 2
    return low
