"""What a recording file still holds, whatever happened to it: a pure walk over its bytes.

The stock reader stops at the first bad byte. This one keeps every chunk whose checksum is right and every metadata
record whose checksum is right, says where bytes could not be used, and finds its way back behind them. A chunk is taken
whole or not at all, so no row is ever a wrong row. Record layouts: MCAP specification, "Records".
"""

import io
import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, TypeVar

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from numpy.typing import NDArray

from rig.channels import CDR_HEADER
from rig.recording.mcap_file import CHECKSUM, checksum
from rig.recording.mcap_layout import MAGIC, MESSAGE_HEAD

# No chunk of ours is larger; a damaged size must not be able to ask for all memory.
LARGEST_CHUNK = 1 << 26
_RECORD = struct.Struct("<BQ")
_CDR = len(CDR_HEADER)
_AT_ONCE = 1024  # compared in 20 us: what mixes streams waits no longer for each message
_FOOTER_SIZE = 9 + 20 + len(MAGIC)
# Where a chunk (zstd) or a metadata record may begin.
_BEGIN = re.compile(rb"\x06.{3}[\0-\x0f]\0{4}.{28}\x04\0\0\0zstd|\x0c.{4}\0{4}[\x01-\x40]\0\0\0", re.DOTALL)

Record = TypeVar("Record", records.Chunk, records.Schema, records.Channel, records.Metadata)


class Definition(NamedTuple):
    """A channel as the file defines it."""

    topic: str
    schema: str


class Messages(NamedTuple):
    """Messages of one channel, alike in length, that follow each other: bodies without CDR header, shape (n, bytes)."""

    channel: int
    bodies: NDArray[np.uint8]


class Chunk(NamedTuple):
    """Messages of one good chunk, in the order they were written."""

    definitions: dict[int, Definition]
    messages: list[Messages]


@dataclass
class Scan:
    """What was found. ``cut`` is set where the file just ends; ``damage`` names every range that is bad."""

    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    chunks: list[Chunk] = field(default_factory=list)
    footer: bool = False
    cut: str = ""
    damage: list[str] = field(default_factory=list)


class _Bad(Exception):
    """This record cannot be used; the text says why."""


class _Record(NamedTuple):
    start: int
    end: int
    opcode: int
    content: bytes


def scan(data: bytes) -> Scan:
    """Everything good in ``data``; never raises on its content."""
    found = Scan()
    for record in _walk(data, found):
        try:
            _take(record, found)
        except _Bad as bad:
            found.damage.append(f"bytes {record.start}..{record.end}: {bad}: left out")
    _check_end(data, found)
    return found


def _walk(data: bytes, found: Scan) -> Iterator[_Record]:
    """Records of the data section in order, jumping over what is no record."""
    at = len(MAGIC) if data.startswith(MAGIC) else 0
    while at < len(data):
        record = _record(data, at) if at else None
        if record is None:
            following = _resume(data, at)
            _note_gap(data, at, following, found)
            at = following
            continue
        yield record
        if record.opcode == Opcode.DATA_END:
            found.footer = _has_footer(data)
            return
        at = record.end


def _record(data: bytes, at: int) -> _Record | None:
    """The record at ``at`` if it is of a kind our files have and as long as its own content says."""
    if at + 9 > len(data):
        return None
    opcode, size = _RECORD.unpack_from(data, at)
    start, end = at + 9, at + 9 + size
    if end > len(data) or not _fits(opcode, data, start, size):
        return None
    return _Record(at, end, opcode, data[start:end])


def _fits(opcode: int, data: bytes, start: int, size: int) -> bool:
    # A length that lies would make the walk skip good chunks; so each kind is checked against its own inner lengths.
    try:
        if opcode == Opcode.CHUNK:
            (name,) = struct.unpack_from("<I", data, start + 28)
            (inner,) = struct.unpack_from("<Q", data, start + 32 + name)
            return bool(size == 40 + name + inner)
        if opcode == Opcode.MESSAGE_INDEX:
            return bool(size == 6 + struct.unpack_from("<I", data, start + 2)[0])
        if opcode == Opcode.METADATA:
            (name,) = struct.unpack_from("<I", data, start)
            return bool(size == 8 + name + struct.unpack_from("<I", data, start + 4 + name)[0])
        if opcode == Opcode.HEADER:
            (profile,) = struct.unpack_from("<I", data, start)
            return bool(size == 8 + profile + struct.unpack_from("<I", data, start + 4 + profile)[0])
        return opcode == Opcode.DATA_END and size == 4
    except struct.error:
        return False


def _resume(data: bytes, at: int) -> int:
    """Where the next record begins whose checksum is right; the end of the file if there is none."""
    for match in _BEGIN.finditer(data, at):
        record = _record(data, match.start())
        if record is not None and _is_good(record):
            return record.start
    return len(data)


def _is_good(record: _Record) -> bool:
    try:
        _take(record, Scan())
    except _Bad:
        return False
    return True


def _note_gap(data: bytes, start: int, end: int, found: Scan) -> None:
    if end < len(data) or _has_footer(data) or not _is_cut(data, start):
        found.damage.append(f"bytes {start}..{end}: not readable as records: left out")
    else:
        found.cut = f"the file ends within a record that begins at byte {start}"


