"""Frames of named poses to samples: what every tracker shares that says itself when a frame was taken.

A tool that a frame does not hold, or that is not tracked in it, gives an invalid sample without a pose, never a zero.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from drivers.roles import LinkCounters
from rig.channels import MarkerSample
from rig.config.products.roles import TrackerProduct
from rig.timing import ClockMap

# A sender that starts again counts from the beginning; what a network delivers in another order is a few frames late.
REORDERED = 120
# How far the entries of an orthonormal matrix in 32-bit reals may be from one: thirty times what rounding leaves.
ORTHONORMAL = 1e-3


class ToolPose(NamedTuple):
    """Where a tool is: millimetres, unit quaternion (scalar first), the tracker's own estimate of its error."""

    x_mm: float
    y_mm: float
    z_mm: float
    q0: float
    qx: float
    qy: float
    qz: float
    error_mm: float


NO_POSE = ToolPose(*[math.nan] * 8)


class PoseFrames:
    """Turns frames into samples, one a tool and frame; ``next_seq`` is the number of the next sample.

    A frame is counted in ``counters.frames``, in ``repeated`` where it is one of the past, and in ``device_lost`` where
    the numbers jumped over it.
    """

    def __init__(self, config: TrackerProduct, counters: LinkCounters) -> None:
        self.next_seq = 0
        self._tools, self._counters = config.tools, counters
        self._clock = ClockMap(latency_ns=round(config.latency_ms * 1e6))
        self._last: tuple[int, int] | None = None

    def restart(self) -> None:
        """The tracker may count anew; sample numbers go on."""
        self._clock.restart()
        self._last = None

    def samples(
        self, frame: int, device_ns: int, poses: Mapping[str, ToolPose], arrival_ns: int, more: int = 0
    ) -> list[MarkerSample]:
        """One sample a tool; none where the frame is not newer than the last one. ``more`` frames came with it."""
        if not self._is_newer(frame, device_ns):
            self._counters.repeated += 1
            return []
        self._last = frame, device_ns
        self._counters.frames += 1
        self._clock.observe(device_ns, arrival_ns)
        (capture_ns,) = self._clock.captures([device_ns], arrival_ns, more)
        return [
            self._sample(frame, index, poses.get(tool, NO_POSE), capture_ns, arrival_ns)
            for index, tool in enumerate(self._tools)
        ]

    def _is_newer(self, frame: int, device_ns: int) -> bool:
        if self._last is None:
            return True
        ahead = frame - self._last[0]
        if ahead > 0 and device_ns > self._last[1]:
            self._counters.device_lost += ahead - 1
            return True
        if ahead < -REORDERED or (ahead > 0 and device_ns <= self._last[1]):
            self.restart()
            return True
        return False

    def _sample(self, frame: int, tool: int, pose: ToolPose, capture_ns: int, arrival_ns: int) -> MarkerSample:
        known = pose if math.isfinite(pose.x_mm + pose.y_mm + pose.z_mm) else NO_POSE
        self.next_seq += 1
        stamps = (self.next_seq - 1, capture_ns, arrival_ns, frame, tool)
        return MarkerSample(*stamps, *known, int(known is not NO_POSE))


def quaternion(rotation: Sequence[float]) -> tuple[float, float, float, float] | None:
    """Unit quaternion of the matrix whose columns are ``rotation``, scalar first; None where it is no rotation.

    After Shepperd, Quaternion from rotation matrix, J. Guidance and Control 1, 1978: the largest component first.
    """
    first, second, third = rotation[:3], rotation[3:6], rotation[6:9]
    if not _is_rotation(first, second, third):
        return None
    (xx, yx, zx), (xy, yy, zy), (xz, yz, zz) = first, second, third
    squares = (1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz)
    largest = max(range(4), key=squares.__getitem__)
    rows = (
        (squares[0], zy - yz, xz - zx, yx - xy),
        (zy - yz, squares[1], yx + xy, xz + zx),
        (xz - zx, yx + xy, squares[2], zy + yz),
        (yx - xy, xz + zx, zy + yz, squares[3]),
    )
    length = math.hypot(*rows[largest])
    q0, qx, qy, qz = (value / length for value in rows[largest])
    return q0, qx, qy, qz


def _is_rotation(first: Sequence[float], second: Sequence[float], third: Sequence[float]) -> bool:
    """Orthonormal columns, the third the cross product of the others; NaN is none."""
    crossed = [
        first[1] * second[2] - first[2] * second[1],
        first[2] * second[0] - first[0] * second[2],
        first[0] * second[1] - first[1] * second[0],
    ]
    lengths = (math.hypot(*first), math.hypot(*second))
    return all(abs(length - 1) < ORTHONORMAL for length in lengths) and math.dist(crossed, third) < ORTHONORMAL
