"""The standard layout of MCAP (https://mcap.dev/spec), its chunks built by numpy instead of message by message.

Records that come once a file or once a chunk are the stock library's own; its reader is the judge of the whole.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping
from typing import IO, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from rig.channels import CDR_HEADER

MAGIC = b"\x89MCAP0\r\n"
# Down to half of the stock level's time: in numbers of eight bytes, matches under seven cost it and save nothing.
COMPRESSION = zstandard.ZstdCompressionParameters.from_level(-1, hash_log=10, min_match=7)
_STAMP = struct.Struct("<qqq")
# What stands in a chunk record before its data, which the stock library would copy twice more.
_CHUNK_HEAD = struct.Struct("<BQQQQII4sQ")
# Of a message record: opcode, length, channel, sequence, log time, publish time; the data come behind.
MESSAGE_HEAD = struct.Struct("<BQHIQQ")
_HEAD = [("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("seq", "<u4"), ("log", "<u8"), ("publish", "<u8")]


def schema_words(schema: str) -> Iterator[list[str]]:
    """Words of each line of a ``ros2msg`` text, type and name of a field in general, without comments."""
    return (words for line in schema.splitlines() if (words := line.split("#")[0].split()))


class _Messages(NamedTuple):
    """Message records of one channel: their bytes, and log time [ns] and offset of each, shape (n, 2)."""

    channel: int
    data: bytes | memoryview
    entries: NDArray[np.uint64]


def _of_rows(channel: int, rows: NDArray[np.void], offset: int) -> _Messages:
    head = np.zeros((), [*_HEAD, ("cdr", f"V{len(CDR_HEADER)}"), ("body", f"V{rows.itemsize}")])
    head["opcode"], head["length"], head["channel"] = int(Opcode.MESSAGE), head.itemsize - 9, channel
    head["cdr"] = np.void(CDR_HEADER)
    messages = np.repeat(head, rows.size)
    messages["seq"] = rows["seq"] & 0xFFFFFFFF
    # MCAP's own times are unsigned; the true ones are in the body.
    messages["log"], messages["publish"] = np.maximum(rows["arrival_ns"], 0), np.maximum(rows["capture_ns"], 0)
    # As so many bytes: field by field takes three times as long.
    messages["body"] = np.ascontiguousarray(rows).view(f"V{rows.itemsize}")
    offsets = offset + np.arange(rows.size, dtype=np.uint64) * messages.itemsize
    return _Messages(channel, messages.view(np.uint8).data, np.stack([messages["log"], offsets], axis=1))


def _of_body(channel: int, body: bytes, offset: int) -> _Messages:
    seq, capture_ns, arrival_ns = _STAMP.unpack_from(body)
    log, publish, size = max(arrival_ns, 0), max(capture_ns, 0), 22 + len(CDR_HEADER) + len(body)
    head = MESSAGE_HEAD.pack(int(Opcode.MESSAGE), size, channel, seq & 0xFFFFFFFF, log, publish)
    return _Messages(channel, head + CDR_HEADER + body, np.array([[log, offset]], np.uint64))


class McapLayout:
    """A file being laid out on ``output``, by its ``tell`` and ``write``; all channels stand in the first chunk."""

    def __init__(self, output: IO[bytes], library: str) -> None:
        self._output = output
        self._crc = 0
        self._packer = zstandard.ZstdCompressor(compression_params=COMPRESSION)
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._definitions = b""
        self._messages: list[_Messages] = []
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = {}
        self._span: tuple[int, int] | None = None
        self._put(MAGIC)
        self._put(_bytes([Header("ros2", library)]))

    def _put(self, *parts: bytes | memoryview) -> None:
        for data in parts:
            self._crc = zlib.crc32(data, self._crc)
            self._output.write(data)

    def register(self, topic: str, schema_name: str, schema: bytes) -> int:
        """Number of a new channel of CDR messages."""
        number = len(self._channels) + 1
        self._schemas.append(Schema(number, schema, "ros2msg", schema_name))
        self._channels.append(Channel(number, topic, "cdr", {}, number))
        self._definitions += _bytes([self._schemas[-1], self._channels[-1]])
        return number

    @property
    def pending(self) -> int:
        """Bytes of the chunk in progress."""
        return len(self._definitions) + sum(len(part.data) for part in self._messages)

    def add_rows(self, channel: int, rows: NDArray[np.void]) -> None:
        """Appends rows that begin with ``seq``, ``capture_ns`` and ``arrival_ns`` to the chunk."""
        self._messages.append(_of_rows(channel, rows, self.pending))

    def add_body(self, channel: int, body: bytes) -> None:
        """Appends one message of any length, which begins alike, to the chunk."""
        self._messages.append(_of_body(channel, body, self.pending))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Writes a metadata record."""
        data, at = _bytes([Metadata(name=name, metadata=dict(values))]), self._output.tell()
        self._put(data)
        self._metadata.append(MetadataIndex(offset=at, length=len(data), name=name))

    def end_chunk(self) -> None:
        """Writes the chunk in progress and its indexes; without messages does nothing."""
        if not self._messages:
            return
        parts = [self._definitions, *(part.data for part in self._messages)]
        data = parts[1] if len(parts) == 2 and not parts[0] else b"".join(parts)  # a copy takes half as long as packing
        first = min(int(part.entries[:, 0].min()) for part in self._messages)
        last = max(int(part.entries[:, 0].max()) for part in self._messages)
        packed, at = self._packer.compress(data), self._output.tell()
        size = _CHUNK_HEAD.size - 9 + len(packed)
        about = first, last, len(data), zlib.crc32(data), 4, b"zstd", len(packed)
        self._put(_CHUNK_HEAD.pack(int(Opcode.CHUNK), size, *about), packed)
        offsets, start = dict[int, int](), self._output.tell()
        for channel in dict.fromkeys(part.channel for part in self._messages):
            offsets[channel] = self._output.tell()
            self._put(*self._message_index(channel))
        length = self._output.tell() - start
        self._chunks.append(ChunkIndex(size + 9, at, "zstd", len(packed), last, length, offsets, first, len(data)))
        self._span = (min(first, self._span[0]), max(last, self._span[1])) if self._span else (first, last)
        self._definitions, self._messages = b"", []

    def _message_index(self, channel: int) -> tuple[bytes, memoryview]:
        index = np.concatenate([part.entries for part in self._messages if part.channel == channel], dtype="<u8")
        self._counts[channel] = self._counts.get(channel, 0) + len(index)
        size = index.nbytes
        return struct.pack("<BQHI", int(Opcode.MESSAGE_INDEX), 6 + size, channel, size), index.view(np.uint8).data

    def finish(self) -> None:
        """Writes what is pending, the summary and the footer."""
        self.end_chunk()
        self._output.write(_bytes([DataEnd(self._crc)]))
        start = self._output.tell()
        groups: list[tuple[Opcode, list[McapRecord]]] = [
            (Opcode.SCHEMA, [*self._schemas]),
            (Opcode.CHANNEL, [*self._channels]),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, [*self._chunks]),
            (Opcode.METADATA_INDEX, [*self._metadata]),
        ]
        summary, offsets = b"", list[McapRecord]()
        for opcode, records in groups:
            data = _bytes(records)
            offsets.append(SummaryOffset(group_opcode=opcode, group_start=start + len(summary), group_length=len(data)))
            summary += data
        offset_start = start + len(summary)
        summary += _bytes(offsets)
        head = struct.pack("<BQQQ", int(Opcode.FOOTER), 20, start, offset_start)
        crc = zlib.crc32(head, zlib.crc32(summary))
        self._output.write(summary + _bytes([Footer(start, offset_start, crc)]) + MAGIC)

    def _statistics(self) -> Statistics:
        first, last = self._span or (0, 0)
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=last,
            message_start_time=first,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )


def _bytes(records: list[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())
