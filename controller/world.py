"""What one tick knows: measured inputs, what was found so far, and the set-point in force."""

import math
from dataclasses import dataclass, field

from controller.force_position import Memory
from controller.motion import Setpoint


@dataclass(slots=True)
class World:
    """State shared by steps and safety, owned by the machine; forces are compressive, from the reference zero."""

    setpoint: Setpoint = field(default_factory=lambda: Setpoint(0.0, 0.0))
    now_ns: int = 0
    dt_s: float = 0.001
    acceleration_mm_s2: float = 2000.0
    raw_N: float = math.nan
    force_samples: int = 0
    noise_N: float = 0.0
    force_N: float = math.nan
    force_rate_N_s: float = 0.0
    force_late: bool = False
    position_mm: float = math.nan
    velocity_mm_s: float = 0.0
    following_mm: float = 0.0
    standstill_mm: float = 0.0
    patient_mm: float = math.nan
    zero_N: float = math.nan
    first_zero_N: float = math.nan
    surface_mm: float = math.nan
    reference_N: float = math.nan
    tangent_N_mm: float = math.nan
    memory: Memory | None = None
    peak_force_N: float = 0.0
    outcome: str = ""

    @property
    def depth_mm(self) -> float:
        """Position below the surface found; NaN before contact."""
        return self.position_mm - self.surface_mm
