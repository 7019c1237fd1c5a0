"""Effects between encoder and tissue: what the axis reports is not where the tip is, nor the surface where it was."""

import math
from dataclasses import dataclass, field

from mock_devices.physics import STEP_S
from mock_devices.physics.chain import Kinematic, Shift, knob

TIP_MASS_KG = 0.3
TIP_DAMPING = 0.3
GOLDEN = 0.6180339887498949


@dataclass
class PositionRipple(Kinematic):
    """Pitch error of the screw: tip = axis + A sin(2 pi axis / p + phase)."""

    amplitude_mm: float = knob(0.05, 0, 1, "amplitude of the pitch error")
    period_mm: float = knob(5.0, 0.1, 50, "lead of the screw")
    phase_rad: float = knob(0.0, -7, 7, "phase with the axis at 0")

    def __call__(self, position_mm: float, _contact_N: float) -> float:
        """The tip's position."""
        return position_mm + self.amplitude_mm * math.sin(math.tau * position_mm / self.period_mm + self.phase_rad)


@dataclass
class Backlash(Kinematic):
    """Play: the tip follows the axis with a dead band as wide as the gap."""

    gap_mm: float = knob(0.3, 0, 2, "width of the dead band")
    _tip_mm: float = field(default=math.nan, init=False)

    def __call__(self, position_mm: float, _contact_N: float) -> float:
        """The tip's position; it starts in the middle of the gap."""
        low, high = position_mm - self.gap_mm / 2, position_mm + self.gap_mm / 2
        if not low <= self._tip_mm <= high:
            self._tip_mm = low if self._tip_mm < low else high if self._tip_mm > high else position_mm
        return self._tip_mm


@dataclass
class FrameCompliance(Kinematic):
    """The frame gives way: tip = axis - c F at rest, with the tip's own mass on the frame's spring."""

    compliance_mm_N: float = knob(0.05, 0.001, 0.5, "deflection of the frame per newton")
    _bent_mm: float = field(default=0.0, init=False)
    _rate_mm_s: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        omega = math.sqrt(1000.0 / self.compliance_mm_N / TIP_MASS_KG)
        self._spring, self._damper = omega * omega, 2 * TIP_DAMPING * omega

    def __call__(self, position_mm: float, contact_N: float) -> float:
        """The tip's position, one semi-implicit step later."""
        push = contact_N * 1000.0 / TIP_MASS_KG
        self._rate_mm_s += STEP_S * (push - self._spring * self._bent_mm - self._damper * self._rate_mm_s)
        self._bent_mm += STEP_S * self._rate_mm_s
        return position_mm - self._bent_mm


@dataclass
class SurfaceMotion(Shift):
    """Breathing or pulse: the surface moves by A sin(2 pi f t + phase) with the time of the session."""

    amplitude_mm: float = knob(0.5, 0, 10, "amplitude of the surface's motion")
    frequency_Hz: float = knob(0.25, 0.01, 5, "how often")
    phase_rad: float = knob(0.0, -7, 7, "phase at the bench's start")

    def __call__(self, time_s: float, _touching: bool) -> float:
        """The surface's shift now."""
        return self.amplitude_mm * math.sin(math.tau * self.frequency_Hz * time_s + self.phase_rad)


@dataclass
class ContactOffset(Shift):
    """The surface is not where it is believed to be: by a constant, and by a scatter that is new for each contact.

    The scatter is uniform with the given rms and follows the golden-ratio sequence, so that it needs no random numbers.
    The limb shifts slowly once it has been left alone for a while.
    """

    offset_mm: float = knob(0.5, -5, 5, "surface farther away than stated")
    scatter_mm: float = knob(0.0, 0, 2, "rms of what each contact adds to it")
    _share: float = field(default=0.5, init=False)
    _untouched_steps: int = field(default=0, init=False)
    _touched: bool = field(default=False, init=False)

    ALONE_STEPS = round(0.2 / STEP_S)
    STRIDE_MM = 5.0 * STEP_S

    def __post_init__(self) -> None:
        self._shift_mm = self.offset_mm

    def __call__(self, _time_s: float, touching: bool) -> float:
        """The surface's shift for this contact."""
        if touching:
            self._touched, self._untouched_steps = True, 0
        elif self._touched:
            self._untouched_steps += 1
            if self._untouched_steps > self.ALONE_STEPS:
                self._touched, self._share = False, (self._share + GOLDEN) % 1.0
        else:
            way_mm = self.offset_mm + self.scatter_mm * math.sqrt(12.0) * (self._share - 0.5) - self._shift_mm
            self._shift_mm += max(-self.STRIDE_MM, min(way_mm, self.STRIDE_MM))
        return self._shift_mm
