"""The ring between the loop and the recorder: one producer, one reader, one file mapped into both.

A file under /dev/shm, so that neither process can stall the other and either can die: what the producer has published
stays there for the reader, and the reader's place stays there for its successor.

Layout: one page of 64-bit words (below), then ``slots`` slots of 256 bytes: body, and in the last 12 bytes the slot's
ring number (u64), stream (u16) and length of the body (u16). The body is written first, then the slot's number, then
the head; a slot at or above the head is never looked at. 64-bit aligned stores reach the other process whole and in
order (x86-64; on a machine with weaker ordering the slot's number is the second check).
"""

import contextlib
import fcntl
import mmap
import os
import struct
import tempfile
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from rig.errors import DeviceError, UsageError
from rig.recording.slots import BODY_LIMIT, SLOT, SLOT_TYPE, TRAILER, Slots

SLOTS = 1 << 17
MAX_STREAMS = 64  # of which there are five; their counters stand in the header's page
PAGE = 4096
MAGIC = int.from_bytes(b"tissring", "little")

# Words of the header; head and tail stand on cache lines of their own.
_MAGIC, _SLOTS, _HEAD, _TAIL, _HEARTBEAT, _DROPPED = 0, 1, 8, 16, 24, 32
HEAD_BYTE = 8 * _HEAD


def new_path() -> Path:
    """Where a ring of this process belongs: memory where there is /dev/shm, else the folder for temporary files."""
    shared = Path("/dev/shm")
    folder = shared if shared.is_dir() else Path(tempfile.gettempdir())
    return folder / f"tissue-rig-{os.getuid()}-{os.getpid()}-{os.urandom(3).hex()}.ring"


def remove_abandoned() -> None:
    """Removes shared memory of this user's processes that were killed, rings only once nobody reads them."""
    for path in new_path().parent.glob(f"tissue-rig-{os.getuid()}-*-*"):
        pid = path.name.split("-")[3]
        if pid.isdigit() and not Path(f"/proc/{pid}").exists():
            with contextlib.suppress(OSError), path.open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                path.unlink()


class _Mapping:
    """The mapped file: the header as words, the slots as bytes."""

    def __init__(self, fd: int, size: int) -> None:
        # Pages are mapped now, so that the first round through the ring takes no page faults.
        flags = mmap.MAP_SHARED | (mmap.MAP_POPULATE if hasattr(mmap, "MAP_POPULATE") else 0)
        self.bytes = mmap.mmap(fd, size, flags)
        self._view = memoryview(self.bytes)
        self.words = self._view[:PAGE].cast("q")

    def close(self) -> None:
        self.words.release()
        self._view.release()
        self.bytes.close()


class RingWriter:
    """The producer's end. ``put`` never waits and never overwrites what has not been read."""

    def __init__(self, path: Path, mapping: _Mapping, slots: int) -> None:
        self.path = path
        self._mapping = mapping
        self._bytes, self._words = mapping.bytes, mapping.words
        self._slots, self._mask = slots, slots - 1
        self._head = self._words[_HEAD]
        self._tail = self._words[_TAIL]

    @classmethod
    def create(cls, path: Path, slots: int = SLOTS) -> Self:
        """A new, empty ring of ``slots`` slots (a power of two); raises DeviceError where there is no room for it."""
        if slots < 2 or slots & (slots - 1):
            raise ValueError(f"a ring has a power of two of slots, not {slots}")
        size = PAGE + slots * SLOT
        try:
            fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
        except OSError as error:
            raise DeviceError(f"{path}: the ring cannot be created: {error.strerror}") from error
        try:
            # Reserves the memory now: a hole that cannot be filled later would kill the loop with SIGBUS.
            os.posix_fallocate(fd, 0, size)
            mapping = _Mapping(fd, size)
        except OSError as error:
            path.unlink()
            raise DeviceError(
                f"{path}: no room for a ring of {size >> 20} MiB: {error.strerror}; free some shared memory"
            ) from error
        finally:
            os.close(fd)
        mapping.words[_SLOTS] = slots
        mapping.words[_MAGIC] = MAGIC
        return cls(path, mapping, slots)

    def put(self, stream_id: int, body: bytes) -> None:
        """Publishes one sample, or counts it as dropped where the ring is full.

        Raises ValueError for a body over 244 bytes or a stream number outside 0..63.
        """
        size = len(body)
        if size > BODY_LIMIT or not 0 <= stream_id < MAX_STREAMS:
            raise ValueError(f"stream {stream_id}, {size} bytes: a slot takes streams 0..63 and {BODY_LIMIT} bytes")
        head = self._head
        if head - self._tail >= self._slots:
            self._tail = self._words[_TAIL]
            if head - self._tail >= self._slots:
                self._words[_DROPPED + stream_id] += 1
                return
        at = PAGE + (head & self._mask) * SLOT
        self._bytes[at : at + size] = body
        TRAILER.pack_into(self._bytes, at + BODY_LIMIT, head, stream_id, size)
        self._head = self._words[_HEAD] = head + 1

    @property
    def head(self) -> int:
        """Samples published so far."""
        return self._head

    @property
    def fill(self) -> float:
        """Share of the ring the reader has not yet released, 0..1."""
        return (self._head - self._words[_TAIL]) / self._slots

    @property
    def dropped(self) -> dict[int, int]:
        """Samples dropped so far per stream that lost any."""
        return _dropped(self._words)

    def reader_age_ns(self, now_ns: int) -> int:
        """Time since the reader's last sign of life; ``now_ns`` itself where there has been none."""
        return now_ns - self._words[_HEARTBEAT]

    def close(self, unlink: bool = True) -> None:
        """Lets go of the ring, may be called twice; ``unlink`` removes the file, which an attached reader keeps."""
        self._mapping.close()
        if unlink:
            self.path.unlink(missing_ok=True)


