"""How the mock drive moves by itself: a velocity-limited ramp, and the homing methods made of such ramps.

Positions are increments as the drive's raw counter has them, speeds increments/s; time steps are given.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass
class TrapezoidalProfile:
    """Moves ``position`` so that speed and acceleration stay within their limits and the end is met at rest."""

    position: float
    speed: float = 0.0

    def towards(self, target: float, top_speed: float, acceleration: float, deceleration: float, dt_s: float) -> bool:
        """One step towards ``target``; True once it is there and at rest."""
        left = target - self.position
        direction = 1.0 if left >= 0 else -1.0
        # The speed from which, after this step, the rest of the way is just enough to brake in.
        step = deceleration * dt_s
        braking = step * (math.sqrt(0.25 + 2 * abs(left) / (step * dt_s)) - 0.5)
        self._approach(direction * min(top_speed, braking), acceleration, deceleration, dt_s)
        self.position += self.speed * dt_s
        if abs(target - self.position) < 0.5 and abs(self.speed) <= 2 * step:
            self.position, self.speed = target, 0.0
            return True
        return False

    def at_speed(self, speed: float, acceleration: float, deceleration: float, dt_s: float) -> bool:
        """One step towards ``speed``; True once it has it."""
        self._approach(speed, acceleration, deceleration, dt_s)
        self.position += self.speed * dt_s
        return self.speed == speed

    def stop(self, deceleration: float, dt_s: float) -> bool:
        """One step towards rest; True once there."""
        return self.at_speed(0.0, deceleration, deceleration, dt_s)

    def _approach(self, wanted: float, acceleration: float, deceleration: float, dt_s: float) -> None:
        change = wanted - self.speed
        slowing = self.speed * change < 0
        limit = (deceleration if slowing else acceleration) * dt_s
        self.speed = wanted if abs(change) <= limit else self.speed + math.copysign(limit, change)


@dataclass(frozen=True)
class HomingSetup:
    """What homing needs to know; ``index_spacing`` is the distance of the encoder's index pulses."""

    method: int
    fast: float
    slow: float
    acceleration: float
    offset: float
    current_threshold_A: float
    index_spacing: float


@dataclass
class Inputs:
    """What the drive senses, renewed before each step: position (increments), switches, motor current."""

    position: float = 0.0
    negative_switch: bool = False
    positive_switch: bool = False
    current_A: float = 0.0
    dt_s: float = 0.0


NEEDS_HOME_SWITCH = (7, 11, 23, 27)
SEARCH_DIRECTION = {1: -1, 17: -1, 2: 1, 18: 1, -1: 1, -3: 1, -2: -1, -4: -1, 33: -1, 34: 1}
WITH_INDEX = (1, 2, -1, -2, 33, 34)


def homing(setup: HomingSetup, ramp: TrapezoidalProfile, inputs: Inputs) -> Iterator[float | None]:
    """Moves ``ramp`` a step an iteration; its last value is the position that becomes home, None before.

    Methods on a limit switch drive onto it fast, then leave it slowly: its edge is the reference (CiA 402, 1 2 17 18).
    Methods on current push against the mechanical stop (maxon, -1 to -4). 33 and 34 go to the next index pulse.
    """
    if setup.method == 37:
        yield inputs.position
        return
    direction = SEARCH_DIRECTION[setup.method]
    edge = inputs.position
    if setup.method in (1, 2, 17, 18):
        yield from _drive(setup, ramp, inputs, direction * setup.fast, until_switch=True, direction=direction)
        yield from _drive(setup, ramp, inputs, -direction * setup.slow, until_switch=False, direction=direction)
        edge, direction = inputs.position, -direction
    elif setup.method < 0:
        while direction * inputs.current_A < setup.current_threshold_A:
            ramp.at_speed(direction * setup.fast, setup.acceleration, setup.acceleration, inputs.dt_s)
            yield None
        ramp.position, ramp.speed = inputs.position, 0.0
        edge, direction = inputs.position, -direction
    if setup.method in WITH_INDEX:
        edge = _next_index(edge, direction, setup.index_spacing)
    while not ramp.towards(edge + setup.offset, setup.slow, setup.acceleration, setup.acceleration, inputs.dt_s):
        yield None
    yield edge + setup.offset


def _drive(
    setup: HomingSetup, ramp: TrapezoidalProfile, inputs: Inputs, speed: float, until_switch: bool, direction: int
) -> Iterator[None]:
    """At ``speed`` until the limit switch in ``direction`` is on, or off again; then down to rest."""
    while (inputs.negative_switch if direction < 0 else inputs.positive_switch) is not until_switch:
        ramp.at_speed(speed, setup.acceleration, setup.acceleration, inputs.dt_s)
        yield None
    if until_switch:
        while not ramp.stop(setup.acceleration, inputs.dt_s):
            yield None


def _next_index(position: float, direction: int, spacing: float) -> float:
    turns = position / spacing
    return (math.floor(turns) + 1 if direction > 0 else math.ceil(turns) - 1) * spacing
