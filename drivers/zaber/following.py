"""Set-points to moves that end by themselves: how an axis without a watch over its host is led.

The device knows no heartbeat: what it was told last, it does. So it is never told to go on, only to a place, which it
reaches ``AHEAD_PERIODS`` periods later at the speed that goes with it. The speed is that of the set-point, corrected by
how far the axis was from where the set-point had been one ``lag_s`` before: what is late by no more than the axis' own
lag is no error, and is not corrected twice. A host that dies leaves the axis at most ``run_on_mm`` further.
"""

import math
from collections import deque
from typing import NamedTuple

# Three periods are needed: the device must not brake for a target before the next one comes, and one may be lost.
AHEAD_PERIODS = 4.0
# A microstep or two of a usual screw; a slower move would take longer to begin than it lasts.
LEAST_SPEED_MM_S = 0.2
KEPT = 64  # set-points: 0.3 s of 200 Hz, ten times the lag of any axis


class BoundedMove(NamedTuple):
    """One order: where to, and how fast."""

    target_mm: float
    speed_mm_s: float


class AxisPlace(NamedTuple):
    """Where the axis was, and when."""

    taken_s: float
    position_mm: float
    velocity_mm_s: float

    def at(self, now_s: float) -> float:
        """Where it is at ``now_s`` if it goes on."""
        return self.position_mm + self.velocity_mm_s * (now_s - self.taken_s)


class Follower:
    """Makes the moves; ``period_s`` lies between two of them, ``lag_s`` between a set-point and the axis at it."""

    def __init__(self, period_s: float, lag_s: float, low_mm: float, high_mm: float, speed_mm_s: float) -> None:
        self._ahead_s, self._lag_s = AHEAD_PERIODS * period_s, lag_s
        self._low_mm, self._high_mm, self._fastest_mm_s = low_mm, high_mm, speed_mm_s
        self._past: deque[tuple[float, float]] = deque(maxlen=KEPT)

    def begin(self) -> None:
        """Whatever set-point comes next stands still, and always stood there."""
        self._past.clear()

    def move(self, setpoint_mm: float, now_s: float, place: AxisPlace) -> BoundedMove:
        """The move for a set-point at ``now_s``."""
        velocity_mm_s = self._velocity(setpoint_mm, now_s)
        self._past.append((now_s, setpoint_mm))
        error_mm = self._setpoint_at(place.taken_s - self._lag_s) - place.position_mm
        way_mm = self._limited(velocity_mm_s + error_mm / self._ahead_s) * self._ahead_s
        target_mm = min(max(place.at(now_s) + way_mm, self._low_mm), self._high_mm)
        return BoundedMove(target_mm, max(abs(way_mm) / self._ahead_s, LEAST_SPEED_MM_S))

    def _velocity(self, setpoint_mm: float, now_s: float) -> float:
        if not self._past or now_s <= self._past[-1][0]:
            return 0.0
        then_s, then_mm = self._past[-1]
        return (setpoint_mm - then_mm) / (now_s - then_s)

    def _limited(self, velocity_mm_s: float) -> float:
        return math.copysign(min(abs(velocity_mm_s), self._fastest_mm_s), velocity_mm_s)

    def _setpoint_at(self, then_s: float) -> float:
        """The set-point as it was, on the straight line between two; the first one before all."""
        after_s, after_mm = self._past[-1]
        for before_s, before_mm in reversed(self._past):
            if before_s <= then_s:
                share = min((then_s - before_s) / (after_s - before_s), 1.0) if after_s > before_s else 1.0
                return before_mm + share * (after_mm - before_mm)
            after_s, after_mm = before_s, before_mm
        return after_mm


def run_on_mm(speed_mm_s: float, period_s: float) -> float:
    """The farthest that the axis goes on once its host is dead, at a speed [mm]."""
    return speed_mm_s * AHEAD_PERIODS * period_s
