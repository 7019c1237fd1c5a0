"""Set-points along one axis with bounded speed and acceleration, one cycle at a time."""

import math
from typing import NamedTuple


class Setpoint(NamedTuple):
    """Where the axis is told to be, and how fast that moves."""

    position_mm: float
    velocity_mm_s: float


def toward(now: Setpoint, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float, dt_s: float) -> Setpoint:
    """The next set-point of a trapezoidal move; ends exactly on ``target_mm`` with no velocity."""
    distance_mm = target_mm - now.position_mm
    stopping_mm_s = math.sqrt(2.0 * acceleration_mm_s2 * abs(distance_mm))
    wanted_mm_s = math.copysign(min(speed_mm_s, stopping_mm_s), distance_mm)
    velocity_mm_s = clamp(wanted_mm_s, now.velocity_mm_s, acceleration_mm_s2 * dt_s)
    step_mm = velocity_mm_s * dt_s
    if step_mm * distance_mm >= 0 and abs(step_mm) >= abs(distance_mm):
        return Setpoint(target_mm, 0.0)
    return Setpoint(now.position_mm + step_mm, velocity_mm_s)


def clamp(value: float, centre: float, half_width: float) -> float:
    """``value`` brought within ``half_width`` of ``centre``."""
    return min(max(value, centre - half_width), centre + half_width)


def arrived(now: Setpoint, target_mm: float) -> bool:
    """Whether the move is over."""
    return now.position_mm == target_mm and now.velocity_mm_s == 0.0
