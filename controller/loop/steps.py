"""The steps a protocol is made of: data that can be checked before anything moves, and executed one cycle at a time.

``advance(state, elapsed_s)`` sets the next set-point and says whether the step is over; it never waits.
"""

import math
from statistics import fmean, pstdev
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field

from controller.law import force_position, force_profile
from controller.law.force_position import Feedback, ForceReading, Settings
from controller.law.force_profile import Line
from controller.law.inverse_model import GainRow, Inverse, columns
from controller.loop.modes import Mode
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from controller.loop.touch import Touching, TouchRun
from controller.safety.load import Wrench
from rig.config.protocol import FORCE_LIMIT
from rig.config.table import Table
from rig.errors import SafetyStop

Positive = Annotated[float, Field(gt=0)]
# The loading up to ten times the noise tells where it began; noise alone reaches four times itself three times in a
# row once in 10^13. More than 1 N is not pressed for that: the lowest pain thresholds of limbs are near 5 N.
CONTACT_SAMPLES = 3
TELLING_NOISE, CONTACT_NOISE, LARGEST_DETECTION_N = 10.0, 4.0, 1.0
RUN_IN_MM = 0.5  # the guide's slip ends within it
LARGEST_FRICTION_N = 0.5  # 0.2 N was met; what is more could as well be a limb
# Ten standard deviations of one sample of the noisier product; a hundred times those of a zero's mean.
LARGEST_ZERO_SHIFT_N = 0.5
# A tenth of limits.torque_N_m, and 25 standard deviations of one sample of the noisier product.
LARGEST_ZERO_SHIFT_N_M = 0.05
CHANNELS = ("fx", "fy", "fz", "mx", "my", "mz")
CHANNEL_SHIFTS = 3 * ((LARGEST_ZERO_SHIFT_N, "N"),) + 3 * ((LARGEST_ZERO_SHIFT_N_M, "N m"),)


class PlainStep(Table):
    """A step that keeps nothing between cycles."""

    def begin(self) -> Self:
        """A run of this step: itself."""
        return self


class Zero(Table):
    """Rests in the air and takes the mean force as zero; the first one of a session is the reference."""

    step: Literal["zero"] = "zero"
    mode: ClassVar[Mode] = Mode.FREE
    duration_s: Positive

    def begin(self) -> "ZeroRun":
        """A run of this step."""
        return ZeroRun(self)


class ZeroRun:
    """Collects all channels while resting, each sample once however often the loop turns."""

    def __init__(self, step: Zero) -> None:
        self._step, self._seen = step, -1
        self._values_N: list[float] = []
        self._wrenches: list[Wrench] = []

    def advance(self, state: LoopState, elapsed_s: float) -> bool:
        """Stands still; at the end sets zero and noise, refusing a zero far from the first in any channel."""
        if state.force_samples != self._seen:
            self._seen = state.force_samples
            self._values_N.append(state.raw_N)
            self._wrenches.append(state.wrench)
        if elapsed_s < self._step.duration_s:
            return False
        fx_N, fy_N, fz_N, mx_N_m, my_N_m, mz_N_m = (fmean(channel) for channel in zip(*self._wrenches, strict=True))
        zero = (fx_N, fy_N, fz_N, mx_N_m, my_N_m, mz_N_m)
        _refuse_drift(zero, state.reference_zero or zero)
        state.zero, state.reference_zero = zero, state.reference_zero or zero
        state.zero_N = fmean(self._values_N)
        state.noise_N = pstdev(self._values_N, state.zero_N)
        state.noise_N_m = math.sqrt(fmean(math.dist(wrench[3:], zero[3:]) ** 2 for wrench in self._wrenches))
        return True


