"""One recording: one MCAP file (https://mcap.dev/spec), in the standard layout that any MCAP reader opens.

A channel a stream, message encoding ``cdr`` with the ``ros2msg`` schema of ``rig.channels``; log time is arrival,
publish time is capture, the sequence is the low half of the sample's own number. Metadata stand at the start, so that
a prefix has them, and carry a checksum of their own, since MCAP checks only chunks. The record ``summary`` at the end
says that the recording was finished.
"""

import contextlib
import io
import json
import os
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.channels import Stream
from rig.errors import RigError, UsageError
from rig.input_streams import all_streams
from rig.recording.files import wait_for_disk
from rig.recording.mcap_layout import McapLayout

SUMMARY = "summary"
CHECKSUM = "crc32"
# Small pieces: on some kernels one large write stalls even processes of real-time priority.
PIECE = 65_536
CHUNK_SIZE = 1 << 20


class RecordingFailed(RigError):
    """The disk did not take the recording; what was written before stays and opens."""


def schema_name(stream: Stream) -> str:
    """Name of the stream's message type, as ROS 2 tools want it."""
    return f"tissue_rig/msg/{stream.name.capitalize()}"


def checksum(values: Iterable[tuple[str, str]]) -> str:
    """CRC-32 over the sorted pairs but the checksum's own, eight hexadecimal digits."""
    pairs = sorted((key, value) for key, value in values if key != CHECKSUM)
    return f"{zlib.crc32(json.dumps(pairs).encode()):08x}"


class RecordingWriter:
    """A recording being written. The first failure of the disk ends it; every later call repeats that cause."""

    def __init__(self, path: Path, metadata: Mapping[str, Mapping[str, str]]) -> None:
        """Creates ``path`` with its metadata on disk; raises UsageError if it exists, RecordingFailed on a bad disk."""
        self.path = path
        self._failure = ""
        self._batch = _Batch()
        self._fd = self._create()
        self._layout = McapLayout(self._batch, "tissue-rig")
        self.streams = {stream.id: stream for stream in all_streams(metadata)}
        self._channels = {stream.id: self._register(stream) for stream in self.streams.values()}
        self._bodies: dict[int, list[bytes]] = {}
        self._pending = 0
        for name, values in metadata.items():
            self._add_metadata(name, values)
        self._write_batch()
        self._sync()
        wait_for_disk(path.parent)

    def _create(self) -> int:
        try:
            return os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        except FileExistsError as error:
            raise UsageError(f"{self.path}: exists already and is not overwritten; give a new name") from error
        except OSError as error:
            raise RecordingFailed(f"{self.path}: cannot be created: {error.strerror}; check the folder") from error

    def _register(self, stream: Stream) -> int:
        return self._layout.register(stream.name, schema_name(stream), stream.schema().encode())

    def _add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        self._layout.add_metadata(name, {**values, CHECKSUM: checksum(values.items())})

    def add(self, stream_id: int, body: bytes) -> None:
        """Appends one sample, ``body`` as packed by its stream, or several of one without text, one behind the other.

        Nothing reaches the disk before ``flush``.
        """
        self._bodies.setdefault(stream_id, []).append(body)
        self._pending += len(body)
        if self._pending >= CHUNK_SIZE:
            self._end_chunk()

    def _end_chunk(self) -> None:
        for stream_id, bodies in self._bodies.items():
            self._lay_out(self.streams[stream_id], bodies)
        self._bodies, self._pending = {}, 0
        self._layout.end_chunk()

    def _lay_out(self, stream: Stream, bodies: list[bytes]) -> None:
        channel = self._channels[stream.id]
        if stream.has_text:
            for body in bodies:
                self._layout.add_body(channel, body)
        else:
            self._layout.add_rows(channel, np.frombuffer(b"".join(bodies), stream.dtype))

    def add_rows(self, stream: Stream, rows: NDArray[np.void]) -> None:
        """Appends ``rows`` of ``stream`` and hands them to the system."""
        count = CHUNK_SIZE // stream.dtype.itemsize
        for at in range(0, rows.size, count):
            self._layout.add_rows(self._channels[stream.id], rows[at : at + count])
            self.flush()

    def flush(self, sync: bool = False) -> None:
        """Closes the chunk in progress and hands it to the system; with ``sync`` waits until the disk has it."""
        self._end_chunk()
        self._write_batch()
        self._refuse_gone()
        if sync:
            self._sync()

    def finish(self, summary: Mapping[str, str]) -> None:
        """Writes ``summary``, index and footer and closes the file."""
        self._end_chunk()
        self._add_metadata(SUMMARY, summary)
        self._layout.finish()
        self._write_batch()
        self._refuse_gone()
        self._sync()
        self.close()

    def close(self) -> None:
        """Lets go of the file as it is; without ``finish`` it stays a prefix. May be called twice."""
        if self._fd >= 0:
            os.close(self._fd)
        self._fd = -1

    def _write_batch(self) -> None:
        if self._failure:
            raise RecordingFailed(self._failure)
        start, data = self._batch.take()
        try:
            view = memoryview(data)
            while view:
                view = view[os.write(self._fd, view[:PIECE]) :]
        except OSError as error:
            self._fail(start, error)

    def _sync(self) -> None:
        try:
            os.fdatasync(self._fd)
        except OSError as error:
            self._fail(self._batch.tell(), error)

    def _refuse_gone(self) -> None:
        """The system takes all that is written to a file that nobody can find again."""
        with contextlib.suppress(OSError):
            if os.path.samestat(self.path.stat(), os.fstat(self._fd)):
                return
        self._failure = (
            f"{self.path}: was removed or moved while it was recorded, and nothing more of it is; record into a new"
            " session, and leave its folder alone until that has ended"
        )
        self.close()
        raise RecordingFailed(self._failure)

    def _fail(self, good: int, error: OSError) -> None:
        """Cuts the file back to its last whole batch."""
        self._failure = (
            f"{self.path}: the disk took no more after {good} bytes: {error.strerror}; "
            "what was recorded before is kept; free some space and record again"
        )
        _cut(self._fd, good)
        self.close()
        raise RecordingFailed(self._failure) from error


def _cut(fd: int, size: int) -> None:
    """Cuts the open file to ``size`` bytes where the system still allows it; a ragged end can be read as well."""
    try:
        os.ftruncate(fd, size)
    except OSError:
        return


class _Batch(io.BytesIO):
    """What the stock writer produced since the last batch; its offsets go on through the whole file."""

    _start = 0

    def tell(self) -> int:
        return self._start + super().tell()

    def take(self) -> tuple[int, bytes]:
        """Offset and bytes of the batch, which begins anew."""
        start, data = self._start, self.getvalue()
        self.seek(0)
        self.truncate(0)
        self._start += len(data)
        return start, data
