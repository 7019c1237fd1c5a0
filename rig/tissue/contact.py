"""Where the tip touches: the onset of force along one stroke, as a position with an interval.

Force is modelled as zero before the contact c, and after it as a jump (a viscous term acts at once) and powers of the
depth p - c, none with a negative factor: any tissue that resists and stiffens. Every c is tried, with the jump and
without; the sums of squares, read as likelihoods with a penalty for the jump, give the contact (mean and deviation over
both) and, without that penalty, what it may be at most (three deviations).
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from rig.tissue.laws import FloatArray

CANDIDATES = 61
POWERS = (1, 2, 3, 4, 6)
FAR = 30.0
JUMP_PENALTY = 4.0
LEAST_SEARCH_MM = 0.1


class Contact(NamedTuple):
    """Axis position of the surface, the interval it must lie in, and its standard deviation (0: unknown)."""

    position_mm: float
    lower_mm: float
    upper_mm: float
    deviation_mm: float = 0.0

    @property
    def likely_mm(self) -> float:
        """The standard deviation; where it is unknown, a sixth of the interval."""
        return self.deviation_mm or (self.upper_mm - self.lower_mm) / 6


def find_contact(
    position_mm: FloatArray, force_N: FloatArray, search_mm: tuple[float, float], noise_N: float
) -> Contact:
    """The contact within ``search_mm``.

    ``position_mm`` and ``force_N``, shape (n,), are a stroke that begins in the air and ends shallow; force is zero in
    the air with standard deviation ``noise_N``.
    """
    coarse = np.linspace(min(search_mm[0], search_mm[1] - LEAST_SEARCH_MM), search_mm[1], CANDIDATES)
    near = coarse[(_excess(position_mm, force_N, coarse, noise_N) <= FAR).any(axis=1)]
    step_mm = float(coarse[1] - coarse[0])
    candidates = np.linspace(near[0] - step_mm, near[-1] + step_mm, CANDIDATES)
    excess = _excess(position_mm, force_N, candidates, noise_N)
    penalised = excess + np.array([0.0, JUMP_PENALTY])
    weights = np.exp(-(penalised - penalised.min()) / 2).sum(axis=1)
    found_mm = float(np.average(candidates, weights=weights))
    likely = candidates[(excess <= 9).any(axis=1)]
    # No contact is known better than the samples lie apart.
    step_mm = max(float(candidates[1] - candidates[0]), float(np.median(np.abs(np.diff(position_mm)))))
    return Contact(
        position_mm=found_mm,
        lower_mm=float(likely[0]) - step_mm,
        upper_mm=float(likely[-1]) + step_mm,
        deviation_mm=float(np.hypot(np.sqrt(np.average((candidates - found_mm) ** 2, weights=weights)), step_mm / 2)),
    )


def _excess(position_mm: FloatArray, force_N: FloatArray, candidates_mm: FloatArray, noise_N: float) -> FloatArray:
    """Sums of squares over their smallest, in units of the variance, shape (candidates, without and with a jump)."""
    misfits = np.array([_misfits(position_mm - candidate, force_N) for candidate in candidates_mm])
    variance = max(misfits.min() / max(len(force_N) - len(POWERS) - 2, 1), noise_N**2)
    return np.asarray((misfits - misfits.min()) / variance)


def _misfits(depth_mm: FloatArray, force_N: FloatArray) -> tuple[float, float]:
    """Sums of squares without and with a jump."""
    inside = depth_mm >= 0
    air = float(np.sum(force_N[~inside] ** 2))
    if not np.any(inside):
        return air, air
    depth, force = depth_mm[inside], force_N[inside]
    share = depth / max(float(depth.max()), 1e-9)
    columns = np.column_stack([share**power for power in POWERS] + [np.ones_like(share)])
    return air + float(nnls(columns[:, :-1], force)[1]) ** 2, air + float(nnls(columns, force)[1]) ** 2