def _refuse_drift(zero: Wrench, reference: Wrench) -> None:
    """Raises SafetyStop naming the channel that is furthest from the first zero of the session."""
    shifts = {
        name: (now - first, limit, unit)
        for name, now, first, (limit, unit) in zip(CHANNELS, zero, reference, CHANNEL_SHIFTS, strict=True)
    }
    name, (shift, limit, unit) = max(shifts.items(), key=lambda item: abs(item[1][0]) / item[1][1])
    if not abs(shift) <= limit:
        raise SafetyStop(
            f"{name} in the air moved by {shift:+.2g} {unit} since the first zero (limit {limit:g} {unit}):"
            " is the tip touching, or the sensor drifting?"
        )


class MoveTo(PlainStep):
    """Moves in the air to an axis position."""

    step: Literal["move"] = "move"
    mode: ClassVar[Mode] = Mode.FREE
    position_mm: float
    speed_mm_s: Positive

    def advance(self, state: LoopState, elapsed_s: float) -> bool:  # noqa: ARG002
        """One cycle of the move."""
        return state.go(self.position_mm, self.speed_mm_s)


class Approach(Table):
    """Moves down until the force says contact, and rests while the surface is estimated from the force on the way.

    Where the surface is not known to ``within_mm`` (95 %), the tip touches again, slowly, up to ``touches`` times.
    """

    step: Literal["approach"] = "approach"
    mode: ClassVar[Mode] = Mode.APPROACH
    speed_mm_s: Positive
    contact_force_N: Positive
    search_to_mm: float
    within_mm: Positive = 0.2
    touches: Annotated[int, Field(ge=0, le=10)] = 0
    touch_speed_mm_s: Positive = 0.5
    back_off_mm_s: Positive = 5.0

    def begin(self) -> "ApproachRun":
        """A run of this step."""
        return ApproachRun(self)


class ApproachRun:
    """Counts consecutive samples above the threshold: one spike is not contact, and neither is the sensor's noise.

    Nor is the friction of the linear guide, once the tip moves: force counts from what it is after the first 0.5 mm,
    where that is up to 0.5 N above the zero.
    """

    def __init__(self, step: Approach) -> None:
        self._step, self._above, self._seen = step, 0, -1
        self._from_mm, self._friction_N = math.nan, LARGEST_FRICTION_N
        self._running_in_N: list[float] = []
        self._touch: TouchRun | None = None
        self.has_run_in = False

    def threshold_N(self, state: LoopState) -> float:
        """Force that may be contact."""
        telling_N = min(TELLING_NOISE * state.noise_N, LARGEST_DETECTION_N)
        return max(self._step.contact_force_N, telling_N, CONTACT_NOISE * state.noise_N) + self._friction_N

    @property
    def searches(self) -> bool:
        """Whether contact was not detected yet."""
        return self._touch is None

    def advance(self, state: LoopState, elapsed_s: float) -> bool:  # noqa: ARG002
        """One cycle of the search, then of the touch; raises SafetyStop where it ends without contact."""
        if self._touch:
            return self._touch.advance(state)
        if state.force_samples != self._seen:
            self._seen = state.force_samples
            if not self.has_run_in:
                self._run_in(state)
            self._above = self._above + 1 if state.force_N > self.threshold_N(state) else 0
        if self._above >= CONTACT_SAMPLES:
            step = self._step
            touching = Touching(step.within_mm, step.touches, step.touch_speed_mm_s, step.back_off_mm_s)
            self._touch = TouchRun(state, touching, self.has_run_in)
            return self._touch.advance(state)
        if state.go(self._step.search_to_mm, self._step.speed_mm_s):
            raise SafetyStop(
                f"no contact down to {self._step.search_to_mm:g} mm (threshold {self._step.contact_force_N:g} N):"
                " is the limb under the tip? raise search_to_mm if the surface lies deeper"
            )
        return False

    def _run_in(self, state: LoopState) -> None:
        """Force after the slip of the guide and before 0.5 mm; before, anything up to the largest may be friction."""
        if math.isnan(self._from_mm):
            self._from_mm = state.position_mm
            state.paired.clear()
            state.paired.collecting = True
        moved_mm = state.position_mm - self._from_mm
        if moved_mm >= RUN_IN_MM:
            self.has_run_in = True
            state.paired.clear()
            self._friction_N = min(max(fmean(self._running_in_N or [0.0]), 0.0), LARGEST_FRICTION_N)
        elif moved_mm >= 0.5 * RUN_IN_MM:
            self._running_in_N.append(state.force_N)


