"""The client side of SDO transfers (CiA 301, 7.2.4): expedited and segmented, without any input or output.

A transfer offers ``request``, the 8 bytes to send now; ``feed`` takes each answer and moves on. It ends ``done``, with
``data`` for an upload, or with an ``abort`` code; ``garbled`` says that it was ours, because an answer made no sense.
Bytes that are not an answer to it are ignored and counted.
"""

import struct
from abc import ABC, abstractmethod

ABORT_TEXTS = {
    0x05030000: "toggle bit not alternated",
    0x05040000: "transfer timed out",
    0x05040001: "command unknown",
    0x06010000: "unsupported access to the object",
    0x06010001: "the object can only be written",
    0x06010002: "the object can only be read",
    0x06020000: "no such object",
    0x06040041: "the object cannot be mapped to this PDO",
    0x06040042: "the mapping exceeds the PDO's 8 bytes",
    0x06060000: "hardware error",
    0x06070010: "length does not match the object's type",
    0x06070013: "length too small",
    0x06090011: "no such sub-index",
    0x06090030: "value out of range",
    0x08000000: "general error",
    0x08000020: "data cannot be stored",
    0x08000022: "not possible in the present device state",
}
TOGGLE_ABORT = 0x05030000
COMMAND_ABORT = 0x05040001
# Ends an upload without an end after 586 segments, about a second; the longest object read, a name, has tens of bytes.
LONGEST = 4096


def encode_abort(index: int, sub: int, code: int) -> bytes:
    """The 8 bytes with which either side ends a transfer."""
    return struct.pack("<BHBI", 0x80, index, sub, code)


class Transfer(ABC):
    """What upload and download share: the object, the next request, how it ended."""

    def __init__(self, index: int, sub: int, request: bytes) -> None:
        self.index = index
        self.sub = sub
        self.request = request
        self.data = b""
        self.done = False
        self.abort: int | None = None
        self.garbled = False
        self.ignored = 0
        self._started = False
        self._toggle = 0

    @property
    def ended(self) -> bool:
        """Whether nothing more is to be sent."""
        return self.done or self.abort is not None

    def feed(self, answer: bytes) -> bool:
        """Takes the server's answer; True where ``request`` is new and is to be sent."""
        if self.ended or len(answer) != 8:
            self.ignored += 1
            return False
        command = answer[0]
        mine = struct.unpack_from("<HB", answer, 1) == (self.index, self.sub)
        if command == 0x80 and mine:
            self.abort = int(struct.unpack_from("<I", answer, 4)[0])
            return False
        if not self._started and not mine:
            self.ignored += 1
            return False
        return self._segment(answer) if self._started else self._start(answer)

    @abstractmethod
    def _start(self, answer: bytes) -> bool:
        """The answer to the first request."""

    @abstractmethod
    def _segment(self, answer: bytes) -> bool:
        """The answer to a request after that."""

    def _give_up(self, code: int) -> bool:
        self.abort = code
        self.garbled = True
        self.request = encode_abort(self.index, self.sub, code)
        return True

    def _finish(self) -> bool:
        self.done = True
        return False


class Upload(Transfer):
    """Reads an object."""

    def __init__(self, index: int, sub: int) -> None:
        super().__init__(index, sub, struct.pack("<BHB4x", 0x40, index, sub))

    def _start(self, answer: bytes) -> bool:
        command = answer[0]
        if command & 0xE0 != 0x40:
            return self._give_up(COMMAND_ABORT)
        if command & 0x02:
            self.data = answer[4 : 8 - (command >> 2 & 3 if command & 0x01 else 0)]
            return self._finish()
        return self._ask()

    def _ask(self) -> bool:
        self._started = True
        self.request = struct.pack("<B7x", 0x60 | self._toggle)
        return True

    def _segment(self, answer: bytes) -> bool:
        command = answer[0]
        if command & 0xE0 or len(self.data) > LONGEST:
            return self._give_up(COMMAND_ABORT)
        if command & 0x10 != self._toggle:
            return self._give_up(TOGGLE_ABORT)
        self.data += answer[1 : 8 - (command >> 1 & 7)]
        self._toggle ^= 0x10
        return self._finish() if command & 0x01 else self._ask()


class Download(Transfer):
    """Writes an object; ``data`` is what it was given."""

    def __init__(self, index: int, sub: int, data: bytes) -> None:
        size = len(data)
        self._segmented = not 0 < size <= 4
        if self._segmented:
            request = struct.pack("<BHBI", 0x21, index, sub, size)
        else:
            request = struct.pack("<BHB4s", 0x23 | (4 - size) << 2, index, sub, data)
        super().__init__(index, sub, request)
        self.data = data
        self._rest = data
        self._last = False

    def _start(self, answer: bytes) -> bool:
        if answer[0] != 0x60:
            return self._give_up(COMMAND_ABORT)
        return self._put() if self._segmented else self._finish()

    def _put(self) -> bool:
        self._started = True
        piece, self._rest = self._rest[:7], self._rest[7:]
        self._last = not self._rest
        self.request = struct.pack("<B7s", self._toggle | (7 - len(piece)) << 1 | self._last, piece)
        return True

    def _segment(self, answer: bytes) -> bool:
        if answer[0] & 0xE0 != 0x20:
            return self._give_up(COMMAND_ABORT)
        if answer[0] & 0x10 != self._toggle:
            return self._give_up(TOGGLE_ABORT)
        self._toggle ^= 0x10
        return self._finish() if self._last else self._put()
