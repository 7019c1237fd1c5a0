"""Framing of NDI's combined API: commands out, replies in, both closed by CRC-16/ARC.

A command is ``NAME:params`` and four hex digits of checksum, or ``NAME params`` without one; CR ends it. A reply is
text, four hex digits and CR, or binary: start, length, checksum of both, body, checksum of the body, little-endian.
Sources: Polaris API guide IL-1070101 rev 5, Vega API guide IL-1070259 rev 2, ndicapi (MIT).
"""

import re
import struct
from typing import NamedTuple

from drivers.crc import crc16_arc

MAX_REPLY = 16384
"""Bytes of the longest reply taken for one: 24 tools of 20 markers and 240 strays stay below 10 kB."""

_SHORT = struct.Struct("<HHH")
_EXTENDED = struct.Struct("<HIH")
_HEADERS = {0xC4: _SHORT, 0xC8: _EXTENDED}
_START = re.compile(rb"[\xc4\xc8](?:\xa5|\Z)")
_TEXT = re.compile(rb"[\x20-\x7e\n]*")
_JUNK = re.compile(rb"[^\x20-\x7e\n\r\xc4\xc8]*")
_CR = 0x0D


class TextReply(NamedTuple):
    """A reply of text, its checksum proven and taken off."""

    text: str


class BinaryReply(NamedTuple):
    """The body of a binary reply, both its checksums proven and taken off."""

    body: bytes


Reply = TextReply | BinaryReply


def encode_command(name: str, params: str = "", crc: bool = True) -> bytes:
    """A command as it goes out; without ``crc`` in the form with a space, which the tracker does not check."""
    if not crc:
        return f"{name} {params}\r".encode("ascii")
    return encode_text(f"{name}:{params}")


def encode_text(text: str) -> bytes:
    """Text, checksum and CR."""
    data = text.encode("ascii")
    return data + f"{crc16_arc(data):04X}\r".encode("ascii")


def encode_binary(body: bytes, extended: bool = False) -> bytes:
    """A binary reply; the ``extended`` header has a length of four bytes instead of two."""
    header = struct.pack("<HI", 0xA5C8, len(body)) if extended else struct.pack("<HH", 0xA5C4, len(body))
    return header + crc16_arc(header).to_bytes(2, "little") + body + crc16_arc(body).to_bytes(2, "little")


class ReplyDecoder:
    """Cuts a stream of bytes into replies. It never raises and keeps at most one unfinished reply.

    What is no reply is dropped and counted: every byte fed ends in a reply, in ``discarded_bytes`` or in ``pending``.
    """

    def __init__(self) -> None:
        self.checksum_errors = 0
        self.discarded_bytes = 0
        self._buffer = bytearray()

    @property
    def pending(self) -> int:
        """Bytes of the unfinished reply."""
        return len(self._buffer)

    def reset(self) -> None:
        """Drops the unfinished reply: its rest will not come."""
        self.discarded_bytes += len(self._buffer)
        self._buffer.clear()

    def feed(self, data: bytes) -> list[Reply]:
        """Replies completed by ``data``, oldest first."""
        self._buffer += data
        replies: list[Reply] = []
        while self._buffer:
            header = _HEADERS.get(self._buffer[0])
            size, reply = self._binary(header) if header else self._text()
            if size == 0:
                break
            if reply is None:
                self.discarded_bytes += size
            else:
                replies.append(reply)
            del self._buffer[:size]
        return replies

    def _binary(self, header: struct.Struct) -> tuple[int, BinaryReply | None]:
        """Bytes used, and the reply if they were one; 0 bytes where more must come."""
        buffer = self._buffer
        if len(buffer) > 1 and buffer[1] != 0xA5:
            return 1, None
        if len(buffer) < header.size:
            return 0, None
        _, length, header_crc = header.unpack_from(buffer)
        if crc16_arc(bytes(buffer[: header.size - 2])) != header_crc:
            self.checksum_errors += 1
            return 2, None
        if length > MAX_REPLY:
            return 2, None
        end = header.size + length + 2
        if len(buffer) < end:
            return 0, None
        body = bytes(buffer[header.size : end - 2])
        if crc16_arc(body) != buffer[end - 2] | buffer[end - 1] << 8:
            self.checksum_errors += 1
            return self._next_start(end), None
        return end, BinaryReply(body)

    def _next_start(self, end: int) -> int:
        """Where a reply may start before ``end``: bytes lost on the line make a damaged one reach into the next."""
        start = _START.search(self._buffer, 2)
        return min(start.start(), end) if start else end

    def _text(self) -> tuple[int, TextReply | None]:
        """Like ``_binary``; bytes that cannot stand in a text reply end it."""
        buffer = self._buffer
        run = _end(_TEXT, buffer, 0)
        if run == len(buffer):
            return (run, None) if run > MAX_REPLY else (0, None)
        if buffer[run] != _CR:
            return _end(_JUNK, buffer, run), None
        text = bytes(buffer[: max(run - 4, 0)])
        if run >= 4 and f"{crc16_arc(text):04X}".encode("ascii") == buffer[run - 4 : run]:
            return run + 1, TextReply(text.decode("ascii"))
        self.checksum_errors += run >= 4
        return run + 1, None


def _end(pattern: re.Pattern[bytes], buffer: bytearray, start: int) -> int:
    match = pattern.match(buffer, start)
    return match.end() if match else start
