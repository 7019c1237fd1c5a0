"""NatNet datagrams, bytes only: what is asked of Motive, what it says of itself, and a cursor over what it sends.

A datagram is a message number and a length, 16 bits each, little-endian, and that many bytes. Layouts: NatNet SDK 4.1,
its Python client, and packets of a NatNet 3 server.
"""

import struct
from typing import NamedTuple, TypeVar

CONNECT, SERVER_INFO, REQUEST, RESPONSE, REQUEST_MODELS, MODELS = range(6)
FRAME, KEEP_ALIVE, UNRECOGNISED = 7, 10, 100
ECHO_REQUEST, ECHO_RESPONSE = 12, 13
HEADER = struct.Struct("<HH")
# Name of the client, its version and the NatNet version that it speaks.
_SENDER = struct.Struct("<256s4B4B")
_SERVER = struct.Struct("<256s4B4BQ")
CLIENT = (b"tissue-rig", (0, 1, 0, 0), (4, 1, 0, 0))

Number = TypeVar("Number", int, float)
Version = tuple[int, int]


class BadPacket(ValueError):
    """A datagram ends too early, or says of itself what cannot be."""


class ServerInfo(NamedTuple):
    """Who streams; ``ticks_Hz`` is how its clock counts, 0 where it has none."""

    name: str
    version: str
    natnet: Version
    ticks_Hz: int


def encode_packet(message: int, payload: bytes = b"") -> bytes:
    """One datagram."""
    return HEADER.pack(message, len(payload)) + payload


def encode_connect() -> bytes:
    """Asks for the server's description, and in unicast for its frames."""
    name, version, natnet = CLIENT
    return encode_packet(CONNECT, _SENDER.pack(name, *version, *natnet))


def split(datagram: bytes) -> tuple[int, bytes]:
    """Message number and payload; raises BadPacket where the length is not that of the datagram."""
    if len(datagram) < HEADER.size:
        raise BadPacket("shorter than its header")
    message, size = HEADER.unpack_from(datagram)
    if size != len(datagram) - HEADER.size:
        raise BadPacket(f"{size} bytes claimed, {len(datagram) - HEADER.size} came")
    return message, datagram[HEADER.size :]


def decode_server(payload: bytes) -> ServerInfo:
    """What SERVER_INFO holds; raises BadPacket."""
    if len(payload) < _SERVER.size:
        raise BadPacket("server information is too short")
    name, *numbers = _SERVER.unpack_from(payload)
    version = ".".join(map(str, numbers[:4]))
    return ServerInfo(_text(name), version, (numbers[4], numbers[5]), numbers[8])


def _text(field: bytes) -> str:
    return field.partition(b"\0")[0].decode("utf-8", "replace")


class Cursor:
    """Reads a payload from its beginning; raises BadPacket at its end, so that no count can make it read for ever."""

    def __init__(self, payload: bytes) -> None:
        self._payload, self._at = payload, 0

    @property
    def left(self) -> int:
        """Bytes not yet read."""
        return len(self._payload) - self._at

    def take(self, layout: struct.Struct) -> tuple[float, ...]:
        """The next numbers."""
        if self.left < layout.size:
            raise BadPacket("it ends inside a number")
        values: tuple[float, ...] = layout.unpack_from(self._payload, self._at)
        self._at += layout.size
        return values

    def whole(self, layout: struct.Struct) -> int:
        """The next whole number."""
        return int(self.take(layout)[0])

    def skip(self, count: int) -> None:
        """Passes over bytes."""
        if not 0 <= count <= self.left:
            raise BadPacket("it ends inside what is passed over")
        self._at += count

    def count(self, least: int) -> int:
        """A count of things of ``least`` bytes each."""
        number = self.whole(_COUNT)
        if not 0 <= number * least <= self.left:
            raise BadPacket(f"{number} things do not fit into {self.left} bytes")
        return number

    def text(self) -> str:
        """Text up to a zero byte."""
        end = self._payload.find(b"\0", self._at)
        if end < 0:
            raise BadPacket("it ends inside a name")
        text = self._payload[self._at : end].decode("utf-8", "replace")
        self._at = end + 1
        return text


_COUNT = struct.Struct("<i")
