"""Do the curves at different speeds differ? The study says they do not, and uses B = 1.3 N s/mm; both cannot hold.

The unit is the trial: its mean force over common depths, above the mean of its subject's trials, is regressed on its
speed. The slope is B.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.tissue.intervals import student_reach
from rig.tissue.laws import FloatArray
from rig.tissue.summary import RateTest
from rig.trials.curves import Curve

STUDY_B_N_S_MM = 1.3  # the study's, against which the session's is put
_DEPTHS = 40
_SHALLOWEST_MM = 0.2  # above it a curve's uncertain contact makes the force
_DRAWS = 2000
ROUNDING = 1e-9  # the same sum in another order is no larger slope


def rate_of(curves: Sequence[Curve]) -> RateTest | None:
    """The test, or None where trials or speeds are too few for it."""
    try:
        return rate_test(curves)
    except DataError:
        return None


def rate_test(curves: Sequence[Curve], seed: int = 0) -> RateTest:
    """Test for a difference between speeds, each subject against itself.

    Raises DataError below two speeds, or with fewer trials than three besides one a subject.
    """
    speeds = np.array([curve.speed_mm_s for curve in curves])
    _, subject = np.unique([curve.subject for curve in curves], return_inverse=True)
    groups = int(subject.max()) + 1 if len(curves) else 0
    inside = _centred(speeds, subject)
    if not np.any(inside) or len(curves) < groups + 3:
        raise DataError(
            f"{len(curves)} trials at {len(np.unique(speeds))} speeds; the test needs {groups + 3} trials at 2 speeds "
            "or more"
        )
    level = _centred(_levels(curves), subject)
    slope, interval = _slope(inside, level, len(curves) - groups - 1)
    generator = np.random.default_rng(seed)
    shuffled = np.array([_shuffled(inside, subject, generator) @ level for _ in range(_DRAWS)]) / (inside @ inside)
    range_mm_s = float(np.ptp(speeds))
    return RateTest(
        damping_N_s_mm=slope, interval=interval,
        p_value=float((np.count_nonzero(np.abs(shuffled) >= abs(slope) * (1 - ROUNDING)) + 1) / (_DRAWS + 1)),
        trials=len(curves), speeds_mm_s=tuple(float(speed) for speed in np.unique(speeds)),
        effect_N=slope * range_mm_s, effect_interval_N=(interval[0] * range_mm_s, interval[1] * range_mm_s),
        spread_N=float(np.sqrt(level @ level / (len(curves) - groups))), study_effect_N=STUDY_B_N_S_MM * range_mm_s,
        excludes_study=not interval[0] <= STUDY_B_N_S_MM <= interval[1],
    )  # fmt: skip


def _centred(values: FloatArray, group: NDArray[np.intp]) -> FloatArray:
    """Less the mean of each group."""
    return np.asarray(values - (np.bincount(group, values) / np.bincount(group))[group])


def _shuffled(values: FloatArray, group: NDArray[np.intp], generator: np.random.Generator) -> FloatArray:
    """The values in another order, each within its group."""
    order = np.lexsort((generator.random(len(values)), group))
    found = np.empty_like(values)
    found[np.argsort(group, kind="stable")] = values[order]
    return found


def _levels(curves: Sequence[Curve]) -> FloatArray:
    """Mean over common depths of each trial's force, N."""
    deepest = min(curve.max_depth_mm for curve in curves)
    depth = np.linspace(min(_SHALLOWEST_MM, 0.5 * deepest), deepest, _DEPTHS)
    return np.array([float(_force_at(curve, depth).mean()) for curve in curves])


def _force_at(curve: Curve, depth_mm: FloatArray) -> FloatArray:
    order = np.argsort(curve.depth_mm, kind="stable")
    return np.interp(depth_mm, curve.depth_mm[order], curve.force_N[order])


def _slope(x: FloatArray, y: FloatArray, freedom: int) -> tuple[float, tuple[float, float]]:
    """Of centred values."""
    slope = float(x @ y / (x @ x))
    residual = y - slope * x
    error = float(np.sqrt(residual @ residual / freedom / (x @ x)))
    reach = student_reach(freedom) * error
    return slope, (slope - reach, slope + reach)
