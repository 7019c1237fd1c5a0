"""The bytes of a file by slices, of which one window at a time is in memory: an hour's tables leave no room for it."""

import os
from pathlib import Path
from typing import Self

# Ten chunks of the recorder. Of a larger one the memory comes from the system each time, and leaves the cache.
WINDOW = 1 << 19


class FileWindow:
    """Like ``bytes`` for slices that go forwards; the file may grow, but ends where it ended when this was opened."""

    def __init__(self, path: Path) -> None:
        self._fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        self._size = os.fstat(self._fd).st_size
        self._start, self._held = 0, b""

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, wanted: slice) -> bytes:
        start, end, _ = wanted.indices(self._size)
        at = start - self._start
        if at < 0 or end - self._start > len(self._held):
            self._start, at = start, 0
            self._held = self._read(start, max(end - start, WINDOW))
        return self._held[at : max(end - self._start, at)]

    def _read(self, start: int, count: int) -> bytes:
        """Fewer where the file was cut meanwhile."""
        pieces = []
        while count and (piece := os.pread(self._fd, count, start)):
            pieces.append(piece)
            start, count = start + len(piece), count - len(piece)
        return b"".join(pieces)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._fd)
