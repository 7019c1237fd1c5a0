"""Where to look for periodic causes: peaks of the residual's match with a modulated sensitivity."""

import numpy as np

from rig.diagnosis.problem import Array

PEAKS = 4  # breathing, pulse and a harmonic of each; each one more is a further way for chance to fit


def peaks(coordinate: Array, match: Array, energy: float, grid: Array) -> list[float]:
    """Values of an even grid whose sine and cosine of ``coordinate`` gather most of ``match``, error by sensitivity.

    ``match`` (n,) is summed in bins finer than an eighth of the shortest period before the transform, a chirp (Rabiner,
    Schafer, Rader 1969): a matrix of hours of recordings and their frequencies does not fit any memory.
    """
    width = 1 / (8 * float(grid.max()))
    bins = np.floor((coordinate - coordinate.min()) / width).astype(np.int64)
    total = np.bincount(bins, match)
    step = float(grid[-1] - grid[0]) / max(len(grid) - 1, 1)
    power = chirp(total.astype(float), width * float(grid[0]), width * step, len(grid)) ** 2 / max(energy, 1e-300)
    inner = np.r_[True, power[1:] >= power[:-1]] & np.r_[power[:-1] >= power[1:], True]
    best = sorted(np.flatnonzero(inner), key=lambda k: -power[k])[:PEAKS]
    return [float(grid[k]) for k in best]


def chirp(signal: Array, start: float, step: float, count: int) -> Array:
    """Sizes of Fourier sums at ``count`` frequencies from ``start`` on [turns a sample], shape (count,)."""
    last, size = len(signal) - 1, 1 << (len(signal) + count).bit_length()
    half = np.exp(-1j * np.pi * step * np.arange(max(last + 1, count)) ** 2)
    turned = signal * np.exp(-2j * np.pi * start * np.arange(last + 1)) * half[: last + 1]
    kernel = np.concatenate([half[last:0:-1], half[:count]]).conj()
    # Not by scipy.signal, which takes a second to load.
    return np.abs(np.fft.ifft(np.fft.fft(turned, size) * np.fft.fft(kernel, size))[last : last + count])
