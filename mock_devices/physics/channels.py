"""What the electronics of a force sensor make of its six signals, and what a camera makes of a marker that slipped.

All at rest, they change nothing. Here stands what a fault does; who may ask for it stands in `sensing_faults.py`.
"""

import math
from dataclasses import dataclass

from mock_devices.parameters import Vector

CHANNELS = 6


@dataclass
class Channels:
    """The way from six loads to six converted values; the sensor's zero is added before the converter's end."""

    gain: float = 1.0
    dead: int | None = None
    crossed: bool = False
    drift_N_s: float = 0.0
    drifts_from_s: float = 0.0
    end_N: float = math.inf

    def converted(self, loads: list[float]) -> list[float]:
        """Fx Fy Fz [N] and Mx My Mz [N m] behind gain, plug and amplifier."""
        values = [self.gain * load for load in loads]
        if self.crossed:
            values[:3] = [values[2], values[0], values[1]]
        if self.dead is not None:
            values[self.dead] = 0.0
        return values

    def drifted_N(self, time_s: float) -> float:
        """How much compression the axial channel shows that is not there."""
        return self.drift_N_s * (time_s - self.drifts_from_s)

    def drift(self, rate_N_s: float, time_s: float) -> None:
        """From ``time_s`` on the zero runs away by ``rate_N_s``; 0 brings it back."""
        self.drift_N_s, self.drifts_from_s = rate_N_s, time_s


@dataclass
class Slips:
    """How far the markers have slipped on what they are fastened to, in the camera's frame [mm]."""

    tip_mm: Vector = (0.0, 0.0, 0.0)
    arm_mm: Vector = (0.0, 0.0, 0.0)


def moved(origin_mm: Vector, by_mm: Vector) -> Vector:
    """``origin_mm`` displaced."""
    return origin_mm[0] + by_mm[0], origin_mm[1] + by_mm[1], origin_mm[2] + by_mm[2]
