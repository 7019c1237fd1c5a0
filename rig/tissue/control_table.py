"""K and B for control: what a fitted law means to a force loop at each force, and how sure that is."""

from collections.abc import Sequence

import numpy as np

from rig.tissue.intervals import carried
from rig.tissue.judging import Judged
from rig.tissue.laws import FloatArray, Law
from rig.tissue.summary import ControlRow


def control_rows(judged: Judged, force_N: Sequence[float] | FloatArray) -> tuple[ControlRow, ...]:
    """One row a force; intervals carry the parameters' covariance through (delta method), at their level."""
    forces = np.asarray(force_N, float)
    found = _table(judged.law, forces)
    reach = judged.reach * carried(judged.law, judged.covariance, lambda law: _table(law, forces))
    low, high = np.maximum(found - reach, 0.0), found + reach
    return tuple(
        ControlRow(
            force_N=float(force),
            depth_mm=float(found[0, i]),
            secant_N_mm=float(found[1, i]),
            tangent_N_mm=float(found[2, i]),
            tangent_low_N_mm=float(low[2, i]),
            tangent_high_N_mm=float(high[2, i]),
            damping_N_s_mm=float(found[3, i]),
            damping_low_N_s_mm=float(low[3, i]),
            damping_high_N_s_mm=float(high[3, i]),
        )
        for i, force in enumerate(forces)
    )


def _table(law: Law, force_N: FloatArray) -> FloatArray:
    """Depth at rest, secant, tangent and damping at each force, shape (4, r)."""
    depth_mm = law.depth(force_N)
    return np.array([depth_mm, law.secant_stiffness(depth_mm), law.tangent_stiffness(depth_mm), law.damping(depth_mm)])
