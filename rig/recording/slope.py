"""The slope of the tip's marker against the axis: 1 where both mean the same millimetre.

Least squares of each coordinate of the marker on position and velocity of the axis at the moment of the frame: the
factor of position is the tip's displacement per millimetre, a vector whose length is the slope; that of velocity takes
up how much later the tracker is than its time stamps say, which would else bend the slope wherever the axis moves.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.config.force_map import Vector
from rig.recording.reader import Recording

Array = NDArray[np.float64]
TIP_TOOL = 0
FEWEST_FRAMES = 20  # Student's t of what they leave free is 2.11: COVERAGE makes an interval 7 % too narrow at most
# Three tenths of a per cent of this are 12 um: what 200 frames of 0.1 mm noise can still tell.
LEAST_TRAVEL_MM = 4.0
# 95 % of a normal distribution.
COVERAGE = 1.96


class Slope(NamedTuple):
    """Millimetres of the tip's marker for each of the axis, with its standard deviation.

    ``direction`` is the way the marker goes, in the tracker's frame, when the axis' position grows; a unit vector.
    """

    slope: float
    deviation: float
    direction: Vector
    frames: int
    travel_mm: float

    @property
    def low(self) -> float:
        """Lower end of the 95 % interval."""
        return self.slope - COVERAGE * self.deviation

    @property
    def high(self) -> float:
        """Upper end of the 95 % interval."""
        return self.slope + COVERAGE * self.deviation


def tracker_slope(recording: Recording) -> Slope | None:
    """The slope in one recording; None where no tip was tracked, or too little or over too short a way."""
    axis, marker = recording.tables["axis"], recording.tables["marker"]
    moving, seen = axis["valid"] != 0, (marker["valid"] != 0) & (marker["tool"] == TIP_TOOL)
    if np.count_nonzero(moving) < FEWEST_FRAMES or np.count_nonzero(seen) < FEWEST_FRAMES:
        return None
    at = np.stack([marker[field][seen] for field in ("x_mm", "y_mm", "z_mm")], axis=1).astype(float)
    start_ns = axis["capture_ns"][moving][0]
    axis_s = (axis["capture_ns"][moving] - start_ns) * 1e-9
    marker_s = (marker["capture_ns"][seen] - start_ns) * 1e-9
    inside = (marker_s >= axis_s[0]) & (marker_s <= axis_s[-1])
    rows = axis[["position_mm", "velocity_mm_s"]][moving]
    position_mm = np.interp(marker_s[inside], axis_s, rows["position_mm"])
    velocity_mm_s = np.interp(marker_s[inside], axis_s, rows["velocity_mm_s"])
    return slope_of(position_mm, velocity_mm_s, at[inside])


def slope_of(position_mm: Array, velocity_mm_s: Array, marker_mm: Array) -> Slope | None:
    """The slope of frames at known places; shapes (n,), (n,) and (n, 3). None below 20 frames or 4 mm of travel.

    Neighbouring frames err alike (a camera's error wanders): the deviation counts them by the lag-one correlation of
    their residuals (Bartlett 1946).
    """
    travel_mm = float(np.ptp(position_mm)) if position_mm.size else 0.0
    if position_mm.size < FEWEST_FRAMES or travel_mm < LEAST_TRAVEL_MM:
        return None
    columns = np.column_stack([np.ones_like(position_mm), position_mm - position_mm.mean(), velocity_mm_s])
    columns = columns if np.any(velocity_mm_s) else columns[:, :2]
    factors = np.linalg.lstsq(columns, marker_mm, rcond=None)[0]
    per_mm, slope = factors[1], float(np.linalg.norm(factors[1]))
    x, y, z = (float(part) / slope if slope else math.nan for part in per_mm)
    along_mm = (marker_mm - columns @ factors) @ (per_mm / slope if slope else per_mm)
    variance = float(np.sum(along_mm**2)) / (position_mm.size - columns.shape[1])
    deviation = math.sqrt(variance * float(np.linalg.inv(columns.T @ columns)[1, 1]) * _inflation(along_mm))
    return Slope(slope, deviation, (x, y, z), position_mm.size, travel_mm)


def _inflation(residual: Array) -> float:
    """How much more the variance is than that of independent residuals; at least 1."""
    total = float(np.sum(residual**2))
    lag_one = float(np.sum(residual[1:] * residual[:-1])) / total if total else 0.0
    lag_one = min(max(lag_one, 0.0), 0.99)
    return (1 + lag_one) / (1 - lag_one)
