"""What the replies of the combined API say: tracking data (TX, BX), port handles, identity, errors in words.

Parsers return None for a reply that is not of its kind; they never raise on wire input.
"""

import math
import re
import struct
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

TRANSFORMS = 0x0001
"""Reply option: pose, port status and frame number of each tool."""
OUT_OF_VOLUME = 0x0800
"""Reply option: report poses outside the characterised volume too."""
STRAYS = 0x1000
"""Reply option: markers that belong to no tool."""

MISSING: Final = "MISSING"
DISABLED: Final = "DISABLED"


class Pose(NamedTuple):
    """A tool's pose in the sensor's frame, in the order of the wire."""

    q0: float
    qx: float
    qy: float
    qz: float
    x_mm: float
    y_mm: float
    z_mm: float
    error_mm: float


@dataclass(frozen=True, slots=True)
class ToolReading:
    """One handle of a TX or BX reply; ``frame`` is None where the tracker gives none (a disabled tool)."""

    handle: int
    pose: Pose | Literal["MISSING", "DISABLED"]
    port_status: int = 0
    frame: int | None = None


@dataclass(frozen=True, slots=True)
class TrackingReply:
    """A TX or BX reply."""

    tools: tuple[ToolReading, ...]
    system_status: int


class PortHandle(NamedTuple):
    """One handle of a PHSR reply; status bits: 01 tool in port, 10 initialised, 20 enabled."""

    handle: int
    status: int


class Version(NamedTuple):
    """What VER:0 tells of the device."""

    product: str
    serial: str
    freeze_tag: str


ERRORS = {
    0x01: "invalid command",
    0x02: "command too long",
    0x03: "command too short",
    0x04: "wrong checksum in the command",
    0x05: "time-out while executing the command",
    0x06: "communication parameters cannot be set",
    0x07: "wrong number of command parameters",
    0x08: "invalid port handle",
    0x09: "invalid tracking priority",
    0x0A: "invalid LED",
    0x0B: "invalid LED state",
    0x0C: "command not allowed in the present mode",
    0x0D: "no tool assigned to the port handle",
    0x0E: "port handle not initialised",
    0x0F: "port handle not enabled",
    0x10: "system not initialised",
    0x11: "tracking cannot be stopped",
    0x12: "tracking cannot be started",
    0x13: "the tool in the port cannot be initialised",
    0x14: "invalid characterisation of the position sensor",
    0x15: "the measurement system cannot be initialised",
    0x16: "diagnostic mode cannot be started",
    0x17: "diagnostic mode cannot be stopped",
    0x18: "environmental infrared cannot be measured",
    0x19: "the firmware's version cannot be read",
    0x1A: "internal error of the measurement system",
    0x1B: "infrared diagnostics cannot be initialised",
    0x1C: "marker firing signature cannot be set",
    0x1E: "tool memory cannot be read",
    0x1F: "tool memory cannot be written",
    0x22: "no camera parameters for the tool's wavelength in the chosen volume",
    0x23: "command parameter out of range",
    0x24: "parameters cannot be chosen by volume",
    0x25: "the list of features cannot be read",
    0x29: "main processor firmware corrupt",
    0x2A: "no memory left",
    0x2B: "port handle not allocated",
    0x2C: "port handle has become unoccupied",
    0x2D: "all port handles are allocated",
    0x2E: "invalid port description",
    0x2F: "port already assigned to a handle",
    0x33: "feature not available",
    0x34: "no such user parameter",
    0x35: "bad value of the user parameter",
    0x36: "value of the user parameter out of range",
    0x39: "permission denied",
    0xF4: "flash memory cannot be read",
    0xF5: "flash memory cannot be written",
    0xF6: "flash memory cannot be erased",
}
_ERROR = re.compile(r"ERROR([0-9A-F]{2,4})")
_LINE = re.compile(
    r"([0-9A-F]{2})(?:(MISSING)|(DISABLED|UNOCCUPIED)|"
    + r"([+-]\d{5})" * 4
    + r"([+-]\d{6})" * 3
    + r"([+-]\d{5}))(?:([0-9A-F]{8})([0-9A-F]{8}))?(.*)"
)
_HEX = re.compile(r"[0-9A-F]+")
_POSE_STATUS_FRAME = struct.Struct("<8fII")
_STATUS_FRAME = struct.Struct("<II")
_VALID_CODE, _MISSING_CODE, _DISABLED_CODE = 1, 2, 4


def parse_error(text: str) -> int | None:
    """The code of an ERROR reply."""
    match = _ERROR.fullmatch(text)
    return int(match[1], 16) if match else None


def error_words(code: int) -> str:
    """An error code as a person reads it."""
    return f"ERROR{code:02X}: {ERRORS.get(code, 'not in the list of errors')}"


