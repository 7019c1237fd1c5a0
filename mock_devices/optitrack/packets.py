"""What a simulated Motive sends, packed by hand after the NatNet SDK: server information, models, frames."""

import struct
from collections.abc import Sequence

from mock_devices.interfaces import MarkerPose

TICKS_HZ = 10_000_000
NAME, MOTIVE = b"Motive", (3, 1, 0, 1)
# Corners of a body's own markers, mm, which are also what is labelled.
CORNERS_MM = ((20.0, 0.0, 0.0), (0.0, 30.0, 0.0), (0.0, 0.0, 40.0))
WITH_SIZES = (4, 1)
TRACKED, OCCLUDED, SOLVED, HAS_MODEL = 0x01, 0x01, 0x02, 0x08

Version = tuple[int, int]


def server_information(version: Version, data_port: int) -> bytes:
    """Name, versions, the clock's rate, and where data go."""
    return struct.pack("<256s4B4BQHB4B", NAME, *MOTIVE, *version, 0, 0, TICKS_HZ, data_port, 0, 0, 0, 0, 0)


def models(tools: Sequence[str], version: Version) -> bytes:
    """A marker set and a rigid body for each tool, and the set of all."""
    described = [part for number, tool in enumerate(tools, 1) for part in _of_tool(tool, number, version)]
    every = [(0, _marker_set("all", [f"{tool}_{corner}" for tool in tools for corner in (1, 2, 3)]))]
    parts = [*described, *every]
    sized = version >= WITH_SIZES
    return struct.pack("<i", len(parts)) + b"".join(
        struct.pack("<i", kind) + (struct.pack("<i", len(body)) if sized else b"") + body for kind, body in parts
    )


def _of_tool(tool: str, number: int, version: Version) -> list[tuple[int, bytes]]:
    corners = len(CORNERS_MM)
    names = [f"Marker{corner}" for corner in range(1, corners + 1)]
    places = b"".join(struct.pack("<3f", *(along / 1000 for along in corner)) for corner in CORNERS_MM)
    body = tool.encode() + b"\0" + struct.pack("<ii3fi", number, -1, 0.0, 0.0, 0.0, corners)
    body += places + struct.pack(f"<{corners}i", *[0] * corners)
    if version >= (4, 0):
        body += b"".join(name.encode() + b"\0" for name in names)
    return [(0, _marker_set(tool, names)), (1, body)]


def _marker_set(name: str, markers: Sequence[str]) -> bytes:
    named = b"".join(marker.encode() + b"\0" for marker in markers)
    return name.encode() + b"\0" + struct.pack("<i", len(markers)) + named


def frame(number: int, markers: Sequence[MarkerPose | None], ticks: int, version: Version) -> bytes:
    """One frame; a body that is hidden keeps its place of zeros and is marked as not tracked."""
    bodies = [_body(index, marker) for index, marker in enumerate(markers, 1)]
    labelled = [part for index, marker in enumerate(markers, 1) for part in _labelled(index, marker)]
    sections = [[], [], bodies, [], *([[]] if version >= WITH_SIZES else []), labelled, [], []]
    packed = b"".join(_section(parts, version) for parts in sections)
    stamps = struct.pack("<IIdQQQ", 0, 0, ticks / TICKS_HZ, ticks, ticks + 20_000, ticks + 40_000)
    precise = struct.pack("<II", ticks // TICKS_HZ, 0) if version >= WITH_SIZES else b""
    return struct.pack("<i", number) + packed + stamps + precise + struct.pack("<hi", 0, 0)


def _section(parts: Sequence[bytes], version: Version) -> bytes:
    body = b"".join(parts)
    return struct.pack("<i", len(parts)) + (struct.pack("<i", len(body)) if version >= WITH_SIZES else b"") + body


def _body(number: int, marker: MarkerPose | None) -> bytes:
    if marker is None:
        return struct.pack("<i3f4ffh", number, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    place = [along / 1000 for along in marker[:3]]
    turn = (marker.qx, marker.qy, marker.qz, marker.q0)
    return struct.pack("<i3f4ffh", number, *place, *turn, marker.error_mm / 1000, TRACKED)


def _labelled(number: int, marker: MarkerPose | None) -> list[bytes]:
    """Each corner beside the body's origin; turned by nothing, which a camera's noise of a tenth of a degree allows."""
    flags = HAS_MODEL | (SOLVED if marker else OCCLUDED)
    origin = marker[:3] if marker else (0.0, 0.0, 0.0)
    residual = marker.error_mm / 1000 if marker else 0.0
    return [
        struct.pack("<i3ffhf", number << 16 | corner, *_beside(origin, along), 0.012, flags, residual)
        for corner, along in enumerate(CORNERS_MM, 1)
    ]


def _beside(origin: Sequence[float], along: Sequence[float]) -> list[float]:
    return [(start + way) / 1000 for start, way in zip(origin, along, strict=True)]
