"""A look into the ring beside its one reader: neither the producer nor the recorder notices it.

The file is mapped for reading only, so nothing that happens here can hold up or harm the loop. What has been published
stays in its slot until the producer comes round again; whoever looks too late has missed it, and is told how much.
"""

import mmap
import os
from pathlib import Path
from typing import Self

import numpy as np

from rig.recording.ring import HEAD_BYTE, PAGE, opened, slots_of
from rig.recording.slots import SLOT, SLOT_TYPE, Slots


class RingTap:
    """Follows a ring from the oldest sample that is still there; ``missed`` counts those it came too late for."""

    def __init__(self, data: mmap.mmap, slots: int) -> None:
        self._data = data
        self._slots = np.frombuffer(data, SLOT_TYPE, slots, PAGE)
        self._word = np.frombuffer(data, "<i8", 1, HEAD_BYTE)
        self._mask = slots - 1
        self.position = self._oldest(self.head)
        self.missed = 0

    @classmethod
    def open(cls, path: Path) -> Self:
        """Looks into the ring at ``path``; raises UsageError where it is none."""
        fd = opened(path, os.O_RDONLY)
        try:
            slots = slots_of(fd, path)
            flags = mmap.MAP_SHARED | getattr(mmap, "MAP_POPULATE", 0)
            return cls(mmap.mmap(fd, PAGE + slots * SLOT, flags, mmap.PROT_READ), slots)
        finally:
            os.close(fd)

    @property
    def head(self) -> int:
        """Samples published so far."""
        return int(self._word[0])

    def take(self, limit: int) -> Slots:
        """Copies of up to ``limit`` slots not taken before, in the order they were published."""
        head = self.head
        first = max(self.position, self._oldest(head))
        numbers = np.arange(first, min(head, first + limit))
        found = self._slots[numbers & self._mask]
        # What the producer has come round to meanwhile may be half overwritten.
        whole = (found["number"] == numbers) & (numbers >= self._oldest(self.head))
        self.missed += first - self.position + int(np.count_nonzero(~whole))
        self.position = first + len(numbers)
        kept: Slots = found[whole]
        return kept

    def put_back(self, count: int) -> None:
        """The last ``count`` slots taken are taken again the next time."""
        self.position -= count

    def close(self) -> None:
        """Lets go of the ring."""
        del self._slots, self._word
        self._data.close()

    def _oldest(self, head: int) -> int:
        # The slot behind the head is the one that the producer may be writing now.
        return max(head - self._mask, 0)
