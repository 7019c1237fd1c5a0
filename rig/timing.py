"""From a device's own counter to the host's monotonic clock.

No sample arrives before it was taken, so the least delay seen bounds the offset between the clocks, and how far two
crystals may drift apart says for how long: a map that needs no window to fill, and that late samples cannot bend.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from itertools import accumulate, pairwise

Point = tuple[int, int]

# The most that two crystals' rates differ: data sheets of AT cuts allow each 30 ppm of tolerance, 50 for temperature
# and 5 a year, 260 for both after ten years; the rest is for a host that steers its clock.
CRYSTAL_PPM = 300.0
# How far the smallest delays of two windows lie apart by chance, at least: what a kernel takes to wake somebody.
SCATTER_NS = 50_000
# How fast the offset may rise beyond that where an old minimum leaves the windows: the host's clock was steered.
SETTLING_PPM = 50.0
# Over less than this, chance says more about the drift than the clocks do.
LEAST_SPAN_NS = 1_000_000_000


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
    """Device time onto host time; ``latency_ns`` is the known smallest transport delay.

    The offset is the least of ``delay + rate x age`` over all samples; ``rate`` is ``bound_ppm`` at first, and what the
    samples leave possible later on. It is kept from sample to sample, and taken anew from the smallest delays of the
    last ``windows`` windows of ``window_ns`` whenever one closes.
    """

    def __init__(
        self, latency_ns: int = 0, bound_ppm: float = CRYSTAL_PPM, window_ns: int = 500_000_000, windows: int = 60
    ) -> None:
        self.latency_ns = latency_ns
        self._bound = bound_ppm * 1e-6
        self._window_ns = window_ns
        self._minima: deque[Point] = deque(maxlen=windows)
        self._last_capture_ns = -(1 << 62)
        self.restart()

    def restart(self) -> None:
        """The device counts anew; capture times go on upwards."""
        self._minima.clear()
        self._start_ns: int | None = None
        self._edge: Point = (0, 0)
        self._slope, self._rate = 0.0, self._bound
        self._last_device_ns = 0

    @property
    def drift_ppm(self) -> float:
        """How much faster the host's clock runs than the device's, as far as the samples tell."""
        return self._slope * 1e6

    def lateness_ns(self, device_ns: int, arrival_ns: int) -> int:
        """How much later than possible a sample comes; negative where it is the quickest so far."""
        return arrival_ns - device_ns - self._offset_ns(device_ns)

    def observe(self, device_ns: int, arrival_ns: int) -> None:
        """Takes note of a sample; device times go upwards."""
        point = device_ns, arrival_ns - device_ns
        if self._start_ns is None:
            self._start_ns, self._edge, self._last_device_ns = device_ns, point, device_ns
            self._minima.append(point)
            return
        if device_ns - self._start_ns >= self._window_ns:
            self._start_ns = device_ns
            self._refit()
            self._minima.append(point)
        elif point[1] < self._minima[-1][1]:
            self._minima[-1] = point
        self._edge = device_ns, min(point[1], _bound_ns(self._edge, device_ns, self._rate))

    def captures(self, devices_ns: Sequence[int], arrival_ns: int, more: int = 0) -> list[int]:
        """Host times of capture of samples that were observed and came together, with so many ``more``, oldest first.

        Each is later than the one before it, and none is after arrival as long as arrivals go upwards.
        """
        left = len(devices_ns) + more
        return [self._capture(device_ns, arrival_ns, left - index) for index, device_ns in enumerate(devices_ns)]

    def _capture(self, device_ns: int, arrival_ns: int, left: int) -> int:
        """Where the offset has fallen, time goes on at half its pace until it is right again."""
        capture_ns = device_ns + self._offset_ns(device_ns) - self.latency_ns
        room_ns = (arrival_ns - self._last_capture_ns) // left
        least_ns = max(1, min((device_ns - self._last_device_ns) // 2, room_ns))
        capture_ns = max(min(capture_ns, arrival_ns - left + 1), self._last_capture_ns + least_ns)
        self._last_capture_ns, self._last_device_ns = capture_ns, device_ns
        return capture_ns

    def _offset_ns(self, device_ns: int) -> int:
        return _bound_ns(self._edge, device_ns, self._slope)

    def _refit(self) -> None:
        points = _in_time(self._minima, self._bound)
        span_ns = points[-1][0] - points[0][0]
        self._slope, self._rate = 0.0, self._bound
        if span_ns >= LEAST_SPAN_NS:
            hull = _lower_hull(points)
            self._slope = _slope(hull)
            self._rate = min(self._bound, self._slope + _scatter_ns(points, hull) / span_ns)
        at_ns, offset_ns = self._edge
        least_ns = min(_bound_ns(point, at_ns, self._rate) for point in points)
        self._edge = at_ns, min(least_ns, offset_ns + round(self._window_ns * SETTLING_PPM * 1e-6))


def _bound_ns(point: Point, device_ns: int, rate: float) -> int:
    """What a delay bounds the offset to at another device time, where the clocks drift apart at ``rate``."""
    at_ns, delay_ns = point
    return delay_ns + round(rate * (device_ns - at_ns))


def _in_time(minima: Sequence[Point], bound: float) -> list[Point]:
    """The points that no other shows to be late: higher above it than the clocks can have drifted between the two."""
    before = accumulate(minima, lambda least, point: min(point, (point[0], _bound_ns(least, point[0], bound))))
    after = accumulate(
        reversed(minima), lambda least, point: min(point, (point[0], _bound_ns(least, point[0], -bound)))
    )
    lowest = zip(before, reversed(list(after)), strict=True)
    return [point for point, (low, high) in zip(minima, lowest, strict=True) if point[1] <= min(low[1], high[1])]


def _lower_hull(points: Iterable[Point]) -> list[Point]:
    """The lower convex hull: drift lies below all delays and touches the smallest.

    After Moon, Skelly and Towsley, Estimation and removal of clock skew from network delay measurements, INFOCOM 1999.
    """
    hull: list[Point] = []
    for point in points:
        while len(hull) > 1 and not _bends_up(hull[-2], hull[-1], point):
            hull.pop()
        hull.append(point)
    return hull


def _bends_up(first: Point, middle: Point, last: Point) -> bool:
    return (middle[0] - first[0]) * (last[1] - first[1]) > (last[0] - first[0]) * (middle[1] - first[1])


def _slope(hull: Sequence[Point]) -> float:
    """The hull's mean slope over the middle half of its span: its ends lean on single points."""
    quarter_ns = (hull[-1][0] - hull[0][0]) // 4
    first_ns, last_ns = hull[0][0] + quarter_ns, hull[-1][0] - quarter_ns
    return (_height_ns(hull, last_ns) - _height_ns(hull, first_ns)) / (last_ns - first_ns)


def _scatter_ns(points: Sequence[Point], hull: Sequence[Point]) -> float:
    """Twice what half of the smallest delays lie above the least possible."""
    heights_ns = sorted(delay_ns - _height_ns(hull, device_ns) for device_ns, delay_ns in points)
    return max(2 * heights_ns[len(heights_ns) // 2], SCATTER_NS)


def _height_ns(hull: Sequence[Point], device_ns: int) -> float:
    left, right = next(edge for edge in pairwise(hull) if edge[1][0] >= device_ns)
    return left[1] + (right[1] - left[1]) * (device_ns - left[0]) / (right[0] - left[0])
