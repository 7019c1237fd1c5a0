"""One client's places in the histories: what is due to it, and what it has missed."""

from collections.abc import Iterable, Iterator
from typing import Literal, NamedTuple

from api.http.streams.batch import LATE_NS
from api.http.streams.history import LiveHistory
from api.http.streams.live_run import LiveRun
from api.http.streams.messages import Gap, RunBegun
from api.http.streams.views import Cut, View

# Batches beyond this begin another message: many clients take no more than a megabyte in one.
MESSAGE_BYTES = 200_000
Due = list[Gap | bytes]
Begin = int | Literal["now", "oldest"]
Cause = Literal["slow", "expired", "source"]


class Subscription(NamedTuple):
    """A place in the history of one view's signal; how far it may lag, and why what is missing next is missing."""

    view: View
    history: LiveHistory
    buffer_ns: int
    place: int
    last_seq: int | None
    catching_up: bool
    cause: Cause

    @classmethod
    def begun(cls, view: View, history: LiveHistory, buffer_s: float, begin: Begin) -> "Subscription":
        """From ``now`` on, from the oldest, or after that sequence number."""
        # What is held back until its part of the clock is over is no backlog.
        buffer_ns = round(buffer_s * 1e9) + view.width_ns + LATE_NS
        return cls(view, history, buffer_ns, 0, None, False, "source").moved(history, begin)

    def moved(self, history: LiveHistory, begin: Begin) -> "Subscription":
        """To a place in ``history``."""
        last_seq = None if isinstance(begin, str) else begin
        at = self._replace(history=history, place=_place(history, begin), last_seq=last_seq)
        return at._replace(catching_up=begin != "now", cause="source" if begin == "now" else "expired")

    def due(self, now_ns: int) -> tuple[Due, "Subscription"]:
        """The next batch if there is one, before it what is missing in front of it; and where to go on."""
        at = self._left_out()
        cut = at.view.cut(at.history, at.place, now_ns)
        if cut is None:
            return [], at._replace(catching_up=False)
        return [*at.gap(cut), cut.data], at._replace(place=cut.following, last_seq=cut.last_seq, cause="source")

    def _left_out(self) -> "Subscription":
        history = self.history
        if self.place < history.start:
            return self._replace(place=history.start, cause="expired" if self.catching_up else "slow")
        oldest_ns = history.time_ns(history.end - 1) - self.buffer_ns
        if not self.catching_up and self.place < history.end and history.time_ns(self.place) < oldest_ns:
            return self._replace(place=history.after_ns(oldest_ns), cause="slow")
        return self

    def gap(self, cut: Cut) -> Iterator[Gap]:
        """What is missing in front of it, if anything is."""
        channel, signal = self.view.channel, self.view.signal
        last = cut.first_seq - signal.step
        if self.last_seq is not None and last > self.last_seq:
            first, count = self.last_seq + signal.step, (last - self.last_seq) // signal.step
            yield Gap(channel=channel, stream=signal.name, first=first, last=last, dropped=count, cause=self.cause)


class SharedTurn:
    """What is due in one turn of the feed: made once for all clients that stand at the same places, as most do."""

    def __init__(self) -> None:
        self._now_ns = 0
        self._made: dict[tuple[Subscription, ...], tuple[Due, tuple[Subscription, ...]]] = {}

    def due(self, at: tuple[Subscription, ...], now_ns: int) -> tuple[Due, tuple[Subscription, ...]]:
        """Gaps, and behind them what is next in binary messages, mostly one; and where to go on."""
        if now_ns != self._now_ns:
            self._now_ns, self._made = now_ns, {}
        if at not in self._made:
            parts = [subscription.due(now_ns) for subscription in at]
            self._made[at] = list(_joined(said for part, _ in parts for said in part)), tuple(then for _, then in parts)
        return self._made[at]


class Subscriptions:
    """All of one client, a channel each."""

    def __init__(self, run: LiveRun, shared: SharedTurn) -> None:
        self.run, self._shared = run, shared
        self._open: tuple[Subscription, ...] = ()

    def add(self, view: View, buffer_s: float, begin: Begin) -> None:
        """One more."""
        self._open += (Subscription.begun(view, self.run.histories[view.signal.source], buffer_s, begin),)

    def remove(self, channel: int) -> View | None:
        """Its view; None where there was no such channel."""
        found = next((one.view for one in self._open if one.view.channel == channel), None)
        self._open = tuple(one for one in self._open if one.view is not found)
        return found

    @property
    def channels(self) -> list[int]:
        """Those that are open."""
        return [subscription.view.channel for subscription in self._open]

    @property
    def catching_up(self) -> bool:
        """Whether one of them is still coming to the present."""
        return any(subscription.catching_up for subscription in self._open)

    def due(self, newest: LiveRun, now_ns: int) -> Iterator[Gap | RunBegun | bytes]:
        """What comes next; where nothing does, and another run has begun, that."""
        said, self._open = self._shared.due(self._open, now_ns)
        yield from said
        if not said and newest is not self.run:
            self.run = newest
            self._open = tuple(one.moved(newest.histories[one.view.signal.source], "oldest") for one in self._open)
            yield RunBegun(run=newest.id)


def _joined(parts: Iterable[Gap | bytes]) -> Iterator[Gap | bytes]:
    """Gaps at once, each before its own batch; batches in as few messages as clients take."""
    joined = b""
    for part in parts:
        if isinstance(part, Gap):
            yield part
        elif len(joined := joined + part) > MESSAGE_BYTES:
            yield joined
            joined = b""
    if joined:
        yield joined


def _place(history: LiveHistory, begin: Begin) -> int:
    if isinstance(begin, int):
        return history.after_seq(begin)
    return history.end if begin == "now" else history.start
