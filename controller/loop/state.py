"""What one cycle knows: measured inputs, what was found so far, and the set-point in force."""

import math
from dataclasses import dataclass, field

from controller.law.force_position import Memory
from controller.loop.carried import UNZEROED, Carried
from controller.loop.paired_samples import PairedSamples, Touch
from controller.loop.registration import Interval
from controller.loop.setpoint import Setpoint, arrived, toward
from controller.safety.load import NAN_WRENCH, UNKNOWN, TipLoad, Wrench


@dataclass(slots=True)
class LoopState:
    """State shared by steps and safety, owned by the machine.

    ``raw_N``, ``zero_N`` and ``force_N`` are the configured channel with its sign, compression positive; what safety
    looks at, ``load``, is all channels from ``reference_zero``, the first zero of the session; ``zero`` is the last.
    ``rest_N`` is the smallest load since the tip came to rest, NaN while it moves.
    """

    setpoint: Setpoint = field(default_factory=lambda: Setpoint(0.0, 0.0))
    now_ns: int = 0
    dt_s: float = 0.001
    acceleration_mm_s2: float = 2000.0
    position_min_mm: float = 0.0
    round_tip: bool = False
    wrench: Wrench = NAN_WRENCH
    zero: Wrench | None = None
    reference_zero: Wrench | None = None
    load: TipLoad = UNKNOWN
    rest_N: float = math.nan
    raw_N: float = math.nan
    force_samples: int = 0
    noise_N: float = 0.0
    noise_N_m: float = 0.0
    force_N: float = math.nan
    force_late: bool = False
    position_mm: float = math.nan
    velocity_mm_s: float = 0.0
    following_mm: float = 0.0
    standstill_mm: float = 0.0
    patient_mm: float = math.nan
    axis_scale: Interval | None = None
    zero_N: float = math.nan
    surface_mm: float = math.nan
    reference_N: float = math.nan
    tangent_N_mm: float = math.nan
    memory: Memory | None = None
    paired: PairedSamples = field(default_factory=PairedSamples)
    touch: Touch | None = None
    peak_force_N: float = 0.0
    outcome: str = ""
    carried: Carried = UNZEROED

    @property
    def depth_mm(self) -> float:
        """Position below the surface found; NaN before contact."""
        return self.position_mm - self.surface_mm

    def go(self, target_mm: float, speed_mm_s: float) -> bool:
        """The next set-point of a move; whether the move is over."""
        self.setpoint = toward(self.setpoint, target_mm, speed_mm_s, self.acceleration_mm_s2, self.dt_s)
        return arrived(self.setpoint, target_mm)
