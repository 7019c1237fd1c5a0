"""What a bench adds: friction, lost motion, ripple, a sensor's memory, breath; arrays of shape (steps, recordings)."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
BRANCHES = np.linspace(0.5, 1.5, 5)  # of a play or a stop, in shares of its mean width


def lugre(
    speed_mm_s: Array, step_s: float, coulomb_N: float, stiction_N: float, stribeck_mm_s: float, length_mm: float
) -> Array:
    """Friction of LuGre with Stribeck's curve (Canudas de Wit and others 1995), bristles pushed back at the start.

    dz/dt = v - |v| z s/g(v) is linear in z where v holds still, and is stepped by its exact solution.
    """
    stiffness = coulomb_N / length_mm
    level = coulomb_N + (stiction_N - coulomb_N) * np.exp(-((speed_mm_s / stribeck_mm_s) ** 2))
    kept = np.exp(-step_s * stiffness * np.abs(speed_mm_s) / level)
    reach = np.sign(speed_mm_s) * level
    force, now = np.empty_like(speed_mm_s), np.full(speed_mm_s.shape[1], -coulomb_N)
    for k in range(len(force)):
        force[k] = now = reach[k] + (now - reach[k]) * kept[k]
    return force


def dahl(place_mm: Array, coulomb_N: float, length_mm: float, exponent: float) -> Array:
    """Dahl's friction with an exponent other than one (Dahl 1976): dF/dx = Fc/l |1 - F/Fc sgn v|^i, by midpoints."""
    way = np.diff(place_mm, axis=0, prepend=place_mm[:1]) / length_mm
    share = np.empty_like(place_mm)
    now = np.full(place_mm.shape[1], -1.0)
    for k, step in enumerate(way):
        half = np.clip(now + 0.5 * step * _rise(now, step, exponent), -1, 1)
        share[k] = now = np.clip(now + step * _rise(half, step, exponent), -1, 1)
    return coulomb_N * share


def _rise(share: Array, step: Array, exponent: float) -> Array:
    return np.asarray(np.maximum(1 - share * np.sign(step), 0.0) ** exponent)


def lost_motion(place: Array, width: float) -> Array:
    """What follows ``place`` through several plays of different widths, ``width`` in the mean (Prandtl, Ishlinskii).

    It lies on ``place`` while that grows, and is ahead of it by the width once it has come back far enough.
    """
    follower = np.repeat(place[:1, :, None], len(BRANCHES), axis=2)[0]
    reach, followed = width * BRANCHES, np.empty_like(place)
    for k, now in enumerate(place):
        follower = np.minimum(np.maximum(follower, now[:, None]), now[:, None] + reach)
        followed[k] = follower.mean(axis=1)
    return followed


def cogging(place_mm: Array, newton: float, pitch_mm: float, phase: float) -> Array:
    """Magnets that pull a linear motor's carriage: pitch and its second harmonic (Jung and others 1999)."""
    turn = 2 * np.pi * place_mm / pitch_mm + phase
    return newton * (np.sin(turn) + 0.3 * np.sin(2 * turn + 1.0))


def sensor_hysteresis(force_N: Array, share: float, width_N: float) -> Array:
    """A sensor whose body remembers: ``share`` of force comes through plays of ``width_N`` (Kuhnen 2003)."""
    return force_N + share * (lost_motion(force_N, width_N) - force_N)


def slipped(force_N: Array, depth_mm: Array, rng: np.random.Generator, share: float) -> Array:
    """A tip that slides off a fold in every other stroke: from some depth on it carries ``share`` less."""
    slips = rng.random(force_N.shape[1]) < 0.5
    at_mm = rng.uniform(0.4, 0.9, force_N.shape[1]) * depth_mm.max(axis=0)
    gone = np.maximum.accumulate(depth_mm > at_mm, axis=0)
    return np.asarray(force_N * (1 - share * gone * slips))


def breath(time_s: Array, rng: np.random.Generator, amplitude_mm: float, period_s: float) -> Array:
    """A chest at rest: each breath cos^4 of its own period and depth, so no line spectrum (Lujan and others 1999)."""
    begin = np.concatenate([[0.0], np.cumsum(np.maximum(rng.normal(period_s, 0.15 * period_s, 2000), 1.0))])
    depth = amplitude_mm * np.exp(rng.normal(0, 0.3, 2000))
    number = np.clip(np.searchsorted(begin, time_s, side="right") - 1, 0, 1999)
    share = (time_s - begin[number]) / (begin[number + 1] - begin[number])
    return np.asarray(depth[number] * np.sin(np.pi * share) ** 4)


def tremor(time_s: Array, rng: np.random.Generator, rms_mm: float) -> Array:
    """Shaking of 8 to 12 Hz: many lines close together, so that it swells and fades (Elble and Koller 1990)."""
    lines = zip(rng.uniform(8, 12, 24), rng.uniform(0, 2 * np.pi, 24), strict=True)
    wave = sum((np.sin(2 * np.pi * hertz * time_s + phase) for hertz, phase in lines), np.zeros_like(time_s))
    return np.asarray(rms_mm * wave / np.sqrt(12))
