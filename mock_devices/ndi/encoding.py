"""What the mock tracker says in TX and BX, with every reply option of the combined API (Polaris API guide, TX and BX).

Each tool's block holds what the options ask for in the order of their bits; after all tools come the stray markers and
the system status.
"""

import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple

from drivers.ndi.replies import DISABLED, MISSING, OUT_OF_VOLUME, STRAYS, TRANSFORMS, Pose, ToolReading

TOOL_INFORMATION, SINGLE_STRAY, TOOL_MARKERS = 0x0002, 0x0004, 0x0008
PASSIVE_TOOLS = 0x8000  # asks for passive tools beside active ones; every tool here is reported in any case
ALL_OPTIONS = TRANSFORMS | TOOL_INFORMATION | SINGLE_STRAY | TOOL_MARKERS | OUT_OF_VOLUME | STRAYS | PASSIVE_TOOLS
MARKERS_OF_A_TOOL = 20  # what the marker information has room for, a nibble each
USED = 3  # marker information: used for the pose
STATUS_FRAME, POSE, POINT = struct.Struct("<II"), struct.Struct("<8f"), struct.Struct("<3f")
Point = tuple[float, float, float]
# A passive tool as the maker sells them: four spheres, no two of their distances alike; mm in the tool's own frame.
SPHERES_MM: tuple[Point, ...] = ((0.0, 0.0, 0.0), (0.0, 28.6, 41.0), (0.0, 0.0, 88.0), (0.0, -44.3, 40.5))


class Scene(NamedTuple):
    """What is to be reported: tools in order of handles, markers that belong to none, the system status."""

    tools: Sequence[ToolReading]
    strays: Sequence[Point] = ()
    system_status: int = 0


def spheres_of(pose: Pose) -> list[Point]:
    """Where the four spheres of a tool at ``pose`` are, in the camera's frame."""
    return [_moved(pose, point) for point in SPHERES_MM]


def _moved(pose: Pose, point: Point) -> Point:
    """The point turned by the unit quaternion and shifted."""
    w, x, y, z = pose[:4]
    px, py, pz = point
    tx, ty, tz = 2 * (y * pz - z * py), 2 * (z * px - x * pz), 2 * (x * py - y * px)
    return (
        px + w * tx + y * tz - z * ty + pose.x_mm,
        py + w * ty + z * tx - x * tz + pose.y_mm,
        pz + w * tz + x * ty - y * tx + pose.z_mm,
    )


def encode_tx(scene: Scene, options: int = TRANSFORMS) -> str:
    """The text of a TX reply; ValueError where a number has no place in its digits."""
    lines = "".join(f"{tool.handle:02X}{_tx_tool(tool, options)}\n" for tool in scene.tools)
    strays = _tx_points(scene.strays) if options & STRAYS else ""
    return f"{len(scene.tools):02X}{lines}{strays}{scene.system_status:04X}"


def _tx_tool(tool: ToolReading, options: int) -> str:
    if tool.pose == DISABLED:
        return DISABLED
    pose = None if isinstance(tool.pose, str) else tool.pose
    blocks: dict[int, Callable[[], str]] = {
        TRANSFORMS: lambda: f"{_tx_pose(pose) if pose else MISSING}{tool.port_status:08X}{tool.frame or 0:08X}",
        TOOL_INFORMATION: lambda: f"00{_marker_information(pose):020X}",
        SINGLE_STRAY: lambda: MISSING,
        TOOL_MARKERS: lambda: _tx_points(spheres_of(pose) if pose else ()),
    }
    return "".join(block() for option, block in blocks.items() if options & option)


def _tx_pose(pose: Pose) -> str:
    text = "".join(f"{round(value * 10000):+06d}" for value in pose[:4])
    text += _tx_point(pose[4:7]) + f"{round(pose.error_mm * 10000):+06d}"
    if len(text) != 51:
        raise ValueError(f"{pose} does not fit into the digits of TX")
    return text


def _tx_point(point: Sequence[float]) -> str:
    return "".join(f"{round(value * 100):+07d}" for value in point)


def _tx_points(points: Sequence[Point]) -> str:
    """Count, a bit each for out of volume filled up to nibbles, coordinates."""
    return f"{len(points):02X}{'0' * -(-len(points) // 4)}{''.join(map(_tx_point, points))}"


def _marker_information(pose: Pose | None) -> int:
    """A nibble a marker, the first in the lowest."""
    return sum(USED << 4 * number for number in range(len(SPHERES_MM))) if pose else 0


def encode_bx(scene: Scene, options: int = TRANSFORMS) -> bytes:
    """The body of a BX reply."""
    body = bytes([len(scene.tools)]) + b"".join(_bx_tool(tool, options) for tool in scene.tools)
    strays = _bx_points(scene.strays) if options & STRAYS else b""
    return body + strays + scene.system_status.to_bytes(2, "little")


def _bx_tool(tool: ToolReading, options: int) -> bytes:
    if tool.pose == DISABLED:
        return bytes([tool.handle, 4])
    pose = None if isinstance(tool.pose, str) else tool.pose
    blocks: dict[int, Callable[[], bytes]] = {
        TRANSFORMS: lambda: (POSE.pack(*pose) if pose else b"") + STATUS_FRAME.pack(tool.port_status, tool.frame or 0),
        TOOL_INFORMATION: lambda: b"\0" + _marker_information(pose).to_bytes(MARKERS_OF_A_TOOL // 2, "big"),
        SINGLE_STRAY: lambda: b"\0",
        TOOL_MARKERS: lambda: _bx_points(spheres_of(pose) if pose else ()),
    }
    head = bytes([tool.handle, 1 if pose else 2])
    return head + b"".join(block() for option, block in blocks.items() if options & option)


def _bx_points(points: Sequence[Point]) -> bytes:
    """Count, a bit each for out of volume filled up to bytes, coordinates."""
    return bytes([len(points)]) + bytes(-(-len(points) // 8)) + b"".join(POINT.pack(*point) for point in points)
