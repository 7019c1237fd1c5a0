"""A signal as clients asked for it; what is encoded for one of them is there for all."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from api.http.problems import RequestRefused
from api.http.streams.batch import LONGEST_NS, Decimation, columns_of, encoded, over, parts
from api.http.streams.history import LiveHistory, Rows
from api.http.streams.signals import LiveSignal

# Two seconds of the fastest loop twice over: a part of a second is never cut by it.
MOST_ROWS = 8192
# A channel's number has 16 bits; many fewer are asked for by any page.
MOST_VIEWS = 4096
MEMORY = 64


class Cut(NamedTuple):
    """A batch, the numbers of the first and last sample that it stands for, and where the next one begins."""

    first_seq: int
    last_seq: int
    data: bytes
    following: int


@dataclass(eq=False)
class View:
    """``signal`` at most ``rate_hz`` times a second (0: every sample), on ``channel``."""

    channel: int
    signal: LiveSignal
    rate_hz: float
    decimation: Decimation
    readers: int = 0
    _made: dict[tuple[LiveHistory, int, int, int], Cut | None] = field(default_factory=dict)

    @property
    def columns(self) -> list[str]:
        """Of its batches."""
        return columns_of(self.signal.fields, self.decimation)

    @property
    def width_ns(self) -> int:
        """Length of the parts of which each is one row; 0 where every sample is."""
        return round(1e9 / self.rate_hz) if self.rate_hz else 0

    def cut(self, history: LiveHistory, place: int, now_ns: int) -> Cut | None:
        """The batch from ``place`` on; None where there is nothing to send yet."""
        key = history, place, history.end, now_ns
        if key not in self._made:
            if len(self._made) >= MEMORY:
                self._made.clear()
            self._made[key] = self._cut(history.between(place, place + MOST_ROWS), place, now_ns)
        return self._made[key]

    def _cut(self, rows: Rows, place: int, now_ns: int) -> Cut | None:
        if not len(rows):
            return None
        count, broken = unbroken(rows, self.signal.step)
        rows = rows[:count]
        starts = parts(rows["time_ns"], self.width_ns)
        if not broken:
            starts, count = over(rows["time_ns"], starts, self.width_ns, now_ns)
        if not len(starts):
            return None
        rows = rows[:count]
        data = encoded(self.channel, rows, self.signal.fields, self.decimation, starts)
        return Cut(int(rows["seq"][0]), int(rows["seq"][-1]), data, place + count)


def unbroken(rows: Rows, step: int) -> tuple[int, bool]:
    """How many rows follow each other within what one batch can hold, and whether numbers are missing behind them."""
    far = np.flatnonzero(np.abs(rows["time_ns"] - rows["time_ns"][0]) >= LONGEST_NS)
    count = int(far[0]) if len(far) else len(rows)
    jumps = np.flatnonzero(np.diff(rows["seq"][:count]) != step)
    return (int(jumps[0]) + 1, True) if len(jumps) else (count, False)


class Views:
    """The views that somebody has asked for."""

    def __init__(self) -> None:
        self._views: dict[tuple[str, float, str], View] = {}
        self._last = 0

    def taken(self, signal: LiveSignal, rate_hz: float, decimation: Decimation) -> View:
        """The view with one reader more; raises RequestRefused where there are too many."""
        key = signal.name, rate_hz, decimation
        if key not in self._views:
            if len(self._views) >= MOST_VIEWS:
                text = f"{MOST_VIEWS} different views are asked for already; take max_rate_hz 30 as others do"
                raise RequestRefused(409, "too-many-views", text)
            used = {view.channel for view in self._views.values()}
            # Not the smallest that is free: a channel that has just ended means nothing else for a while.
            self._last = next(number for number in _from(self._last + 1) if number not in used)
            self._views[key] = View(self._last, signal, rate_hz, decimation)
        view = self._views[key]
        view.readers += 1
        return view

    def released(self, view: View) -> None:
        """One reader less."""
        view.readers -= 1
        if not view.readers:
            del self._views[view.signal.name, view.rate_hz, view.decimation]


def _from(first: int) -> Iterator[int]:
    """Numbers of channels, beginning with ``first`` and all around; 0 is none."""
    yield from range(first, 0x10000)
    yield from range(1, first)