def is_warning(text: str) -> bool:
    """Whether this is a WARNING, which stands for OKAY with a reserve."""
    return text.startswith("WARNING")


def parse_handle(text: str) -> int | None:
    """The handle of a PHRQ reply."""
    return int(text, 16) if len(text) == 2 and _HEX.fullmatch(text) else None


def parse_handles(text: str) -> tuple[PortHandle, ...] | None:
    """The handles of a PHSR reply."""
    if not _HEX.fullmatch(text) or len(text) != 2 + 5 * int(text[:2], 16):
        return None
    return tuple(
        PortHandle(int(text[at : at + 2], 16), int(text[at + 2 : at + 5], 16)) for at in range(2, len(text), 5)
    )


def parse_version(text: str) -> Version | None:
    """The reply to VER:0; None if it is not from a device of Northern Digital."""
    if "NDI S/N" not in text and "Northern Digital" not in text:
        return None
    lines = [line.strip() for line in text.splitlines()]
    fields = dict(line.split(":", 1) for line in lines if ":" in line)
    return Version(lines[0], fields.get("NDI S/N", "").strip(), fields.get("Freeze Tag", "").strip())


def parse_info(text: str) -> dict[str, str]:
    """The reply to GETINFO: name of each user parameter and its value."""
    pairs = (line.partition("=") for line in text.splitlines())
    return {name: rest.split(";", 1)[0] for name, equals, rest in pairs if equals}


def parse_tx(text: str, options: int = TRANSFORMS) -> TrackingReply | None:
    """The reply to ``TX:options``; what other options add to a tool's line is passed over.

    ``options`` must hold TRANSFORMS: without it the reply has no poses (ValueError).
    """
    if not options & TRANSFORMS:
        raise ValueError(f"TX:{options:04X} asks for no poses")
    if not _HEX.fullmatch(text[:2]):
        return None
    count = int(text[:2], 16)
    *lines, rest = text[2:].split("\n")
    if len(lines) != count or not _tail_fits(rest, options):
        return None
    tools = [_parse_line(line) for line in lines]
    if None in tools:
        return None
    return TrackingReply(tuple(tool for tool in tools if tool), int(rest[-4:], 16))


def _tail_fits(rest: str, options: int) -> bool:
    if not _HEX.fullmatch(rest[-4:]):
        return False
    if not options & STRAYS:
        return len(rest) == 4
    count = int(rest[:2], 16) if _HEX.fullmatch(rest[:2]) else -1
    return len(rest) == 2 + -(-count // 4) + 21 * count + 4


def _parse_line(line: str) -> ToolReading | None:
    match = _LINE.fullmatch(line)
    if not match:
        return None
    handle, missing, disabled, q0, qx, qy, qz, x, y, z, error, status, frame, _ = match.groups()
    if disabled:
        return ToolReading(int(handle, 16), DISABLED)
    if frame is None:
        return None
    pose: Pose | Literal["MISSING"] = MISSING
    if not missing:
        rotation = (int(digits) / 10000 for digits in (q0, qx, qy, qz))
        position = (int(digits) / 100 for digits in (x, y, z))
        pose = Pose._make((*rotation, *position, int(error) / 10000))
    return ToolReading(int(handle, 16), pose, int(status, 16), int(frame, 16))


def parse_bx(body: bytes, options: int = TRANSFORMS) -> TrackingReply | None:
    """The reply to ``BX:options``; options other than TRANSFORMS, OUT_OF_VOLUME and STRAYS are a ValueError."""
    if not options & TRANSFORMS or options & ~(TRANSFORMS | OUT_OF_VOLUME | STRAYS):
        raise ValueError(f"BX:{options:04X} is not a reply this parser knows")
    try:
        tools, at = _parse_tools(body)
        if options & STRAYS:
            at += 1 + (body[at] + 7) // 8 + 12 * body[at]
    except (struct.error, IndexError, ValueError):
        return None
    if at + 2 != len(body):
        return None
    return TrackingReply(tuple(tools), body[at] | body[at + 1] << 8)


def _parse_tools(body: bytes) -> tuple[list[ToolReading], int]:
    tools = []
    at = 1
    for _ in range(body[0]):
        handle, code = body[at], body[at + 1]
        at += 2
        if code == _VALID_CODE:
            *pose, status, frame = _POSE_STATUS_FRAME.unpack_from(body, at)
            at += 40
            # A pose that is no number is no pose.
            tools.append(ToolReading(handle, Pose(*pose) if math.isfinite(sum(pose)) else MISSING, status, frame))
        elif code == _MISSING_CODE:
            status, frame = _STATUS_FRAME.unpack_from(body, at)
            at += 8
            tools.append(ToolReading(handle, MISSING, status, frame))
        elif code == _DISABLED_CODE:
            tools.append(ToolReading(handle, DISABLED))
        else:
            raise ValueError(code)
    return tools, at
