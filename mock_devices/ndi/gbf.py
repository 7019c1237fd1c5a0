"""The general binary format of BX2 (Vega API guide; NDI's own sample clients read it): a container of components.

Container: version, number of components. Component: type, bytes with these twelve, option, number of items, items. The
frame component's items hold a container of their own with the frame's transforms and marker positions.
"""

import re
import struct
from collections.abc import Sequence

from drivers.ndi.replies import DISABLED, Pose, ToolReading
from mock_devices.ndi.encoding import POINT, POSE, Point, Scene, spheres_of
from mock_devices.ndi.port_handles import CommandRefused

FRAME, TRANSFORM, POSITION = 1, 2, 3
PASSIVE_FRAME = 2  # the kind of illumination by which passive markers are seen
STRAY_HANDLE = 0xFFFF
MISSING_BIT, TOO_FEW_MARKERS, TOOL_UNPLUGGED = 0x0100, 0x0D, 0x21
_CONTAINER, _COMPONENT = struct.Struct("<HH"), struct.Struct("<HIHI")
_ITEM, _TOOL, _MARKER = struct.Struct("<BBHIII"), struct.Struct("<HH"), struct.Struct("<BBH")
_REQUEST = re.compile(r"--(6d|3d|sensor|1d)=([a-z]+)")
_CHOICES = {"6d": ("none", "tools"), "3d": ("none", "tools", "strays", "all"), "sensor": ("none",), "1d": ("none",)}


def parse_request(params: str) -> dict[str, str]:
    """What BX2 is asked for, by option; raises CommandRefused where an option or its value does not exist."""
    asked = {"6d": "tools", "3d": "none"}
    for word in params.split():
        match = _REQUEST.fullmatch(word)
        if not match or match[2] not in _CHOICES[match[1]]:
            raise CommandRefused(0x23)
        asked[match[1]] = match[2]
    return asked


def encode(scene: Scene, asked: dict[str, str], frame: int, time_ns: int) -> bytes:
    """The body of a BX2 reply: one frame with what was asked for."""
    inner = [_transforms(scene.tools)] if asked["6d"] == "tools" else []
    if asked["3d"] != "none":
        inner.append(_positions(scene, asked["3d"]))
    seconds, rest_ns = divmod(time_ns, 1_000_000_000)
    item = _ITEM.pack(PASSIVE_FRAME, 0, 0, frame, seconds, rest_ns) + _container(inner)
    return _container([_component(FRAME, [item])])


def _container(components: Sequence[bytes]) -> bytes:
    return _CONTAINER.pack(1, len(components)) + b"".join(components)


def _component(kind: int, items: Sequence[bytes]) -> bytes:
    data = b"".join(items)
    return _COMPONENT.pack(kind, _COMPONENT.size + len(data), 0, len(items)) + data


def _transforms(tools: Sequence[ToolReading]) -> bytes:
    return _component(TRANSFORM, [_transform(tool) for tool in tools])


def _transform(tool: ToolReading) -> bytes:
    if isinstance(tool.pose, Pose):
        return _TOOL.pack(tool.handle, 0) + POSE.pack(*tool.pose)
    return _TOOL.pack(tool.handle, MISSING_BIT | (TOOL_UNPLUGGED if tool.pose == DISABLED else TOO_FEW_MARKERS))


def _positions(scene: Scene, which: str) -> bytes:
    groups = []
    if which in ("tools", "all"):
        groups += [(tool.handle, spheres_of(tool.pose)) for tool in scene.tools if isinstance(tool.pose, Pose)]
    if which in ("strays", "all"):
        groups.append((STRAY_HANDLE, list(scene.strays)))
    return _component(POSITION, [_group(handle, points) for handle, points in groups])


def _group(handle: int, points: Sequence[Point]) -> bytes:
    markers = (_MARKER.pack(0, 0, index) + POINT.pack(*point) for index, point in enumerate(points))
    return _TOOL.pack(handle, len(points)) + b"".join(markers)
