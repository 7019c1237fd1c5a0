"""The 95 % interval of what is made of means over units that were drawn alike (Efron 1979)."""

from collections.abc import Callable

import numpy as np

from rig.diagnosis.estimates import Estimate
from rig.diagnosis.noise import Array

DRAWS = 1000  # 25 beyond each end of a 95 % interval


def bootstrap(units: Array, statistic: Callable[[Array], Array]) -> Estimate:
    """``statistic`` of the means over units, shape (units, k), which come to it with k as their first axis."""
    picks = np.random.default_rng(0).integers(0, len(units), size=(DRAWS, len(units)))
    drawn = statistic(np.moveaxis(units[picks].mean(axis=1), -1, 0))
    low, high = np.percentile(drawn, [2.5, 97.5])
    return Estimate(float(statistic(units.mean(axis=0))), float(low), float(high))
