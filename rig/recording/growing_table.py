"""Rows of one stream put together as they are read, each copied once to where it stays."""

import mmap

import numpy as np
from numpy.typing import NDArray

# A table that is full doubles: the system moves pages, not bytes, and a page that is not written to takes no memory.
GROWTH = 2
LEAST_BYTES = 1 << 18


class GrowingTable:
    """Rows of ``size`` bytes each."""

    def __init__(self, size: int) -> None:
        self._size, self._count = size, 0
        self._pages: mmap.mmap | None = None
        self._bytes = np.empty((0, size), np.uint8)

    def add(self, bodies: NDArray[np.uint8]) -> None:
        """Appends rows, shape (n, size), of any stride."""
        count = self._count + len(bodies)
        if count > len(self._bytes):
            self._grow(count)
        self._bytes[self._count : count] = bodies
        self._count = count

    def rows(self, dtype: "np.dtype[np.void]") -> NDArray[np.void]:
        """All of them, of this layout, as a table that cannot be changed."""
        table = self._bytes[: self._count].view(dtype)[:, 0]
        table.flags.writeable = False
        return table

    def _grow(self, count: int) -> None:
        room = max(GROWTH * self._bytes.nbytes, count * self._size, LEAST_BYTES)
        self._bytes = np.empty((0, self._size), np.uint8)  # pages that are looked at cannot be moved
        if self._pages is None:
            self._pages = mmap.mmap(-1, room, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        else:
            self._pages.resize(room)
        self._bytes = np.frombuffer(self._pages, np.uint8, room // self._size * self._size).reshape(-1, self._size)
