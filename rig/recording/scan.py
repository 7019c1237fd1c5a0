"""What a recording file still holds, whatever happened to it: a pure walk over its bytes.

The stock reader stops at the first bad byte. This one keeps every chunk whose checksum is right and every metadata
record whose checksum is right, says where bytes could not be used, and finds its way back behind them. A chunk is taken
whole or not at all, so no row is ever a wrong row. Record layouts: MCAP specification, "Records".
"""

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from mcap import records
from mcap.opcode import Opcode

from rig.recording.chunk import RECORD, BadRecord, Chunk, take_apart, unpack
from rig.recording.file_window import WINDOW, FileWindow
from rig.recording.mcap_file import CHECKSUM, checksum
from rig.recording.mcap_layout import MAGIC

_LONGEST_BEGIN = 45  # of what `_BEGIN` finds
_HEAD_BYTES = RECORD.size + 44  # a record's length, and those inside it for nearly all
_FOOTER_SIZE = 9 + 20 + len(MAGIC)
# Where a chunk (zstd) or a metadata record may begin.
_BEGIN = re.compile(rb"\x06.{3}[\0-\x0f]\0{4}.{28}\x04\0\0\0zstd|\x0c.{4}\0{4}[\x01-\x40]\0\0\0", re.DOTALL)

Source = bytes | FileWindow


@dataclass
class Scan:
    """What was found. ``cut`` is set where the file just ends; ``damage`` names every range that is bad."""

    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    chunks: list[Chunk] = field(default_factory=list)
    footer: bool = False
    cut: str = ""
    damage: list[str] = field(default_factory=list)


class _Record(NamedTuple):
    start: int
    end: int
    opcode: int
    content: bytes


def scan(data: Source) -> Scan:
    """Everything good in ``data``; never raises on its content."""
    found = Scan()
    found.chunks.extend(good_chunks(data, found))
    return found


def good_chunks(data: Source, found: Scan) -> Iterator[Chunk]:
    """The good chunks of ``data`` one after the other; ``found`` has all the rest once the last has been taken."""
    for record in _walk(data, found):
        try:
            chunk = _take(record, found)
        except BadRecord as bad:
            found.damage.append(f"bytes {record.start}..{record.end}: {bad}: left out")
            continue
        if chunk:
            yield chunk
    _check_end(data, found)


def _walk(data: Source, found: Scan) -> Iterator[_Record]:
    """Records of the data section in order, jumping over what is no record."""
    at = len(MAGIC) if data[: len(MAGIC)] == MAGIC else 0
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


def _record(data: Source, at: int) -> _Record | None:
    """The record at ``at`` if it is of a kind our files have and as long as its own content says."""
    head = data[at : at + _HEAD_BYTES]
    if len(head) < RECORD.size:
        return None
    opcode, size = RECORD.unpack_from(head)
    start, end = at + RECORD.size, at + RECORD.size + size
    if end > len(data) or size != _size_by_content(opcode, head[RECORD.size :], data, start):
        return None
    return _Record(at, end, opcode, data[start:end])


def _size_by_content(opcode: int, head: bytes, data: Source, start: int) -> int:
    """The length that a record's own inner lengths give: one that lies would make the walk skip good chunks."""
    if opcode == Opcode.CHUNK:
        name = _number(head, 28, 4)
        return 40 + name + (_number(head, 36, 8) if name == 4 else _number(data, start + 32 + name, 8))
    if opcode == Opcode.MESSAGE_INDEX:
        return 6 + _number(head, 2, 4)
    if opcode in (Opcode.METADATA, Opcode.HEADER):
        name = _number(head, 0, 4)
        return 8 + name + _number(data, start + 4 + name, 4)
    return 4 if opcode == Opcode.DATA_END else -1


def _number(data: Source, at: int, size: int) -> int:
    """An unsigned number; where the file ends within it, one that nothing is as long as."""
    digits = data[at : at + size]
    return int.from_bytes(digits, "little") if len(digits) == size else 1 << 64


