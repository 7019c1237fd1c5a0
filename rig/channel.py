"""The one channel between processes of this program: typed messages, each with an id, over a stream socket.

A frame is ``mark | length | id | type | check of the body | check of the header | body``, little-endian; the body is
JSON of the message's own fields. Who receives a frame that is damaged, too large or of no known meaning counts it,
answers its id with a refusal and reads on; damage costs at most the frame it is in and the one that follows.
Nothing here waits, and nothing here raises for what the other end has said.
"""

import binascii
import struct
import zlib
from collections import deque
from collections.abc import Iterable
from socket import AF_UNIX, SOCK_STREAM, socket, socketpair
from typing import ClassVar, NamedTuple

from pydantic import ValidationError

from rig.config.table import Table
from rig.errors import UsageError

MARK = b"\xa9rig"
_FIELDS = struct.Struct("<4sIIHI")
_CHECK = struct.Struct("<H")
HEADER_BYTES = _FIELDS.size + _CHECK.size
# Twice what a reference of 4,000 points, the longest that is taken, needs. To read as much costs the loop, at rest,
# about 20 ms, less than half of the 50 ms after which the drive misses its heartbeat.
MESSAGE_BYTES = 400_000
READ_BYTES = 65_536
# What one end may owe the other that does not read: incidents, answers and outcomes of an hour of short programs.
OUTBOX_MESSAGES = 256


class Message(Table):
    """What is said; ``TYPE`` tells its kind on the wire, and is given where a kind is declared, as ``kind``."""

    TYPE: ClassVar[int]

    def __init_subclass__(cls, kind: int | None = None) -> None:
        if kind is not None:
            cls.TYPE = kind


class Reply(Message):
    """A message that answers the message with id ``to``."""

    to: int


class Answer(Reply, kind=1):
    """Done, or not done because of ``refused``; ``stopped``: because a stop is in force."""

    refused: str = ""
    stopped: bool = False


class Frame(NamedTuple):
    """One frame; ``refused`` says why its body is not there."""

    id: int
    type: int
    body: bytes
    refused: str = ""


class Received(NamedTuple):
    """A message and the id under which it can be answered."""

    id: int
    message: Message


def encode(number: int, kind: int, body: bytes) -> bytes:
    """One frame."""
    header = _FIELDS.pack(MARK, len(body), number, kind, zlib.crc32(body))
    return header + _CHECK.pack(binascii.crc_hqx(header, 0)) + body


class Parser:
    """Bytes to frames. Frames larger than ``limit_bytes`` are passed over; ``damaged`` counts what was no frame."""

    def __init__(self, limit_bytes: int = MESSAGE_BYTES) -> None:
        self._limit_bytes = limit_bytes
        self._buffer = bytearray()
        self._to_skip = 0
        self.damaged = 0

    def feed(self, data: bytes) -> list[Frame]:
        """Frames that ``data`` completes, in order."""
        skipped = min(self._to_skip, len(data))
        self._to_skip -= skipped
        self._buffer += memoryview(data)[skipped:]
        frames = []
        while (frame := self._next()) is not None:
            frames.append(frame)
        return frames

    def _next(self) -> Frame | None:
        while self._align():
            _, length, number, kind, check = _FIELDS.unpack_from(self._buffer)
            if length > self._limit_bytes:
                self._drop(HEADER_BYTES + length)
                return Frame(number, kind, b"", f"a message of {length} bytes is above the {self._limit_bytes} allowed")
            if len(self._buffer) < HEADER_BYTES + length:
                return None
            body = bytes(self._buffer[HEADER_BYTES : HEADER_BYTES + length])
            if zlib.crc32(body) == check:
                self._drop(HEADER_BYTES + length)
                return Frame(number, kind, body)
            # Where bytes are missing from the body, the next frame begins within what was taken for it.
            self._damage(len(MARK))
        return None

    def _align(self) -> bool:
        """Brings a whole, sound header to the front; False where none is there yet."""
        while len(self._buffer) >= HEADER_BYTES:
            if self._buffer.startswith(MARK) and self._sound():
                return True
            at = self._buffer.find(MARK, 1)
            self._damage(at if at > 0 else len(self._buffer) - len(MARK) + 1)
        return False

    def _sound(self) -> bool:
        (check,) = _CHECK.unpack_from(self._buffer, _FIELDS.size)
        return bool(binascii.crc_hqx(self._buffer[: _FIELDS.size], 0) == check)

    def _damage(self, size: int) -> None:
        self.damaged += 1
        del self._buffer[:size]

    def _drop(self, size: int) -> None:
        self._to_skip = max(size - len(self._buffer), 0)
        del self._buffer[:size]


