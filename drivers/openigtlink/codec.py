"""OpenIGTLink, bytes only: messages of protocol versions 1 to 3, and the contents that carry tracked tools.

Layouts: openigtlink.org, protocols v2_header, v3_proposal (extended header), v2_transform, v2_trackingdata. Versions 1
and 2 of the protocol have header version 1, version 3 has header version 2 and an extended header in the body.
"""

import math
import struct
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from drivers.poses import ToolPose, quaternion
from drivers.roles import LinkCounters

HEADER = struct.Struct(">H12s20sIIQQ")
EXTENDED = struct.Struct(">HHII")
MATRIX = struct.Struct(">12f")
TOOL = struct.Struct(">20sBB12f")
START = struct.Struct(">i32s")
PLAIN, WITH_EXTENDED = 1, 2
VERSIONS = (PLAIN, WITH_EXTENDED)
# 800 tools of TDATA; whatever is longer (images, meshes) is passed over without being kept.
LARGEST_BODY = 65_536
# The largest image of the standard's own test, 4 GB: a length above it is no length.
LARGEST_PASSED = 1 << 32
# What carries tools is kept whole: such a message with a longer body is a header put together from two torn ones.
WITH_TOOLS = (b"TRANSFORM", b"TDATA")
TRACKER_6D = 2
START_TDATA, STOP_TDATA, ANSWER_TDATA = "STT_TDATA", "STP_TDATA", "RTS_TDATA"
POLYNOMIAL = 0x42F0E1EBA9EA3693  # ECMA-182
MASK = (1 << 64) - 1


class TimedMessage(NamedTuple):
    """One message with a good checksum; ``sent_ns`` counts from 1970 and is 0 where the sender has no clock."""

    kind: str
    device: str
    sent_ns: int
    version: int
    content: bytes


def _shifted(byte: int) -> int:
    value = byte << 56
    for _ in range(8):
        value = (value << 1 ^ (POLYNOMIAL if value >> 63 else 0)) & MASK
    return value


_TABLE = tuple(_shifted(byte) for byte in range(256))