def _is_cut(data: bytes, at: int) -> bool:
    """Whether what stands at ``at`` is the beginning of a record (or of the magic) that the file ends within."""
    if at == 0:
        return MAGIC.startswith(data)
    known = data[at] in (Opcode.HEADER, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.METADATA, Opcode.DATA_END)
    return known and (at + 9 > len(data) or at + 9 + _RECORD.unpack_from(data, at)[1] > len(data))


def _take(record: _Record, found: Scan) -> None:
    if record.opcode == Opcode.CHUNK:
        found.chunks.append(_messages(_unpack_chunk(record.content)))
    elif record.opcode == Opcode.METADATA:
        name, values = _unpack_metadata(record.content)
        found.metadata[name] = values


def _unpack(kind: type[Record], content: bytes) -> Record:
    """The record as the stock reader takes it apart."""
    try:
        unpacked: Record = kind.read(ReadDataStream(io.BytesIO(content)))
    except (struct.error, UnicodeDecodeError, EndOfFile) as error:
        raise _Bad(f"{kind.__name__.lower()} that cannot be read") from error
    return unpacked


def _unpack_chunk(content: bytes) -> bytes:
    packed = _unpack(records.Chunk, content)
    if packed.compression != "zstd":
        raise _Bad("chunk of an unknown compression")
    try:
        if not zstandard.frame_content_size(packed.data) == packed.uncompressed_size <= LARGEST_CHUNK:
            raise _Bad("chunk with a wrong size")
        data = zstandard.decompress(packed.data, packed.uncompressed_size)
    except zstandard.ZstdError as error:
        raise _Bad("chunk that cannot be unpacked") from error
    if zlib.crc32(data) != packed.uncompressed_crc:
        raise _Bad("chunk with a wrong checksum")
    return data


def _messages(data: bytes) -> Chunk:
    """Takes a chunk's content apart; its checksum was right, so only a foreign writer can make this fail."""
    schemas: dict[int, str] = {}
    chunk = Chunk({}, [])
    at = 0
    try:
        while at < len(data):
            opcode, size = _RECORD.unpack_from(data, at)
            end = at + 9 + size
            if opcode == Opcode.MESSAGE:
                end = _end_of_alike(data, at, end)
                chunk.messages.append(_unpack_messages(data, at, end, 9 + size))
            elif opcode == Opcode.SCHEMA:
                schema = _unpack(records.Schema, data[at + 9 : end])
                schemas[schema.id] = schema.data.decode()
            elif opcode == Opcode.CHANNEL:
                channel = _unpack(records.Channel, data[at + 9 : end])
                chunk.definitions[channel.id] = Definition(channel.topic, schemas.get(channel.schema_id, ""))
            at = end
    except (struct.error, ValueError) as error:
        raise _Bad("chunk with content this program does not know") from error
    return chunk


def _end_of_alike(data: bytes, at: int, end: int) -> int:
    """Where the last of the messages ends that begin as the one from ``at`` to ``end`` does and follow it."""
    size = end - at
    # Eleven bytes, opcode to channel, as two numbers that overlap: byte by byte takes five times as long.
    beginning = np.dtype({"names": ["first", "last"], "formats": ["<u8", "<u4"], "offsets": [0, 7], "itemsize": size})
    (own,) = np.frombuffer(data, beginning, 1, at)
    while end + size <= len(data):
        count = min((len(data) - end) // size, _AT_ONCE)
        rows = np.frombuffer(data, beginning, count, end)
        others = np.flatnonzero((rows["first"] != own["first"]) | (rows["last"] != own["last"]))
        end += size * (int(others[0]) if others.size else count)
        if others.size:
            break
    return end


def _unpack_messages(data: bytes, at: int, end: int, size: int) -> Messages:
    bodies = np.frombuffer(data, np.uint8, end - at, at).reshape(-1, size)[:, MESSAGE_HEAD.size + _CDR :]
    return Messages(MESSAGE_HEAD.unpack_from(data, at)[2], bodies)


def _unpack_metadata(content: bytes) -> tuple[str, dict[str, str]]:
    found = _unpack(records.Metadata, content)
    if found.metadata.pop(CHECKSUM, "") != checksum(found.metadata.items()):
        raise _Bad(f"metadata {found.name!r} with a wrong checksum")
    return found.name, found.metadata


def _has_footer(data: bytes) -> bool:
    return data.endswith(MAGIC) and data[-_FOOTER_SIZE:].startswith(_RECORD.pack(Opcode.FOOTER, 20))


def _check_end(data: bytes, found: Scan) -> None:
    """The checksums over data section and summary section, which also cover what the walk has no use for."""
    if not _has_footer(data):
        if not found.cut and not found.damage:
            found.cut = f"the file ends at byte {len(data)} without its footer"
        return
    found.footer, whole = True, memoryview(data)
    start, _, expected = struct.unpack_from("<QQI", data, len(data) - _FOOTER_SIZE + 9)
    if not _FOOTER_SIZE + 13 <= start <= len(data) - _FOOTER_SIZE or zlib.crc32(whole[start:-12]) != expected:
        found.damage.append("the index at the end has a wrong checksum; a reader that trusts it may fail")
    elif not found.damage and _data_crc(data, start) != zlib.crc32(whole[: start - 13]):
        found.damage.append("the data section has a wrong checksum outside chunks and metadata; no sample is touched")


def _data_crc(data: bytes, summary_start: int) -> int:
    opcode, _, value = struct.unpack_from("<BQI", data, summary_start - 13)
    return int(value) if opcode == Opcode.DATA_END else -1