class Outbox:
    """Bytes on their way out. Every message is kept, but of ``put_newest`` only the one put last."""

    def __init__(self) -> None:
        self._waiting: deque[bytes] = deque()
        self._newest = b""
        self._going = memoryview(b"")
        self.dropped = 0

    def put(self, frame: bytes) -> bool:
        """Keeps ``frame`` until it has gone; False, and counted, where too many wait already."""
        if len(self._waiting) >= OUTBOX_MESSAGES:
            self.dropped += 1
            return False
        self._waiting.append(frame)
        return True

    def put_newest(self, frame: bytes) -> None:
        """Keeps ``frame`` until it has gone or a newer one is put."""
        self._newest = frame

    def due(self) -> memoryview:
        """What is to be written next; empty when nothing is."""
        if not self._going:
            if self._waiting:
                self._going = memoryview(self._waiting.popleft())
            else:
                self._going, self._newest = memoryview(self._newest), b""
        return self._going

    def written(self, size: int) -> None:
        """``size`` bytes of what was due have gone."""
        self._going = self._going[size:]


class Channel:
    """One end; takes messages of the types ``understood``. Not for two threads at once.

    ``refused`` counts what was not understood, ``dropped`` what could not be sent, and ``lost`` says that the other
    end is gone.
    """

    def __init__(self, end: socket, understood: Iterable[type[Message]], limit_bytes: int = MESSAGE_BYTES) -> None:
        end.setblocking(False)
        self._socket = end
        types: tuple[type[Message], ...] = (Answer, *understood)
        self._types = {kind.TYPE: kind for kind in types}
        self._parser = Parser(limit_bytes)
        self._limit_bytes = limit_bytes
        self._frames: deque[Frame] = deque()
        self._outbox = Outbox()
        self._last_id = 0
        self._refused = self._unsent = 0
        self.lost = False

    @property
    def refused(self) -> int:
        """Messages and pieces of what came that were not understood."""
        return self._refused + self._parser.damaged

    @property
    def dropped(self) -> int:
        """Messages that could not be sent: too large, not to be written down, or too many before them."""
        return self._unsent + self._outbox.dropped

    def fileno(self) -> int:
        """Descriptor to wait on."""
        return self._socket.fileno()

    def send(self, message: Message) -> int:
        """Queues ``message`` and writes what the other end takes now; its id, 0 where it was dropped."""
        number = self._following_id()
        frame = self._framed(number, message)
        kept = bool(frame) and self._outbox.put(frame)
        self.flush()
        return number if kept else 0

    def send_newest(self, message: Message) -> None:
        """As ``send``, for what is only shown: takes the place of one sent this way that has not gone yet."""
        frame = self._framed(self._following_id(), message)
        if frame:
            self._outbox.put_newest(frame)
        self.flush()

    def flush(self) -> bool:
        """Writes what the other end takes now; True when nothing is left."""
        while due := self._outbox.due():
            try:
                self._outbox.written(self._socket.send(due))
            except BlockingIOError:
                return False
            except OSError:
                self.lost = True
                return False
        return True

    def receive(self) -> Received | None:
        """The next message, after at most one read and one frame; None where there is none, or it was refused."""
        if not self._frames:
            self._read()
        return self._opened(self._frames.popleft()) if self._frames else None

    def receive_all(self) -> list[Received]:
        """All messages that one read completes."""
        self._read()
        opened = [self._opened(frame) for frame in self._frames]
        self._frames.clear()
        return [received for received in opened if received]

    def close(self) -> None:
        """Closes this end; may be called twice."""
        self.lost = True
        self._socket.close()

    def _following_id(self) -> int:
        self._last_id = self._last_id % 0xFFFF_FFFF + 1
        return self._last_id

    def _framed(self, number: int, message: Message) -> bytes:
        try:
            body = message.model_dump_json().encode()
        except ValueError:  # text that UTF-8 cannot hold
            body = b""
        if not 0 < len(body) <= self._limit_bytes:
            self._unsent += 1
            return b""
        return encode(number, message.TYPE, body)

    def _read(self) -> None:
        try:
            data = self._socket.recv(READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        self.lost = self.lost or not data
        self._frames.extend(self._parser.feed(data))

    def _opened(self, frame: Frame) -> Received | None:
        message, reason = self._understood(frame)
        if message is not None:
            return Received(frame.id, message)
        self._refused += 1
        # An answer is not answered, or two ends that misunderstand each other never end.
        if not issubclass(self._types.get(frame.type, Message), Reply):
            self.send(Answer(to=frame.id, refused=reason))
        return None

    def _understood(self, frame: Frame) -> tuple[Message | None, str]:
        kind = self._types.get(frame.type)
        if frame.refused or kind is None:
            return None, frame.refused or f"messages of type {frame.type} are not known here"
        try:
            return kind.model_validate_json(frame.body, strict=True), ""
        except ValidationError as error:
            first = error.errors(include_url=False, include_context=False, include_input=False)[0]
            place = ".".join(map(str, first["loc"]))
            return None, f"a message of type {kind.__name__} is not understood: {place}: {first['msg']}"


def refuse_oversized(message: Message, what: str, limit_bytes: int = MESSAGE_BYTES) -> None:
    """Raises UsageError where ``message``, called ``what``, is larger than a channel takes."""
    size = len(message.model_dump_json().encode())
    if size > limit_bytes:
        raise UsageError(
            f"{what} takes {size} bytes as a message, and one may have {limit_bytes}; give its reference fewer points"
        )


def pair() -> tuple[socket, socket]:
    """Two connected ends."""
    return socketpair(AF_UNIX, SOCK_STREAM)