class RingReader:
    """The reader's end; there can be only one at a time, and a new one goes on where the last one stopped."""

    def __init__(self, path: Path, fd: int, mapping: _Mapping, slots: int) -> None:
        self.path = path
        self._fd, self._mapping = fd, mapping
        self._bytes, self._words = mapping.bytes, mapping.words
        self._mask = slots - 1
        self._slots: NDArray[np.void] = np.frombuffer(mapping.bytes, f"V{SLOT}", slots, PAGE)
        self._next = self._words[_TAIL]
        self.damaged = 0

    @classmethod
    def open(cls, path: Path) -> Self:
        """Attaches to the ring at ``path``; raises UsageError where it is none or is being read by someone else."""
        fd = opened(path, os.O_RDWR)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            slots = slots_of(fd, path)
            return cls(path, fd, _Mapping(fd, PAGE + slots * SLOT), slots)
        except BlockingIOError as error:
            os.close(fd)
            raise UsageError(f"{path}: another recorder reads this ring; end it first") from error
        except UsageError:
            os.close(fd)
            raise

    def drain(self, limit: int, commit: bool = True) -> Slots:
        """Copies of up to ``limit`` slots not drained before, in the order they were published.

        With ``commit`` false the slots stay taken, and would be read again by a successor, until ``commit`` is called.
        A slot that does not carry its own number is left out and counted in ``damaged``.
        """
        numbers = np.arange(self._next, min(self._words[_HEAD], self._next + limit))
        found = self._slots[numbers & self._mask].view(SLOT_TYPE)  # field by field takes five times as long
        good = (found["number"] == numbers) & (found["size"] <= BODY_LIMIT)
        self._next += numbers.size
        self.damaged += int(numbers.size - np.count_nonzero(good))
        if commit:
            self.commit()
        kept: Slots = found if good.all() else found[good]
        return kept

    def commit(self) -> None:
        """Gives the slots drained so far back to the producer."""
        self._words[_TAIL] = self._next

    def touch(self, now_ns: int) -> None:
        """Leaves a sign of life for the producer."""
        self._words[_HEARTBEAT] = now_ns

    @property
    def head(self) -> int:
        """Samples published so far."""
        return self._words[_HEAD]

    @property
    def tail(self) -> int:
        """Number of the next sample a successor would read."""
        return self._words[_TAIL]

    @property
    def position(self) -> int:
        """Number of the next sample ``drain`` returns."""
        return self._next

    @property
    def dropped(self) -> dict[int, int]:
        """Samples dropped so far per stream that lost any."""
        return _dropped(self._words)

    def close(self) -> None:
        """Lets go of the ring, may be called twice; the file stays."""
        self._slots = self._slots[:0].copy()
        self._mapping.close()
        if self._fd >= 0:
            os.close(self._fd)
        self._fd = -1


def opened(path: Path, flags: int) -> int:
    """A descriptor of the ring at ``path``; raises UsageError where there is none."""
    try:
        return os.open(path, flags)
    except OSError as error:
        raise UsageError(f"{path}: no ring: {error.strerror}; start the loop first") from error


def slots_of(fd: int, path: Path) -> int:
    """Slots of the ring in the file; raises UsageError if it is none."""
    with contextlib.suppress(OSError, struct.error):
        magic, slots = struct.unpack("<qq", os.pread(fd, 16, 0))
        if magic == MAGIC and os.fstat(fd).st_size == PAGE + slots * SLOT:
            return int(slots)
    raise UsageError(f"{path}: not a ring of this program")


def _dropped(words: "memoryview[int]") -> dict[int, int]:
    return {stream_id: count for stream_id in range(MAX_STREAMS) if (count := words[_DROPPED + stream_id])}
