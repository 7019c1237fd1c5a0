"""One client's places in the histories: what is due to it, and what it has missed."""

from collections.abc import Iterator
from typing import Literal

from api.http.streams.batch import LATE_NS
from api.http.streams.history import LiveHistory
from api.http.streams.live_run import LiveRun
from api.http.streams.messages import Gap, RunBegun
from api.http.streams.views import Cut, View

# Batches beyond this begin another message: many clients take no more than a megabyte in one.
MESSAGE_BYTES = 200_000
Said = Gap | RunBegun | bytes
Begin = int | Literal["now", "oldest"]
Cause = Literal["slow", "expired", "source"]


class Subscription:
    """A place in the history of one view's signal: from ``now`` on, from the oldest, or after that sequence number."""

    def __init__(self, view: View, history: LiveHistory, buffer_s: float, begin: Begin) -> None:
        self.view = view
        # What is held back until its part of the clock is over is no backlog.
        self._buffer_ns = round(buffer_s * 1e9) + view.width_ns + LATE_NS
        self.go(history, begin)

    def go(self, history: LiveHistory, begin: Begin) -> None:
        """To a place in ``history``."""
        self._history = history
        self._last_seq = None if isinstance(begin, str) else begin
        self._place = _place(history, begin)
        self.catching_up = begin != "now"
        self._cause: Cause = "expired" if self.catching_up else "source"

    def due(self, now_ns: int) -> Iterator[Gap | bytes]:
        """The next batch if there is one, and before it what is missing in front of it."""
        self._leave_out()
        cut = self.view.cut(self._history, self._place, now_ns)
        if cut is None:
            self.catching_up = False
            return
        yield from self._gap(cut)
        self._place, self._last_seq = cut.following, cut.last_seq
        yield cut.data

    def _leave_out(self) -> None:
        history = self._history
        if self._place < history.start:
            self._place, self._cause = history.start, "expired" if self.catching_up else "slow"
        elif not self.catching_up and self._place < history.end:
            oldest_ns = history.time_ns(history.end - 1) - self._buffer_ns
            if history.time_ns(self._place) < oldest_ns:
                self._place, self._cause = history.after_ns(oldest_ns), "slow"

    def _gap(self, cut: Cut) -> Iterator[Gap]:
        signal = self.view.signal
        if self._last_seq is not None and cut.first_seq > self._last_seq + signal.step:
            first, last = self._last_seq + signal.step, cut.first_seq - signal.step
            yield Gap(
                channel=self.view.channel, stream=signal.name, first=first, last=last,
                dropped=(last - first) // signal.step + 1, cause=self._cause,
            )  # fmt: skip
        self._cause = "source"


class Subscriptions:
    """All of one client, by channel."""

    def __init__(self, run: LiveRun) -> None:
        self.run = run
        self._by_channel: dict[int, Subscription] = {}

    def add(self, view: View, buffer_s: float, begin: Begin) -> None:
        """One more."""
        history = self.run.histories[view.signal.source]
        self._by_channel[view.channel] = Subscription(view, history, buffer_s, begin)

    def remove(self, channel: int) -> View | None:
        """Its view; None where there was no such channel."""
        found = self._by_channel.pop(channel, None)
        return found.view if found else None

    @property
    def channels(self) -> list[int]:
        """Those that are open."""
        return list(self._by_channel)

    @property
    def catching_up(self) -> bool:
        """Whether one of them is still coming to the present."""
        return any(subscription.catching_up for subscription in self._by_channel.values())

    def due(self, newest: LiveRun, now_ns: int) -> Iterator[Said]:
        """Gaps, and behind them what is next in binary messages, mostly one; nothing where nothing is."""
        batches, sent = list[bytes](), False
        for subscription in list(self._by_channel.values()):
            for said in subscription.due(now_ns):
                if not isinstance(said, bytes):
                    yield said
                    continue
                batches.append(said)
                if sum(map(len, batches)) > MESSAGE_BYTES:
                    yield _joined(batches)
                sent = True
        if batches:
            yield _joined(batches)
        elif not sent and newest is not self.run:
            self._move(newest)
            yield RunBegun(run=newest.id)

    def _move(self, run: LiveRun) -> None:
        self.run = run
        for subscription in self._by_channel.values():
            subscription.go(run.histories[subscription.view.signal.source], "oldest")


def _joined(batches: list[bytes]) -> bytes:
    """One message of them, which are then gone."""
    message = b"".join(batches)
    batches.clear()
    return message


def _place(history: LiveHistory, begin: Begin) -> int:
    match begin:
        case "now":
            return history.end
        case "oldest":
            return history.start
        case seq:
            return history.after_seq(seq)
