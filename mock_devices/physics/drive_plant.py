"""Motor, ball screw and carriage as one mass, with the drive's position loop, its current limit and the brake.

The loop is that of a positioning controller with feed-forward: set-points are interpolated, smoothed, and followed by
velocity reference = feed-forward + position gain x error + integral, force = mass x velocity gain x velocity error.
"""

from mock_devices.parameters import Axis
from mock_devices.physics import STEP_S

MM_PER_M = 1000.0


class DrivePlant:
    """AxisPlant of the bench; the public figures are those at the time the bench was last advanced to."""

    def __init__(self, axis: Axis) -> None:
        self.position_mm = axis.start_mm
        self.velocity_mm_s = 0.0
        self.current_A = 0.0
        self.at_reference = axis.start_mm <= 0
        self.current_limit_A = axis.current_limit_A
        self.powered = False
        self._axis = axis
        self._accel_per_N = MM_PER_M / axis.mass_kg
        self._interpolation_steps = max(round(axis.interpolation_s / STEP_S), 1)
        self._smoothing = min(STEP_S / axis.smoothing_s, 1.0)
        self._brake_steps = round(axis.brake_delay_s / STEP_S)
        self._off_steps = self._brake_steps
        self._x = axis.start_mm
        self._v = 0.0
        self._pushed_A: float | None = None
        self._rest(axis.start_mm)

    def _rest(self, position_mm: float) -> None:
        self.target_mm = self._raw = self._smooth = self._reference = position_mm
        self._raw_step = self._speed = 0.0
        self._steps_left = 0
        self._integral_mm_s = 0.0

    def power(self, on: bool) -> None:
        """Torque on, holding where the carriage is; off, the brake closes after its delay."""
        if on and not self.powered:
            self._rest(self._x)
        if not on and self.powered:
            self._off_steps = 0
        self.powered, self._pushed_A = on, None

    def target(self, position_mm: float) -> None:
        """Goes to ``position_mm`` over one interpolation period."""
        if self._pushed_A is not None:
            self._rest(self._x)
            self._pushed_A = None
        self.target_mm = position_mm
        self._steps_left = self._interpolation_steps
        self._raw_step = (position_mm - self._raw) / self._interpolation_steps

    def push(self, current_A: float) -> None:
        """The motor gets this current, within its limit, whatever that does to the position."""
        self._pushed_A = current_A

    def step(self, load_N: float) -> tuple[float, float]:
        """Position and velocity one step later, under ``load_N`` against the direction of positive motion."""
        force_N = self._motor_N() if self.powered else 0.0
        axis, v = self._axis, self._v
        accel = (force_N - load_N - axis.viscous_N_s_mm * v) * self._accel_per_N
        free = v + accel * STEP_S
        grip = self._dry_N() * self._accel_per_N * STEP_S
        new = 0.0 if -grip <= free <= grip else free - grip if free > 0 else free + grip
        x = self._x + new * STEP_S
        if not axis.travel_min_mm <= x <= axis.travel_max_mm:
            x, new = (axis.travel_min_mm if x < axis.travel_min_mm else axis.travel_max_mm), 0.0
        self._x, self._v = x, new
        self.current_A = force_N / axis.force_per_current_N_A
        return x, new

    def publish(self, lag_s: float) -> None:
        """Sets the public figures to what they are ``lag_s`` after the last step."""
        self.position_mm = self._x + self._v * lag_s
        self.velocity_mm_s = self._v
        self.at_reference = self.position_mm <= 0

    def _dry_N(self) -> float:
        if self.powered:
            return self._axis.coulomb_N
        self._off_steps += 1
        closed = self._off_steps > self._brake_steps
        return self._axis.coulomb_N + (self._axis.brake_N if closed else 0.0)

    def _motor_N(self) -> float:
        axis = self._axis
        if self._pushed_A is not None:
            return max(-self.current_limit_A, min(self._pushed_A, self.current_limit_A)) * axis.force_per_current_N_A
        velocity, accel = self._follow()
        error = self._reference - self._x
        wanted = axis.velocity_feed_forward * velocity + axis.position_gain_per_s * error + self._integral_mm_s
        force_N = (
            axis.velocity_gain_per_s * (wanted - self._v) + axis.acceleration_feed_forward * accel
        ) / self._accel_per_N
        limit_N = self.current_limit_A * axis.force_per_current_N_A
        if -limit_N < force_N < limit_N:
            self._integral_mm_s += axis.integral_gain_per_s2 * error * STEP_S
            return force_N
        return limit_N if force_N > 0 else -limit_N

    def _follow(self) -> tuple[float, float]:
        """Interpolates and smooths the set-point; two equal filters, so that its acceleration is finite."""
        if self._steps_left:
            self._steps_left -= 1
            self._raw += self._raw_step
        self._smooth += self._smoothing * (self._raw - self._smooth)
        velocity = self._smoothing * (self._smooth - self._reference) / STEP_S
        accel = (velocity - self._speed) / STEP_S
        self._reference += velocity * STEP_S
        self._speed = velocity
        return velocity, accel