def _resume(data: Source, at: int) -> int:
    """Where the next record begins whose checksum is right; the end of the file if there is none."""
    for start in _beginnings(data, at):
        record = _record(data, start)
        if record is not None and _is_good(record):
            return record.start
    return len(data)


def _beginnings(data: Source, at: int) -> Iterator[int]:
    """Where a chunk or a metadata record may begin, from ``at`` on."""
    while at < len(data):
        window = data[at : at + WINDOW + _LONGEST_BEGIN - 1]
        yield from (at + match.start() for match in _BEGIN.finditer(window) if match.start() < WINDOW)
        at += WINDOW


def _is_good(record: _Record) -> bool:
    try:
        _take(record, Scan())
    except BadRecord:
        return False
    return True


def _note_gap(data: Source, start: int, end: int, found: Scan) -> None:
    if end < len(data) or _has_footer(data) or not _is_cut(data, start):
        found.damage.append(f"bytes {start}..{end}: not readable as records: left out")
    else:
        found.cut = f"the file ends within a record that begins at byte {start}"


def _is_cut(data: Source, at: int) -> bool:
    """Whether what stands at ``at`` is the beginning of a record (or of the magic) that the file ends within."""
    if at == 0:
        return MAGIC.startswith(data[: len(MAGIC)]) and len(data) <= len(MAGIC)
    head = data[at : at + RECORD.size]
    known = not head or head[0] in (Opcode.HEADER, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.METADATA, Opcode.DATA_END)
    return known and (len(head) < RECORD.size or at + RECORD.size + RECORD.unpack(head)[1] > len(data))


def _take(record: _Record, found: Scan) -> Chunk | None:
    if record.opcode == Opcode.CHUNK:
        return take_apart(record.content)
    if record.opcode == Opcode.METADATA:
        name, values = _unpack_metadata(record.content)
        found.metadata[name] = values
    return None


def _unpack_metadata(content: bytes) -> tuple[str, dict[str, str]]:
    found = unpack(records.Metadata, content)
    if found.metadata.pop(CHECKSUM, "") != checksum(found.metadata.items()):
        raise BadRecord(f"metadata {found.name!r} with a wrong checksum")
    return found.name, found.metadata


def _has_footer(data: Source) -> bool:
    end = data[max(len(data) - _FOOTER_SIZE, 0) :]
    return end.endswith(MAGIC) and end.startswith(RECORD.pack(Opcode.FOOTER, 20))


def _check_end(data: Source, found: Scan) -> None:
    """The checksums over data section and summary section, which also cover what the walk has no use for."""
    if not _has_footer(data):
        if not found.cut and not found.damage:
            found.cut = f"the file ends at byte {len(data)} without its footer"
        return
    found.footer, size = True, len(data)
    start, _, expected = struct.unpack("<QQI", data[size - _FOOTER_SIZE + 9 : size - len(MAGIC)])
    if not _FOOTER_SIZE + 13 <= start <= size - _FOOTER_SIZE or _crc(data, start, size - 12) != expected:
        found.damage.append("the index at the end has a wrong checksum; a reader that trusts it may fail")
    elif not found.damage and _data_crc(data, start) != _crc(data, 0, start - 13):
        found.damage.append("the data section has a wrong checksum outside chunks and metadata; no sample is touched")


def _crc(data: Source, start: int, end: int) -> int:
    """CRC-32 of the bytes from ``start`` to ``end``."""
    checksum_so_far = 0
    for at in range(start, end, WINDOW):
        checksum_so_far = zlib.crc32(data[at : min(at + WINDOW, end)], checksum_so_far)
    return checksum_so_far


def _data_crc(data: Source, summary_start: int) -> int:
    opcode, _, value = struct.unpack("<BQI", data[summary_start - 13 : summary_start])
    return int(value) if opcode == Opcode.DATA_END else -1
