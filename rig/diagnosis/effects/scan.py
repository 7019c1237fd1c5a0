"""Where to look for periodic causes: peaks of the residual's match with a modulated sensitivity."""

import numpy as np

from rig.diagnosis.problem import Array

PEAKS = 4  # breathing, pulse and a harmonic of each; each one more is a further way for chance to fit


def peaks(coordinate: Array, match: Array, energy: float, grid: Array) -> list[float]:
    """Grid values whose sine and cosine of ``coordinate`` gather most of ``match`` (residual times sensitivity).

    ``match`` (n,) is summed in bins finer than an eighth of the shortest period before the transform.
    """
    width = 1 / (8 * float(grid.max()))
    bins = np.floor((coordinate - coordinate.min()) / width).astype(np.int64)
    total = np.bincount(bins, match)
    centre = coordinate.min() + (np.arange(len(total)) + 0.5) * width
    used = total != 0
    power = np.abs(np.exp(-2j * np.pi * np.outer(grid, centre[used])) @ total[used]) ** 2 / max(energy, 1e-300)
    inner = np.r_[True, power[1:] >= power[:-1]] & np.r_[power[:-1] >= power[1:], True]
    best = sorted(np.flatnonzero(inner), key=lambda k: -power[k])[:PEAKS]
    return [float(grid[k]) for k in best]