class Compress(PlainStep):
    """Moves to a depth below the surface at constant speed; ends early at the force limit."""

    step: Literal["compress"] = "compress"
    mode: ClassVar[Mode] = Mode.COMPRESS
    depth_mm: float
    speed_mm_s: Positive
    force_limit_N: Positive

    def advance(self, state: LoopState, elapsed_s: float) -> bool:  # noqa: ARG002
        """One cycle; the limit of force ends the step where it is."""
        if state.force_N > self.force_limit_N:
            state.outcome = FORCE_LIMIT
            state.setpoint = Setpoint(state.setpoint.position_mm, 0.0)
            return True
        return state.go(state.surface_mm + self.depth_mm, self.speed_mm_s)


class Hold(PlainStep):
    """Keeps the set-point."""

    step: Literal["hold"] = "hold"
    mode: ClassVar[Mode] = Mode.COMPRESS
    duration_s: Annotated[float, Field(ge=0)]

    def advance(self, state: LoopState, elapsed_s: float) -> bool:  # noqa: ARG002
        """Stands still."""
        return elapsed_s >= self.duration_s


class Dither(Table):
    """A sine of position around the present set-point, whole periods, starting and ending without a jump."""

    step: Literal["dither"] = "dither"
    mode: ClassVar[Mode] = Mode.COMPRESS
    amplitude_mm: Positive
    frequency_Hz: Positive
    duration_s: Positive

    def begin(self) -> "DitherRun":
        """A run of this step."""
        return DitherRun(self)


class DitherRun:
    """Remembers the centre."""

    def __init__(self, step: Dither) -> None:
        self._step, self._centre_mm = step, math.nan
        self._end_s = math.ceil(step.duration_s * step.frequency_Hz) / step.frequency_Hz

    def advance(self, state: LoopState, elapsed_s: float) -> bool:
        """One cycle of the sine."""
        if math.isnan(self._centre_mm):
            self._centre_mm = state.setpoint.position_mm
        if elapsed_s >= self._end_s:
            state.setpoint = Setpoint(self._centre_mm, 0.0)
            return True
        omega = 2 * math.pi * self._step.frequency_Hz
        swing_mm = self._step.amplitude_mm * math.sin(omega * elapsed_s)
        state.setpoint = Setpoint(self._centre_mm + swing_mm, 0.0)
        return False


