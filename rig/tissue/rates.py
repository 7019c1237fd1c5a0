"""Do the curves at different speeds differ? The study says they do not, and uses B = 1.3 N s/mm; both cannot hold.

The unit is the trial: its mean force above the mean of all trials, over common depths, is regressed on its speed. The
slope is B.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from rig.errors import DataError
from rig.tissue.curves import Curve
from rig.tissue.laws import FloatArray

LEVEL = 0.95
STUDY_B_N_S_MM = 1.3
_DEPTHS = 40
_SHALLOWEST_MM = 0.2
_DRAWS = 2000


@dataclass(frozen=True)
class RateTest:
    """B in N s/mm with its interval over trials, the share of shuffled speed labels that give as large a slope, and
    what it means in force.
    """

    B_N_s_mm: float
    interval: tuple[float, float]
    p_value: float
    trials: int
    speeds_mm_s: tuple[float, ...]
    effect_N: float
    spread_N: float

    @property
    def study_effect_N(self) -> float:
        """Force between slowest and fastest speed if B were the study's 1.3 N s/mm."""
        return STUDY_B_N_S_MM * (self.speeds_mm_s[-1] - self.speeds_mm_s[0])

    @property
    def excludes_study(self) -> bool:
        """The study's B lies outside the interval."""
        return not self.interval[0] <= STUDY_B_N_S_MM <= self.interval[1]


def rate_test(curves: Sequence[Curve], seed: int = 0) -> RateTest:
    """Test for a difference between speeds; raises DataError below two speeds or four trials."""
    speeds = np.array([curve.speed_mm_s for curve in curves])
    if len(np.unique(speeds)) < 2 or len(curves) < 4:
        raise DataError(
            f"{len(curves)} trials at {len(np.unique(speeds))} speeds; the test needs 4 trials at 2 speeds or more"
        )
    level = _levels(curves)
    slope, interval = _slope(speeds, level)
    generator = np.random.default_rng(seed)
    shuffled = np.array([_slope(generator.permutation(speeds), level)[0] for _ in range(_DRAWS)])
    return RateTest(
        slope,
        interval,
        float((np.count_nonzero(np.abs(shuffled) >= abs(slope)) + 1) / (_DRAWS + 1)),
        len(curves),
        tuple(float(speed) for speed in np.unique(speeds)),
        slope * float(np.ptp(speeds)),
        float(np.std(level, ddof=1)),
    )


def _levels(curves: Sequence[Curve]) -> FloatArray:
    """Mean over common depths of each trial's force minus the mean of all trials, N."""
    deepest = min(curve.max_depth_mm for curve in curves)
    depth = np.linspace(min(_SHALLOWEST_MM, 0.5 * deepest), deepest, _DEPTHS)
    force = np.array([_force_at(curve, depth) for curve in curves])
    return np.asarray((force - force.mean(axis=0)).mean(axis=1))


def _force_at(curve: Curve, depth_mm: FloatArray) -> FloatArray:
    order = np.argsort(curve.depth_mm, kind="stable")
    return np.interp(depth_mm, curve.depth_mm[order], curve.force_N[order])


def _slope(x: FloatArray, y: FloatArray) -> tuple[float, tuple[float, float]]:
    centred = x - x.mean()
    slope = float(centred @ y / (centred @ centred))
    residual = y - y.mean() - slope * centred
    error = float(np.sqrt(residual @ residual / (len(x) - 2) / (centred @ centred)))
    reach = float(student.ppf((1.0 + LEVEL) / 2.0, len(x) - 2)) * error
    return slope, (slope - reach, slope + reach)
