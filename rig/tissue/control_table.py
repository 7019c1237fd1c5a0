"""K and B for control: what a fitted law means to a force loop at each force, and how sure that is."""

from collections.abc import Sequence

import numpy as np

from rig.tissue.intervals import carried
from rig.tissue.judging import Judged
from rig.tissue.laws import FloatArray, Law
from rig.tissue.summary import ControlRow

REACHED = 0.01  # of the force: searches for a depth end far closer


def control_rows(judged: Judged, force_N: Sequence[float] | FloatArray) -> tuple[ControlRow, ...]:
    """One row a force that the law reaches; intervals carry the parameters' covariance through, at their level."""
    forces = reached(judged.law, np.asarray(force_N, float))
    found = _table(judged.law, forces)
    reach = judged.reach * carried(judged.law, judged.covariance, lambda law: _table(law, forces))
    low, high = np.maximum(found - reach, 0.0), found + reach
    return tuple(
        ControlRow(
            force_N=float(force), depth_mm=float(found[0, i]), secant_N_mm=float(found[1, i]),
            tangent_N_mm=float(found[2, i]), tangent_low_N_mm=float(low[2, i]), tangent_high_N_mm=float(high[2, i]),
            damping_N_s_mm=float(found[3, i]), damping_low_N_s_mm=float(low[3, i]),
            damping_high_N_s_mm=float(high[3, i]),
        )
        for i, force in enumerate(forces)
    )  # fmt: skip


def reached(law: Law, force_N: FloatArray) -> FloatArray:
    """Of the forces those on the rising part of the law: one that softens with depth has a largest."""
    depth_mm = law.depth(force_N)
    off_N = np.abs(law.force(depth_mm) - force_N)
    return force_N[(off_N <= REACHED * force_N) & (law.tangent_stiffness(depth_mm) >= 0)]


def _table(law: Law, force_N: FloatArray) -> FloatArray:
    """Depth at rest, secant, tangent and damping at each force, shape (4, r)."""
    depth_mm = law.depth(force_N)
    return np.array([depth_mm, law.secant_stiffness(depth_mm), law.tangent_stiffness(depth_mm), law.damping(depth_mm)])
