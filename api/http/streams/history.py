"""The last minute of one source, shared by all clients: each has a place in it and nothing of its own."""

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

KEPT_S = 60.0
# Devices are a little faster than they say: the Bota gives up to 1010 of 1000 samples a second.
SPARE = 1.1
Rows = NDArray[np.void]


def row_type(fields: Sequence[str]) -> np.dtype[np.void]:
    """Sequence number, time and the float32 ``fields`` of a row."""
    return np.dtype([("seq", "<i8"), ("time_ns", "<i8"), *((name, "<f4") for name in fields)])


class LiveHistory:
    """Rows by their place, counted from the first ever; at least the last 60 s of them."""

    def __init__(self, fields: Sequence[str], rate_Hz: float, kept_s: float = KEPT_S) -> None:
        self.period_ns = round(1e9 / rate_Hz) if rate_Hz else 0
        self._room = max(round(kept_s * rate_Hz * SPARE), 1)
        # Written once, so that the memory is taken now and not over the first minute.
        self._rows = np.full(self._room, 0, row_type(fields))
        self.end = 0

    @property
    def dtype(self) -> np.dtype[np.void]:
        """Of its rows."""
        return self._rows.dtype

    @property
    def start(self) -> int:
        """Place of the oldest row that is kept."""
        return max(self.end - self._room, 0)

    def add(self, rows: Rows) -> None:
        """Newer rows, in their order."""
        rows = rows[-self._room :] if len(rows) > self._room else rows
        places = np.arange(self.end, self.end + len(rows)) % self._room
        self._rows[places] = rows
        self.end += len(rows)

    def between(self, first: int, last: int) -> Rows:
        """Copies of the rows from place ``first`` to before ``last``."""
        return self._rows[np.arange(max(first, self.start), min(last, self.end)) % self._room]

    def time_ns(self, place: int) -> int:
        """When the row at ``place`` was taken."""
        return int(self._rows["time_ns"][place % self._room])

    def after_seq(self, seq: int) -> int:
        """Place of the first row with a number above ``seq``."""
        return self._after("seq", seq)

    def after_ns(self, time_ns: int) -> int:
        """Place of the first row taken after ``time_ns``."""
        return self._after("time_ns", time_ns)

    def _after(self, field: str, value: int) -> int:
        column, places = self._rows[field], range(self.start, self.end)
        return self.start + bisect_right(places, value, key=lambda place: int(column[place % self._room]))