class TrackForce(Table):
    """Follows a force: a list of (seconds, newtons) joined by straight lines, played ``repeats`` times.

    The law goes on where the track step before it ended. What it is to follow is known beforehand, so it is asked for
    what will be wanted when the axis has followed.
    """

    step: Literal["track"] = "track"
    mode: ClassVar[Mode] = Mode.CONTACT
    times_s: tuple[Annotated[float, Field(ge=0)], ...] = Field(min_length=2)
    forces_N: tuple[Annotated[float, Field(ge=0)], ...] = Field(min_length=2)
    repeats: int = Field(default=1, ge=1)
    gains: tuple[GainRow, ...] = Field(min_length=2)
    damping_N_s_mm: Annotated[float, Field(ge=0)] = 0.0
    delay_s: float = Field(default=0.0, ge=0, description="of the axis, from set-point to force")
    lag1_s: float = Field(default=0.0, ge=0, description="the first of the axis' two lags")
    lag2_s: float = Field(default=0.0, ge=0, description="the other")
    preview_s: float = Field(default=0.0, ge=0, description="how much earlier the law is asked for it")
    ahead_mm_s: float = Field(default=24.0, ge=0, description="speed of the inverse model; 0: it is not used")
    crossover_rad_s: Positive
    lead_s: float = Field(default=0.0, ge=0, description="of each of the two leads")
    drift_rad_s: float = Field(default=0.0, ge=0, description="corner of the second integral; 0: none")
    drift_limit_mm_s: Positive = 5.0
    relaxation: tuple[tuple[float, Positive], ...] = Field(
        default=(), max_length=2, description="the tissue's: force that dies out over force at rest, and its time in s"
    )
    friction_N: Annotated[float, Field(ge=0)] = 0.0
    friction_mm: Positive = 1.0
    speed_limit_mm_s: Positive = 30.0
    search_speed_mm_s: Positive = 5.0
    contact_force_N: Positive = 0.1

    @property
    def given(self) -> Line:
        """The force that is to be there."""
        return Line(self.times_s, self.forces_N, self.repeats)

    @property
    def settings(self) -> Settings:
        """What of this step the law wants to know; below half the contact force there is no surface."""
        first, second = (*self.relaxation, (0.0, 1.0), (0.0, 1.0))[:2]
        inverse = Inverse(self.damping_N_s_mm, self.ahead_mm_s, *first, *second, self.friction_N, self.friction_mm)
        feedback = Feedback(
            self.delay_s, self.lag1_s, self.lag2_s, self.crossover_rad_s, self.lead_s, self.drift_rad_s,
            self.drift_limit_mm_s, self.speed_limit_mm_s, self.search_speed_mm_s, 0.5 * self.contact_force_N,
        )  # fmt: skip
        return Settings(inverse, feedback)

    def begin(self) -> "TrackForceRun":
        """A run of this step."""
        return TrackForceRun(self)


class TrackForceRun:
    """The force loop; below the contact threshold it only searches, slowly."""

    def __init__(self, step: TrackForce) -> None:
        self._given = step.given
        self._asked = force_profile.preview(step.given, step.preview_s)
        self._table, self._settings = columns(step.gains), step.settings

    def advance(self, state: LoopState, elapsed_s: float) -> bool:
        """One cycle of the force loop around the position loop."""
        state.reference_N = force_profile.at(self._given, elapsed_s)
        asked_N = force_profile.at(self._asked, elapsed_s)
        over = elapsed_s >= self._given.duration_s
        if state.force_late:  # an old force corrected again and again is how a stall becomes a push
            state.setpoint, state.memory = Setpoint(state.setpoint.position_mm, 0.0), None
            return over
        if state.memory is None:
            state.memory = force_position.begin(self._table, self._settings.inverse, state.force_N)
        measured = ForceReading(state.force_N, state.force_samples)
        step_mm, state.memory = force_position.increment(
            state.memory, self._table, self._settings, asked_N, measured, state.dt_s
        )
        state.tangent_N_mm = state.memory.tangent_N_mm
        state.setpoint = Setpoint(state.setpoint.position_mm + step_mm, step_mm / state.dt_s)
        return over


class Retract(PlainStep):
    """Moves out to a clearance above the surface."""

    step: Literal["retract"] = "retract"
    mode: ClassVar[Mode] = Mode.RETRACT
    clearance_mm: Positive
    speed_mm_s: Positive
    floor_mm: float = 0.0

    def advance(self, state: LoopState, elapsed_s: float) -> bool:  # noqa: ARG002
        """One cycle of the way out; without a surface it leaves from where it is."""
        state.reference_N = state.tangent_N_mm = math.nan
        state.memory = None
        return state.go(self.target_mm(state), self.speed_mm_s)

    def target_mm(self, state: LoopState) -> float:
        """Where it ends."""
        surface_mm = state.setpoint.position_mm if math.isnan(state.surface_mm) else state.surface_mm
        return max(surface_mm - self.clearance_mm, self.floor_mm)


Step = Zero | MoveTo | Approach | Compress | Hold | Dither | TrackForce | Retract
Run = ZeroRun | MoveTo | ApproachRun | Compress | Hold | DitherRun | TrackForceRun | Retract


class Program(Table):
    """Steps executed one after the other by the loop."""

    name: str
    steps: tuple[Annotated[Step, Field(discriminator="step")], ...] = Field(min_length=1)
