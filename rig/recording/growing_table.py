"""Rows of one stream put together as they are read; of a large table nearly all are copied once."""

import contextlib
import mmap

import numpy as np
from numpy.typing import NDArray

# A table that is full grows fourfold: a page that is not written to takes no memory. A large one has huge pages, filled
# in a quarter of the time, and the system moves them; many small ones would waste them, and are copied.
GROWTH = 4
LEAST_BYTES = 1 << 18
LARGE_BYTES = 1 << 22


class GrowingTable:
    """Rows of ``size`` bytes each."""

    def __init__(self, size: int) -> None:
        self._size, self._count, self._row = size, 0, f"V{size}"
        self._pages: mmap.mmap | None = None
        self._bytes = np.empty((0, size), np.uint8)

    def add(self, bodies: NDArray[np.uint8]) -> None:
        """Appends rows, shape (n, size), of any stride."""
        count = self._count + len(bodies)
        if count > len(self._bytes):
            self._grow(count)
        # As so many bytes: one by one takes twice as long.
        self._bytes[self._count : count].view(self._row)[:] = bodies.view(self._row)
        self._count = count

    def rows(self, dtype: "np.dtype[np.void]") -> NDArray[np.void]:
        """All of them, of this layout, as a table that cannot be changed."""
        table = self._bytes[: self._count].view(dtype)[:, 0]
        table.flags.writeable = False
        return table

    def _grow(self, count: int) -> None:
        room = max(GROWTH * self._bytes.nbytes, count * self._size, LEAST_BYTES)
        held = self._bytes[: self._count]
        if self._pages is not None and len(self._pages) >= LARGE_BYTES:
            held = self._bytes = held[:0].copy()  # pages that are looked at cannot be moved
            self._pages.resize(room)
        else:
            self._pages = mmap.mmap(-1, room, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
            with contextlib.suppress(AttributeError, OSError):  # a system without huge pages
                self._pages.madvise(mmap.MADV_HUGEPAGE)
        self._bytes = np.frombuffer(self._pages, np.uint8, room // self._size * self._size).reshape(-1, self._size)
        self._bytes[: len(held)] = held
