"""Cuts frames of one size out of a byte stream: the part that every streaming force sensor shares.

A frame is known by its first bytes and its checksum. Frame starts also occur inside frames, so only a good checksum
makes a frame; after a bad one the search goes on one byte later, and no good frame behind it is lost.
"""

from collections.abc import Callable
from typing import Generic, TypeVar

from drivers.roles import LinkCounters

Decoded = TypeVar("Decoded")


class FrameDecoder(Generic[Decoded]):
    """Holds less than one frame of bytes between calls, whatever comes, and never raises.

    ``is_good`` gets ``size`` bytes that begin with ``start`` and says whether their checksum is right; ``decode`` gets
    those that are good. A checksum error is counted where a frame was due, that is behind another one; every byte
    outside a good frame is counted as discarded. ``gaps``: bytes discarded before each frame of the last ``feed``.
    """

    def __init__(
        self, start: bytes, size: int, is_good: Callable[[bytes], bool], decode: Callable[[bytes], Decoded],
        counters: LinkCounters,
    ) -> None:  # fmt: skip
        self._start, self._size, self._counters = start, size, counters
        self._is_good, self._decode = is_good, decode
        self.gaps: list[int] = []
        self._gap = 0
        self._rest = b""
        self._due = -1

    @property
    def held(self) -> int:
        """Bytes kept for the next call; always less than ``size``."""
        return len(self._rest)

    def feed(self, data: bytes) -> list[Decoded]:
        """What the good frames completed by ``data`` say, oldest first."""
        buffer = self._rest + data
        frames = []
        self.gaps = []
        at = self._candidate(buffer, 0)
        while at + self._size <= len(buffer):
            frame = buffer[at : at + self._size]
            if self._is_good(frame):
                frames.append(frame)
                self.gaps.append(self._gap)
                self._gap = 0
                self._due = following = at + self._size
            else:
                self._miss(at)
                following = at + 1
            at = self._candidate(buffer, following)
        self._counters.frames += len(frames)
        self._rest = buffer[at:]
        self._due -= at
        return [self._decode(frame) for frame in frames]

    def _candidate(self, buffer: bytes, at: int) -> int:
        """Where the next frame may begin at or behind ``at``; what lies before is discarded."""
        found = buffer.find(self._start, at)
        if found < 0:
            found = len(buffer) - self._partial_start(buffer, at)
        self._discard(found - at)
        return found

    def _partial_start(self, buffer: bytes, at: int) -> int:
        tail = buffer[max(at, len(buffer) - len(self._start) + 1) :]
        return next((size for size in range(len(tail), 0, -1) if self._start.startswith(tail[-size:])), 0)

    def _miss(self, at: int) -> None:
        self._discard(1)
        if at == self._due:
            self._counters.checksum_errors += 1
            self._due += self._size

    def _discard(self, count: int) -> None:
        self._gap += count
        self._counters.discarded_bytes += count
