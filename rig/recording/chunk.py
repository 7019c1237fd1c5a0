"""One chunk of a recording taken apart: definitions, and messages as views of its bytes, without a look at each."""

import io
import struct
import zlib
from typing import NamedTuple, TypeVar

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from numpy.typing import NDArray

from rig.channels import CDR_HEADER
from rig.recording.mcap_layout import MESSAGE_HEAD

# No chunk of ours is larger; a damaged size must not be able to ask for all memory.
LARGEST_CHUNK = 1 << 26
RECORD = struct.Struct("<BQ")
_CDR = len(CDR_HEADER)
_BEGIN = "V11"  # of a message, opcode to channel
_AT_ONCE = 1024  # compared in 20 us: what mixes streams waits no longer for each message
# Of a chunk record: first and last log time, size and checksum of what is packed, length of the compression's name.
_HEAD = struct.Struct("<QQQII")
_ZSTD = b"zstd"
_unpacker = zstandard.ZstdDecompressor()

Record = TypeVar("Record", records.Schema, records.Channel, records.Metadata)
Bodies = NDArray[np.uint8]


class Definition(NamedTuple):
    """A channel as the file defines it."""

    topic: str
    schema: str


class Messages(NamedTuple):
    """Messages of one channel, alike in length, that follow each other: bodies without CDR header, shape (n, bytes)."""

    channel: int
    bodies: Bodies


class Chunk(NamedTuple):
    """Messages of one good chunk, in the order they were written."""

    definitions: dict[int, Definition]
    messages: list[Messages]


class BadRecord(Exception):
    """This record cannot be used; the text says why."""


def unpack(kind: type[Record], content: bytes) -> Record:
    """The record as the stock reader takes it apart."""
    try:
        unpacked: Record = kind.read(ReadDataStream(io.BytesIO(content)))
    except (struct.error, UnicodeDecodeError, EndOfFile) as error:
        raise BadRecord(f"{kind.__name__.lower()} that cannot be read") from error
    return unpacked


def take_apart(content: bytes) -> Chunk:
    """The chunk of this record; raises BadRecord where its checksum or its content is not right."""
    return _messages(_unpacked(content))


def _unpacked(content: bytes) -> bytes:
    try:
        *_, size, checksum, name = _HEAD.unpack_from(content)
    except struct.error as error:
        raise BadRecord("chunk that cannot be read") from error
    packed = memoryview(content)[_HEAD.size + name + 8 :]
    if content[_HEAD.size : _HEAD.size + name] != _ZSTD:
        raise BadRecord("chunk of an unknown compression")
    try:
        if not zstandard.frame_content_size(packed) == size <= LARGEST_CHUNK:
            raise BadRecord("chunk with a wrong size")
        data: bytes = _unpacker.decompress(packed, size)
    except zstandard.ZstdError as error:
        raise BadRecord("chunk that cannot be unpacked") from error
    if zlib.crc32(data) != checksum:
        raise BadRecord("chunk with a wrong checksum")
    return data


def _messages(data: bytes) -> Chunk:
    """Takes a chunk's content apart; its checksum was right, so only a foreign writer can make this fail."""
    schemas: dict[int, str] = {}
    chunk = Chunk({}, [])
    at = 0
    try:
        while at < len(data):
            opcode, size = RECORD.unpack_from(data, at)
            end = at + RECORD.size + size
            if opcode == Opcode.MESSAGE:
                end = _end_of_alike(data, at, end)
                chunk.messages.append(_unpack_messages(data, at, end, RECORD.size + size))
            else:
                _define(opcode, data[at + RECORD.size : end], schemas, chunk)
            at = end
    except (struct.error, TypeError, ValueError) as error:
        raise BadRecord("chunk with content this program does not know") from error
    return chunk


def _define(opcode: int, content: bytes, schemas: dict[int, str], chunk: Chunk) -> None:
    if opcode == Opcode.SCHEMA:
        schema = unpack(records.Schema, content)
        schemas[schema.id] = schema.data.decode()
    elif opcode == Opcode.CHANNEL:
        channel = unpack(records.Channel, content)
        chunk.definitions[channel.id] = Definition(channel.topic, schemas.get(channel.schema_id, ""))


def _end_of_alike(data: bytes, at: int, end: int) -> int:
    """Where the last of the messages ends that begin as the one from ``at`` to ``end`` does and follow it."""
    size, alike = end - at, np.ndarray((), _BEGIN, data, at)
    while end + size <= len(data):
        count = min((len(data) - end) // size, _AT_ONCE)
        differs = np.ndarray((count,), _BEGIN, data, end, (size,)) != alike
        first = int(differs.argmax())
        if differs[first]:
            return end + size * first
        end += size * count
    return end


def _unpack_messages(data: bytes, at: int, end: int, size: int) -> Messages:
    bodies = np.frombuffer(data, np.uint8, end - at, at).reshape(-1, size)[:, MESSAGE_HEAD.size + _CDR :]
    return Messages(MESSAGE_HEAD.unpack_from(data, at)[2], bodies)
