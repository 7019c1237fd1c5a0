"""Where the limb is in the robot's frame, from the tracker: tool 0 rides on the tip, tool 1 on the limb.

While the axis travels its first millimetres, the tip's marker draws a line in the tracker's frame; least squares of
marker on axis position give its direction n. Then arm - tip + n x stays the same as long as the limb does not move
against the robot, wherever the axis is and however the camera is carried (its rotation apart).
"""

import math
from collections import deque
from typing import NamedTuple

# With 20 frames of 0.06 mm noise the direction is then known to 6 mrad: 0.05 mm of apparent motion over as much again.
LEAST_TRAVEL_MM = 8.0
# With 20 frames of 0.06 mm noise the scale is then known within 0.06: enough to see a wrong gear before contact.
SCALE_TRAVEL_MM = 2.0
LEAST_FRAMES = 20
# Two-sided 99.9 % of a normal distribution: once in a thousand programs by chance, and then by the tolerance too.
CONFIDENCE = 3.29
SMOOTH_FRAMES = 6  # 0.1 s at 60 Hz, in which noise of 0.06 mm falls to 0.025
# From one frame of 60 Hz to the next at 0.5 mm/s.
LEAST_STEP_MM = 0.008
# What comes by USB is up to 16 ms late; in 20 an axis of 30 mm/s goes 0.6 mm, which hardly bends a line of 20 frames.
FRESH_NS, FRESH_PERIODS = 20_000_000, 2
HISTORY = 1000  # a second at 1 kHz: a frame that counts is 0.2 s old at most (`loop.stale_marker_ms`)
# How much later than stated a frame may have been taken, and how much earlier: trackers are late by one to four frames
# of 60 Hz. A step of 10 ms leaves 0.15 mm where an axis of 30 mm/s turns: over 4 mm of way less than tolerated.
LAGS_NS = tuple(range(-20_000_000, 70_000_000, 10_000_000))


class Point(NamedTuple):
    """A place in the tracker's frame."""

    x_mm: float
    y_mm: float
    z_mm: float


class Interval(NamedTuple):
    """Where a value lies, with 99.9 % confidence."""

    low: float
    high: float


class MarkerLine:
    """Running least squares of the tip's marker on the axis' position."""

    def __init__(self) -> None:
        self.count = 0
        self.spread = self._scatter = self._mean_mm = 0.0
        self._means, self._with = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]

    def add(self, position_mm: float, at: Point) -> None:
        """One frame."""
        self.count += 1
        change_mm = position_mm - self._mean_mm
        self._mean_mm += change_mm / self.count
        rest_mm = position_mm - self._mean_mm
        self.spread += change_mm * rest_mm
        for axis, value in enumerate(at):
            change = value - self._means[axis]
            self._means[axis] += change / self.count
            self._with[axis] += change_mm * (value - self._means[axis])
            self._scatter += change * (value - self._means[axis])

    @property
    def slopes(self) -> tuple[float, ...]:
        """Millimetres of the marker, along each coordinate, for each of the axis."""
        return tuple(value / self.spread for value in self._with)

    @property
    def left(self) -> float:
        """Variance about the line [mm2], of each of three coordinates."""
        return max(self._scatter - math.hypot(*self.slopes) ** 2 * self.spread, 0.0) / (3 * self.count - 6)


class Registration:
    """Fed with axis samples and tracker frames; ``moved_mm`` is NaN until the axis has travelled far enough."""

    def __init__(self, axis_period_ns: int) -> None:
        self._axis: deque[tuple[int, float]] = deque(maxlen=HISTORY)
        self._fresh_ns = FRESH_NS + FRESH_PERIODS * axis_period_ns
        self.begin()

    def begin(self) -> None:
        """A new program: where the limb is from now on is where it should be."""
        self.moved_mm = math.nan
        self._lines = {lag_ns: MarkerLine() for lag_ns in LAGS_NS}
        self._low_mm, self._high_mm = math.inf, -math.inf
        self._tip: tuple[int, Point, float] | None = None
        self._home: Point | None = None
        self._recent: deque[Point] = deque(maxlen=SMOOTH_FRAMES)

    def axis(self, capture_ns: int, position_mm: float) -> None:
        """One sample of the axis."""
        self._axis.append((capture_ns, position_mm))

    def tip(self, frame: int, capture_ns: int, at: Point) -> None:
        """The tip's marker in one frame; it counts for nothing where the axis has not said where it was by then."""
        position_mm = self._position(capture_ns)
        if position_mm is None or capture_ns - self._axis[-1][0] > self._fresh_ns:
            return
        before, self._tip = self._tip, (frame, at, position_mm)
        if self.registered:  # what comes after may be a camera that was pushed
            return
        # At rest a frame that is dated wrongly shows no lag and in motion it does: together they would bend the line.
        if before is None or abs(position_mm - before[2]) < LEAST_STEP_MM:
            return
        for lag_ns, line in self._lines.items():
            lagged_mm = self._position(capture_ns - lag_ns)
            line.add(self._axis[0][1] if lagged_mm is None else lagged_mm, at)
        self._low_mm, self._high_mm = min(self._low_mm, position_mm), max(self._high_mm, position_mm)

    def arm(self, frame: int, at: Point) -> None:
        """The limb's marker in the same frame."""
        if self._tip is None or self._tip[0] != frame or not self.registered:
            return
        _, tip, position_mm = self._tip
        slopes = self._lines[0].slopes
        relative = (a - t + slope * position_mm for a, t, slope in zip(at, tip, slopes, strict=True))
        self._recent.append(Point(*relative))
        if len(self._recent) < SMOOTH_FRAMES:
            return
        now = Point(*(sum(axis) / SMOOTH_FRAMES for axis in zip(*self._recent, strict=True)))
        self._home = self._home or now
        self.moved_mm = math.dist(now, self._home)

    @property
    def scale(self) -> Interval | None:
        """Millimetres of the tracker for each of the axis; None until 2 mm of way.

        Least squares of the marker on the axis: |w| / S, of which noise of variance s2 (from what the line leaves of
        three coordinates) makes s2 / S along the line; across it, noise adds to |w| no more than its own square. A
        frame dated wrongly bends the line where the axis turns: that lag counts which leaves least.
        """
        if self._lines[0].count < LEAST_FRAMES or self._high_mm - self._low_mm < SCALE_TRAVEL_MM:
            return None
        line = min(self._lines.values(), key=lambda each: each.left)
        slope, within = math.hypot(*line.slopes), CONFIDENCE * math.sqrt(line.left / line.spread)
        return Interval(slope - within, slope + within)

    @property
    def registered(self) -> bool:
        """Whether the axis' direction is known."""
        return self._lines[0].count >= LEAST_FRAMES and self._high_mm - self._low_mm >= LEAST_TRAVEL_MM

    def _position(self, capture_ns: int) -> float | None:
        """The axis when the frame was taken, between the samples around it; the newest where none came after it yet."""
        after: tuple[int, float] | None = None
        for sampled_ns, position_mm in reversed(self._axis):
            if sampled_ns <= capture_ns:
                if after is None:
                    return position_mm
                share = (capture_ns - sampled_ns) / (after[0] - sampled_ns)
                return position_mm + share * (after[1] - position_mm)
            after = sampled_ns, position_mm
        return None