def crc64(data: bytes) -> int:
    """CRC-64/ECMA-182: initial value and final exclusive-or 0, not reflected; check value 0x6C40DF5F0B497347."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & MASK) ^ _TABLE[crc >> 56 ^ byte]
    return crc


def encode(
    kind: str, device: str, content: bytes = b"", sent_ns: int = 0, version: int = PLAIN, number: int = 0
) -> bytes:
    """One message; ``number`` is its id where the version has one."""
    body = content if version == PLAIN else EXTENDED.pack(EXTENDED.size, 2, 0, number) + content + b"\0\0"
    seconds, rest_ns = divmod(sent_ns, 1_000_000_000)
    fraction = (rest_ns << 32) // 1_000_000_000
    header = HEADER.pack(version, kind.encode(), device.encode(), seconds, fraction, len(body), crc64(body))
    return header + body


class MessageDecoder:
    """Holds less than one message of at most 64 KiB between calls, whatever comes, and never raises.

    Longer bodies are passed over. What is no header is discarded byte by byte until one begins.
    """

    def __init__(self, counters: LinkCounters) -> None:
        self._counters = counters
        self._rest = b""
        self._passing = 0

    @property
    def held(self) -> int:
        """Bytes kept for the next call."""
        return len(self._rest)

    def feed(self, data: bytes) -> list[TimedMessage]:
        """Messages completed by ``data``, oldest first."""
        self._rest += data
        return list(self._messages())

    def _messages(self) -> Iterator[TimedMessage]:
        while self._skip_to_header():
            fields = HEADER.unpack_from(self._rest)
            length, end = fields[5], HEADER.size + fields[5]
            if length > LARGEST_BODY:
                self._rest, self._passing = self._rest[HEADER.size :], length
            elif len(self._rest) < end:
                return
            elif crc64(self._rest[HEADER.size : end]) != fields[6]:
                self._counters.checksum_errors += 1
                self._discard(1)
            else:
                message = _message(fields, self._rest[HEADER.size : end])
                self._rest = self._rest[end:]
                if message:
                    yield message

    def _skip_to_header(self) -> bool:
        """Whether ``_rest`` begins with a whole header."""
        passed = min(self._passing, len(self._rest))
        self._rest, self._passing = self._rest[passed:], self._passing - passed
        wrong = 0
        while len(self._rest) - wrong >= HEADER.size and not _is_header(self._rest, wrong):
            wrong += 1
        self._discard(wrong)
        return len(self._rest) >= HEADER.size

    def _discard(self, count: int) -> None:
        self._counters.discarded_bytes += count
        self._rest = self._rest[count:]


def _is_header(data: bytes, at: int) -> bool:
    version, kind, _, _, _, length, _ = HEADER.unpack_from(data, at)
    name = kind.rstrip(b"\0")
    fits = length <= LARGEST_BODY if name in WITH_TOOLS else length < LARGEST_PASSED
    return version in VERSIONS and name.replace(b"_", b"").isalnum() and name.isupper() and fits


def _message(fields: tuple[int, bytes, bytes, int, int, int, int], body: bytes) -> TimedMessage | None:
    """None where the extended header does not fit its body."""
    version, kind, device, seconds, fraction, _, _ = fields
    if version == WITH_EXTENDED:
        if len(body) < EXTENDED.size:
            return None
        size, of_index, of_values, _ = EXTENDED.unpack_from(body)
        end = len(body) - of_index - of_values
        if not EXTENDED.size <= size <= end:
            return None
        body = body[size:end]
    sent_ns = seconds * 1_000_000_000 + (fraction * 1_000_000_000 >> 32)
    return TimedMessage(_text(kind), _text(device), sent_ns, version, body)


def _text(field: bytes) -> str:
    return field.partition(b"\0")[0].decode("latin-1").strip()


def tools_in(message: TimedMessage) -> dict[str, ToolPose | None]:
    """Tools of a TRANSFORM or TDATA message by name, None for what is no rotation; empty for other messages."""
    if message.kind == "TRANSFORM" and len(message.content) == MATRIX.size:
        return {message.device: _pose(MATRIX.unpack(message.content))}
    if message.kind == "TDATA" and not len(message.content) % TOOL.size:
        return {_text(name): _pose(matrix) for name, _, _, *matrix in TOOL.iter_unpack(message.content)}
    return {}


def _pose(matrix: Iterable[float]) -> ToolPose | None:
    *rotation, x_mm, y_mm, z_mm = matrix
    turned = quaternion(rotation)
    return None if turned is None else ToolPose(x_mm, y_mm, z_mm, *turned, math.nan)


def matrix_of(pose: ToolPose) -> tuple[float, ...]:
    """Columns of the rotation, then the place, as messages carry them."""
    w, x, y, z = pose.q0, pose.qx, pose.qy, pose.qz
    return (
        1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y),
        2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x),
        2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y),
        pose.x_mm, pose.y_mm, pose.z_mm,
    )  # fmt: skip


def encode_transform(pose: ToolPose) -> bytes:
    """Content of a TRANSFORM message."""
    return MATRIX.pack(*matrix_of(pose))


def encode_tools(tools: Iterable[tuple[str, ToolPose]]) -> bytes:
    """Content of a TDATA message."""
    return b"".join(TOOL.pack(name.encode(), TRACKER_6D, 0, *matrix_of(pose)) for name, pose in tools)


def encode_start(resolution_ms: int, coordinates: str = "") -> bytes:
    """Content of STT_TDATA: the shortest time between two frames that is wanted."""
    return START.pack(resolution_ms, coordinates.encode())


def decode_resolution_ms(content: bytes) -> int | None:
    """What STT_TDATA asks for; None where it is none."""
    return START.unpack(content)[0] if len(content) == START.size else None
