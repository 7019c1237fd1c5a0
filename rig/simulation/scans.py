"""History operators as associative scans: memory without a loop over samples.

Each takes flat arrays in which recordings follow one another; ``first`` marks where a recording starts and memory is
cleared. A composition of two steps is again a step of the same kind, so log2(n) passes of doubling (Hillis and Steele,
Data parallel algorithms, 1986) give every prefix.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def recurrence(decay: Array, source: Array) -> Array:
    """State y of ``y[k] = decay[k] * y[k-1] + source[k]``; ``decay`` is 0 at the first sample of a recording."""
    a, y = decay.copy(), source.copy()
    step = 1
    while step < len(y) and np.any(a > 1e-300):
        carried = a[step:] * y[:-step]
        a[step:] = a[step:] * a[:-step]
        y[step:] += carried
        step *= 2
    return y


def decays(time_s: Array, first: NDArray[np.bool_], tau_s: float) -> Array:
    """Per-sample factors exp(-dt / tau) for ``recurrence``."""
    step_s = np.diff(time_s, prepend=time_s[:1])
    return np.where(first, 0.0, np.exp(-np.maximum(step_s, 0.0) / tau_s))


def high_pass(signal: Array, time_s: Array, first: NDArray[np.bool_], tau_s: float) -> Array:
    """State q of ``dq/dt = -q/tau + d(signal)/dt``, exact for signals linear between samples, q = 0 at the start."""
    decay = decays(time_s, first, tau_s)
    step_s = np.diff(time_s, prepend=time_s[:1])
    with np.errstate(invalid="ignore", divide="ignore"):
        mean_decay = np.where(step_s > 0, (1 - decay) * tau_s / step_s, 1.0)
    change = np.where(first, 0.0, np.diff(signal, prepend=signal[:1]))
    return recurrence(decay, mean_decay * change)


def low_pass(signal: Array, time_s: Array, first: NDArray[np.bool_], tau_s: float) -> Array:
    """First-order lag of ``signal``, at rest at the start of each recording."""
    return signal - high_pass(signal, time_s, first, tau_s)


def dahl(position: Array, first: NDArray[np.bool_], length: float, start: float = 0.0) -> Array:
    """Friction state z in -1..1 of ``dz/dx = (1 - sgn(v) z) / length`` (Dahl 1968), from ``start`` on."""
    travel = np.where(first, 0.0, np.diff(position, prepend=position[:1]))
    decay = np.exp(-np.abs(travel) / length)
    return recurrence(np.where(first, 0.0, decay), np.where(first, start, (1 - decay) * np.sign(travel)))


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
