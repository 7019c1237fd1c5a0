"""What a NatNet 3 or 4 frame holds, as far as a bench needs it: rigid bodies, labelled markers, and when it was taken.

Places come in metres and leave in millimetres. From 4.1 on each section has its size behind its count.
"""

import math
import struct
from typing import NamedTuple

from drivers.optitrack.packets import Cursor, Version
from drivers.poses import ToolPose

WITH_SIZES: Version = (4, 1)
MM = 1000.0
TRACKED, OCCLUDED = 0x01, 0x01
INT = struct.Struct("<i")
PLACE_BYTES = 12
BODY = struct.Struct("<i3f4ffh")
MARKER = struct.Struct("<i3ffhf")
ASSET_MARKER = struct.Struct("<i3ffhf")
SUFFIX = struct.Struct("<IIdQ")
UNKNOWN_TURN = (math.nan, math.nan, math.nan, math.nan)


class MotiveFrame(NamedTuple):
    """Tracked ``bodies`` by id and ``markers`` by (body, number); ``ticks`` is 0 where there is no such clock."""

    number: int
    bodies: dict[int, ToolPose]
    markers: dict[tuple[int, int], ToolPose]
    timestamp_s: float
    ticks: int


def decode_frame(payload: bytes, version: Version) -> MotiveFrame:
    """Raises BadPacket where the payload is no such frame."""
    cursor = Cursor(payload)
    number = cursor.whole(INT)
    for _ in range(_section(cursor, version, 5)):
        cursor.text()
        cursor.skip(PLACE_BYTES * cursor.count(PLACE_BYTES))
    cursor.skip(PLACE_BYTES * _section(cursor, version, PLACE_BYTES))
    bodies = dict(_body(cursor) for _ in range(_section(cursor, version, BODY.size)))
    for _ in range(_section(cursor, version, 8)):
        cursor.skip(INT.size)
        cursor.skip(BODY.size * cursor.count(BODY.size))
    if version >= WITH_SIZES:
        _skip_assets(cursor, version)
    markers = dict(_marker(cursor) for _ in range(_section(cursor, version, MARKER.size)))
    for _ in range(2):  # force plates and other devices
        _skip_channels(cursor, version)
    _, _, timestamp_s, ticks = cursor.take(SUFFIX)
    tracked = {number: pose for number, pose in bodies.items() if pose}
    seen = {number: pose for number, pose in markers.items() if pose}
    return MotiveFrame(number, tracked, seen, timestamp_s if math.isfinite(timestamp_s) else 0.0, int(ticks))


def _section(cursor: Cursor, version: Version, least: int) -> int:
    """The count of what follows, its size passed over."""
    if version < WITH_SIZES:
        return cursor.count(least)
    number = cursor.whole(INT)
    size = cursor.whole(INT)
    if not 0 <= number * least <= cursor.left or not 0 <= size <= cursor.left:
        cursor.skip(-1)
    return number


def _body(cursor: Cursor) -> tuple[int, ToolPose | None]:
    number, x, y, z, qx, qy, qz, qw, error, parameters = cursor.take(BODY)
    pose = ToolPose(MM * x, MM * y, MM * z, qw, qx, qy, qz, MM * error)
    return int(number), pose if int(parameters) & TRACKED else None


def _marker(cursor: Cursor) -> tuple[tuple[int, int], ToolPose | None]:
    number, x, y, z, _, parameters, residual = cursor.take(MARKER)
    pose = ToolPose(MM * x, MM * y, MM * z, *UNKNOWN_TURN, MM * residual)
    return (int(number) >> 16 & 0xFFFF, int(number) & 0xFFFF), None if int(parameters) & OCCLUDED else pose


def _skip_assets(cursor: Cursor, version: Version) -> None:
    for _ in range(_section(cursor, version, 12)):
        cursor.skip(INT.size)
        cursor.skip(BODY.size * cursor.count(BODY.size))
        cursor.skip(ASSET_MARKER.size * cursor.count(ASSET_MARKER.size))


def _skip_channels(cursor: Cursor, version: Version) -> None:
    for _ in range(_section(cursor, version, 8)):
        cursor.skip(INT.size)
        for _ in range(cursor.count(INT.size)):
            cursor.skip(4 * cursor.count(4))
