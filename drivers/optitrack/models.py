"""Which number Motive gives to which rigid body: its answer to a request for model definitions."""

import struct

from drivers.optitrack.frames import INT, PLACE_BYTES, WITH_SIZES
from drivers.optitrack.packets import Cursor, Version

MARKER_SET, RIGID_BODY, SKELETON = 0, 1, 2
WITH_NAMES: Version = (4, 0)
_PARENT_AND_OFFSET = struct.Struct("<i3f")


def decode_models(payload: bytes, version: Version) -> dict[str, int]:
    """Rigid bodies by name; raises BadPacket.

    Before 4.1 nothing says how long a description is: what stands behind the first of another kind is not read. Motive
    sends marker sets, rigid bodies and skeletons before all others.
    """
    cursor, bodies = Cursor(payload), dict[str, int]()
    for _ in range(cursor.count(INT.size)):
        kind = cursor.whole(INT)
        end = cursor.whole(INT) if version >= WITH_SIZES else -1
        rest = cursor.left
        if kind == MARKER_SET:
            _skip_marker_set(cursor)
        elif kind == RIGID_BODY:
            name, number = _rigid_body(cursor, version)
            bodies[name] = number
        elif kind == SKELETON:
            _skip_skeleton(cursor, version)
        elif end < 0:
            break
        if end >= 0:
            cursor.skip(end - (rest - cursor.left))
    return bodies


def _skip_marker_set(cursor: Cursor) -> None:
    cursor.text()
    for _ in range(cursor.count(1)):
        cursor.text()


def _rigid_body(cursor: Cursor, version: Version) -> tuple[str, int]:
    name, number = cursor.text(), cursor.whole(INT)
    cursor.take(_PARENT_AND_OFFSET)
    markers = cursor.count(PLACE_BYTES + INT.size)
    cursor.skip(markers * (PLACE_BYTES + INT.size))
    if version >= WITH_NAMES:
        for _ in range(markers):
            cursor.text()
    return name, number


def _skip_skeleton(cursor: Cursor, version: Version) -> None:
    cursor.text()
    cursor.skip(INT.size)
    for _ in range(cursor.count(1)):
        _rigid_body(cursor, version)
