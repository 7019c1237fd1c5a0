"""The Lawicel text protocol of CAN adapters (CAN232 manual v3, mac-can/SLCAN): pure, bounded, resynchronising.

A frame is one line that ends in CR: ``tiiildd..`` (11-bit identifier), ``Tiiiiiiiildd..`` (29-bit), ``r``/``R`` the
same as remote requests; a line feed, which some adapters send behind it, is passed over. The adapter answers a command
with CR, ``z`` CR or ``Z`` CR, or refuses it with BEL. Lines carry no checksum: a damaged digit that is still a digit
passes, which is why what matters is read back through SDO.
"""

import re
from binascii import hexlify, unhexlify
from collections import deque
from enum import IntFlag
from typing import NamedTuple

# Lawicel's longest line: letter, extended identifier, length, eight bytes in hexadecimal, time stamp.
LONGEST = 1 + 8 + 1 + 16 + 4
BITRATE_COMMANDS = {
    10_000: "S0",
    20_000: "S1",
    50_000: "S2",
    100_000: "S3",
    125_000: "S4",
    250_000: "S5",
    500_000: "S6",
    1_000_000: "S8",
}
"""Bit rates every adapter and python-can agree on; S7 means 800 kbit/s to the one and 750 to the other."""


FLAGS_LINE = re.compile(rb"F[0-9A-Fa-f]{2}")
_PLAIN, _EXTENDED = 0x800, 0x2000_0000  # identifiers have 11 or 29 bits (ISO 11898-1)
_KINDS = {b"t": (False, False), b"T": (True, False), b"r": (False, True), b"R": (True, True)}


class CanFrame(NamedTuple):
    """One classical CAN frame; ``data`` of a remote request is as many zeros as it asks for."""

    can_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False


def encode_frame(frame: CanFrame) -> bytes:
    """The line that sends ``frame``; raises ValueError where it is not a classical CAN frame."""
    can_id, data, extended, remote = frame
    if len(data) > 8 or not 0 <= can_id < (_EXTENDED if extended else _PLAIN):
        raise ValueError(f"not a classical CAN frame: identifier {can_id:#x}, {len(data)} bytes")
    digits = b"" if remote else hexlify(data).upper()
    if extended:
        return b"%c%08X%d%b\r" % (b"R" if remote else b"T", can_id, len(data), digits)
    return b"%c%03X%d%b\r" % (b"r" if remote else b"t", can_id, len(data), digits)


def decode_line(line: bytes) -> CanFrame | None:
    """The frame in a line without its CR; None where it is not one. A four-digit time stamp at the end is ignored."""
    extended, remote = _KINDS.get(line[:1], (False, False))
    head = 10 if extended else 5
    if len(line) < head or line[:1] not in _KINDS or not line.isalnum():
        return None
    try:
        can_id = int(line[1 : head - 1], 16)
        size = int(line[head - 1 : head])
        body = head if remote else head + 2 * size
        data = bytes(size) if remote else unhexlify(line[head:body])
        int(line[body:] or b"0", 16)
    except ValueError:
        return None
    if size > 8 or len(data) != size or len(line) - body not in (0, 4) or can_id >= (_EXTENDED if extended else _PLAIN):
        return None
    return CanFrame(can_id, data, extended, remote)


class Flags(IntFlag):
    """What an adapter says of its controller when it is asked by F: what has been since it was last asked."""

    RECEIVE_FULL = 0x01
    TRANSMIT_FULL = 0x02
    WARNING = 0x04
    OVERRUN = 0x08
    PASSIVE = 0x20
    ARBITRATION_LOST = 0x40
    BUS_ERROR = 0x80


def decode_flags(line: bytes) -> Flags | None:
    """The flags in a line without its CR; None where it holds none."""
    return Flags(int(line[1:], 16)) if FLAGS_LINE.fullmatch(line) else None


class SlcanDecoder:
    """What an adapter sends, in frames; never raises, holds at most one line, counts what it drops."""

    def __init__(self) -> None:
        self.frames = 0
        self.acknowledged = 0
        self.refused = 0
        self.malformed = 0
        self.discarded_bytes = 0
        self.replies: deque[bytes] = deque(maxlen=16)
        self._rest = b""
        self._skipping = False

    def feed(self, data: bytes) -> list[CanFrame]:
        """Frames completed by ``data``, oldest first."""
        if b"\n" in data:
            data = data.replace(b"\n", b"")
        if b"\a" in data:
            data = data.replace(b"\a", b"\a\r")
        *lines, rest = (self._rest + data).split(b"\r")
        frames = []
        for line in lines:
            frame = None if self._skipping else decode_line(line)
            if frame:
                frames.append(frame)
            else:
                self._other(line)
        self._hold(rest)
        self.frames += len(frames)
        return frames

    def _hold(self, rest: bytes) -> None:
        if len(rest) > LONGEST:
            self.discarded_bytes += len(rest)
            self._skipping = True
            rest = b""
        self._rest = rest

    def _other(self, line: bytes) -> None:
        """Everything that is not a frame: answers, refusals, garbage."""
        if self._skipping or len(line) > LONGEST:
            self._skipping = False
            self._drop(line)
        elif line in (b"", b"z", b"Z"):
            self.acknowledged += 1
        elif line == b"\a":
            self.refused += 1
        elif line[:1] in b"VvNF" and line.isalnum():
            self.replies.append(line)
        else:
            self._drop(line)

    def _drop(self, line: bytes) -> None:
        self.malformed += 1
        self.discarded_bytes += len(line)
