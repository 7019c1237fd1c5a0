"""From a device's own counter to the host's monotonic clock.

The delay of a sample on its way is never negative and often near its minimum, so the lower edge of arrival minus device
time, taken per window, carries offset and drift of the device's clock; a line through these minima is the map. A window
in which every sample came late, because the host was busy, is no part of it.
"""

from collections import deque
from collections.abc import Sequence
from itertools import pairwise

Point = tuple[int, int]
# How many times as high above the lower edge as half of the minima another may be and still count as one of them.
USUAL = 3


class Unwrapper:
    """Turns a counter of ``bits`` bits into one that never wraps."""

    def __init__(self, bits: int) -> None:
        self._modulus = 1 << bits
        self._last: int | None = None
        self._total = 0

    def __call__(self, count: int) -> int:
        """The unwrapped count; a step back of less than half the range is kept as a step back."""
        if self._last is None:
            self._total = count
        else:
            half = self._modulus >> 1
            self._total += (count - self._last + half) % self._modulus - half
        self._last = count
        return self._total


class ClockMap:
    """Regresses device time onto host time; ``latency_ns`` is the known smallest transport delay.

    Windows of ``window_ns`` keep their smallest delay; the last ``windows`` of them carry the line.
    """

    def __init__(self, latency_ns: int = 0, window_ns: int = 500_000_000, windows: int = 60) -> None:
        self._latency_ns = latency_ns
        self._window_ns = window_ns
        self._minima: deque[Point] = deque(maxlen=windows)
        self._start: int | None = None
        self._open: Point | None = None
        self._slope = 0.0
        self._anchor: Point = (0, 0)
        self._last_capture_ns = -(1 << 62)

    @property
    def drift_ppm(self) -> float:
        """How much faster the host's clock runs than the device's, as regressed so far."""
        return self._slope * 1e6

    def __call__(self, device_ns: int, arrival_ns: int) -> int:
        """Host time of capture; never after arrival and never before an earlier capture."""
        self._observe(device_ns, arrival_ns - device_ns)
        anchor_ns, offset_ns = self._anchor
        capture_ns = device_ns + offset_ns + round(self._slope * (device_ns - anchor_ns)) - self._latency_ns
        capture_ns = max(min(capture_ns, arrival_ns), self._last_capture_ns)
        self._last_capture_ns = capture_ns
        return capture_ns

    def _observe(self, device_ns: int, delay_ns: int) -> None:
        if self._start is None or self._open is None:
            self._start, self._open = device_ns, (device_ns, delay_ns)
            self._anchor = self._open
        elif device_ns - self._start >= self._window_ns:
            self._minima.append(self._open)
            self._start, self._open = device_ns, (device_ns, delay_ns)
            self._refit()
        elif delay_ns < self._open[1]:
            self._open = (device_ns, delay_ns)
            if len(self._minima) < 2:
                self._anchor = min(self._anchor, self._open, key=lambda point: point[1])

    def _refit(self) -> None:
        """Least squares in plain numbers: the first call into a linear algebra library costs 0.1 s of locked memory."""
        if len(self._minima) < 4:
            return
        points = _usual(self._minima)
        count = len(points)
        mean_ns = sum(device_ns for device_ns, _ in points) // count
        mean_delay_ns = sum(delay_ns for _, delay_ns in points) / count
        spread = sum((device_ns - mean_ns) ** 2 for device_ns, _ in points)
        covariance = sum((device_ns - mean_ns) * (delay_ns - mean_delay_ns) for device_ns, delay_ns in points)
        self._slope = covariance / spread
        self._anchor = (mean_ns, round(mean_delay_ns))


def _usual(minima: Sequence[Point]) -> list[Point]:
    """The points near the lower edge of all: late windows lie far above it, however late they are."""
    (first_ns, low_ns), (last_ns, high_ns) = _lower_edge(minima)
    slope = (high_ns - low_ns) / (last_ns - first_ns)
    heights_ns = [delay_ns - low_ns - slope * (device_ns - first_ns) for device_ns, delay_ns in minima]
    limit_ns = USUAL * sorted(heights_ns)[len(heights_ns) // 2]
    return [point for point, height_ns in zip(minima, heights_ns, strict=True) if height_ns <= limit_ns]


def _lower_edge(points: Sequence[Point]) -> tuple[Point, Point]:
    """The edge of the lower convex hull below the middle point.

    After Moon, Skelly and Towsley, Estimation and removal of clock skew from network delay measurements, INFOCOM 1999,
    who take the edge below the mean time: one window long before the others would move that, but not the middle.
    """
    hull: list[Point] = []
    for point in points:
        while len(hull) > 1 and not _bends_up(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    middle_ns, _ = points[len(points) // 2]
    return next(edge for edge in pairwise(hull) if edge[1][0] >= middle_ns)


def _bends_up(first: Point, middle: Point, last: Point) -> bool:
    return (middle[0] - first[0]) * (last[1] - first[1]) > (last[0] - first[0]) * (middle[1] - first[1])
