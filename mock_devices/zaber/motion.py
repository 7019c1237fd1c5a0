"""How a simulated Zaber axis moves: a trapezoid that a new order takes over at the speed it has, homing, stall, flags.

Positions are microsteps from home, which before homing is where it started.
"""

import math
from collections.abc import Iterator

from drivers.zaber.codec import ACCELERATION_PER_STEP, SPEED_PER_STEP
from drivers.zaber.flags import NONE, is_fault
from mock_devices.epos4.motion import HomingSetup, Inputs, TrapezoidalProfile, homing
from mock_devices.interfaces import AxisPlant
from mock_devices.zaber.commands import Refused
from mock_devices.zaber.settings import ZaberSettings

LIMIT_SWITCH = 17  # of CiA 402-2: onto the negative switch, then slowly off it, which is how these axes home
SLOW_SHARE = 0.1
STALL_MM = 1.5  # how far an axis with an encoder lags before it is stalled
ORDER = "FWN"  # flags rank by their first letter


class AxisMotion:
    """Leads ``plant``, which it takes hold of with its first move: before, another device may have it."""

    def __init__(self, plant: AxisPlant, settings: ZaberSettings, per_mm: float) -> None:
        self._plant, self._values, self._per_mm = plant, settings.values, per_mm
        self._up: set[str] = {"WR"}
        self._powered = True
        self._zero = self._raw()
        self._ramp = TrapezoidalProfile(self._raw())
        self._goal: float | None = None
        self._speed, self._acceleration = 0.0, 1.0
        self._cruise: float | None = None
        self._homing: Iterator[float | None] | None = None
        self._inputs = Inputs()

    @property
    def busy(self) -> bool:
        """Whether it moves."""
        return self._goal is not None or self._cruise is not None or self._homing is not None

    @property
    def position(self) -> int:
        """Microsteps from home."""
        return round(self._raw() - self._zero)

    @property
    def flag(self) -> str:
        """The flag that ranks highest."""
        return min(self._up, key=_rank, default=NONE)

    def flags(self, clear: bool) -> list[str]:
        """All that are up, the highest first; ``clear`` takes down what is no lasting state."""
        up = sorted(self._up, key=_rank)
        if clear:
            self._up &= {"WR", "WH", "FO"}
        return up

    def raise_flag(self, flag: str) -> None:
        """A flag comes up."""
        self._up.add(flag)
        if is_fault(flag):
            self._end()

    def restart(self) -> None:
        """As after power-up."""
        self._end()
        self._up = {"WR"}
        self._zero = self._raw()

    def home(self) -> str:
        """Begins to search for the reference."""
        self._take_hold()
        fast = self._values["limit.approach.maxspeed"] / SPEED_PER_STEP
        acceleration = self._values["accel"] / ACCELERATION_PER_STEP
        setup = HomingSetup(LIMIT_SWITCH, fast, fast * SLOW_SHARE, acceleration, 0.0, math.inf, 1.0)
        self._sense(0.001)
        self._homing = homing(setup, self._ramp, self._inputs)
        return "0"

    def move_to(self, target: float, speed: float, acceleration: float) -> str:
        """Begins to move to ``target``; speed and acceleration 0 are those of the settings. Raises Refused."""
        if not self._values["limit.min"] <= target <= self._values["limit.max"] or min(speed, acceleration) < 0:
            raise Refused("BADDATA")
        self._take_hold()
        fastest = self._values["maxspeed"]
        self._speed = min(speed or fastest, fastest) / SPEED_PER_STEP
        self._acceleration = (acceleration or self._values["accel"]) / ACCELERATION_PER_STEP
        self._goal = target + self._zero
        return "0"

    def move_at(self, speed: float) -> str:
        """Begins to move at ``speed`` until a limit."""
        if abs(speed) > self._values["maxspeed"]:
            raise Refused("BADDATA")
        self._take_hold()
        self._acceleration = self._values["accel"] / ACCELERATION_PER_STEP
        self._cruise = speed / SPEED_PER_STEP
        return "0"

    def stop(self, at_once: bool = False) -> str:
        """Begins to brake; ``at_once`` without a ramp."""
        if self.busy:
            self._up.add("NI")
            self._goal = self._homing = None
            self._cruise = 0.0
            self._acceleration = self._values["accel"] / ACCELERATION_PER_STEP
            if at_once:
                self._end()
        return "0"

    def power(self, on: bool) -> str:
        """The driver on or off."""
        if not on:
            self._end()
            self._up.add("FO")
            self._plant.power(False)
        elif "FO" in self._up:
            self._up.discard("FO")
            self._ramp = TrapezoidalProfile(self._raw())
            self._plant.power(True)
        self._powered = on
        return "0"

    def step(self, dt_s: float) -> None:
        """Time passes."""
        if self._homing is not None:
            self._search(dt_s)
        elif self._goal is not None:
            if self._ramp.towards(self._goal, self._speed, self._acceleration, self._acceleration, dt_s):
                self._goal = None
        elif self._cruise is not None:
            self._at_speed(self._cruise, dt_s)
        self._plant.target(self._ramp.position / self._per_mm)
        if abs(self._ramp.position - self._raw()) > STALL_MM * self._per_mm:
            self.raise_flag("FS")

    def _at_speed(self, speed: float, dt_s: float) -> None:
        there = self._ramp.at_speed(speed, self._acceleration, self._acceleration, dt_s)
        place = self._ramp.position - self._zero
        beyond = place > self._values["limit.max"] if speed > 0 else place < self._values["limit.min"]
        if (speed == 0 and there) or (speed and beyond):
            self._ramp.speed, self._cruise = 0.0, None

    def _search(self, dt_s: float) -> None:
        assert self._homing is not None
        self._sense(dt_s)
        home = next(self._homing)
        if home is not None:
            self._zero, self._homing = home, None
            self._up -= {"WR", "WH"}

    def _sense(self, dt_s: float) -> None:
        self._inputs.position, self._inputs.dt_s = self._raw(), dt_s
        self._inputs.negative_switch = self._plant.at_reference

    def _take_hold(self) -> None:
        """Raises Refused where there is no torque; a move under way is taken over."""
        if not self._powered:
            raise Refused("DRIVERDISABLED")
        if any(map(is_fault, self._up)):
            raise Refused("BADCOMMAND")
        if self.busy:
            self._up.add("NI")
        else:
            self._up.discard("NI")
            self._plant.power(True)
            self._ramp = TrapezoidalProfile(self._raw())
        self._goal = self._cruise = self._homing = None

    def _end(self) -> None:
        self._goal = self._cruise = self._homing = None
        self._ramp = TrapezoidalProfile(self._raw())
        if self._powered:
            self._plant.target(self._ramp.position / self._per_mm)

    def _raw(self) -> float:
        return self._plant.position_mm * self._per_mm


def _rank(flag: str) -> tuple[int, str]:
    return ORDER.find(flag[0]), flag
