"""One client of `rig.v1`, without its socket: what it asks for, and what is due to it."""

import time
from collections.abc import Callable, Iterator, Mapping
from itertools import chain

from pydantic import ValidationError

import rig
from api.http.problems import RequestRefused
from api.http.streams.batch import Decimation
from api.http.streams.connections import OpenConnections
from api.http.streams.events import EventsLost, LiveEvent
from api.http.streams.feed import Feed
from api.http.streams.latest import LatestView, latest
from api.http.streams.messages import (
    CLIENT_MESSAGE,
    MOST_STREAMS,
    Alive,
    AskAlive,
    ChannelView,
    Gap,
    Hello,
    Misunderstood,
    RunBegun,
    StreamView,
    Subscribe,
    Subscribed,
    Unsubscribe,
    Unsubscribed,
)
from api.http.streams.signals import LiveSignal, signals
from api.http.streams.subscriptions import Begin, SharedTurn, Subscriptions
from api.http.streams.views import View, Views
from rig.config.wiring import Wiring

Spoken = Hello | Subscribed | Unsubscribed | Gap | RunBegun | Alive | Misunderstood | LiveEvent
# Said where nothing else was for this long, so that a client knows a quiet service from a hung one.
QUIET_NS = 200_000_000


class TooSlow(Exception):
    """The client is so far behind that events would be lost: it is to come back and resume."""


class Streams:
    """What all clients share: the feed, the signals of this bench, and the views of them."""

    def __init__(
        self, wiring: Wiring, feed: Feed, session_id: str, lost: Callable[[], Mapping[str, str]] = dict
    ) -> None:
        """``lost`` says by topic why a device is lost now."""
        self.feed, self.session_id, self._lost = feed, session_id, lost
        self.signals = signals(wiring)
        self.views, self.turn, self.connections = Views(), SharedTurn(), OpenConnections()

    def listed(self) -> list[StreamView]:
        """All that can be subscribed."""
        return [StreamView.model_validate(vars(one) | {"fields": list(one.fields)}) for one in self.signals.values()]

    def signal(self, name: str) -> LiveSignal:
        """The signal of that name; raises RequestRefused with all there are."""
        if name not in self.signals:
            text = f"no stream {name[:80]!r}; there are {', '.join(self.signals)}"
            raise RequestRefused(404, "no-such-stream", text)
        return self.signals[name]

    def latest(self, name: str, count: int) -> LatestView:
        """The newest samples of one of them; in the thread of the event loop, as the feed."""
        return latest(self.signal(name), self.feed.run, count, time.monotonic_ns(), self._lost())


class LiveClient:
    """State of one connection."""

    def __init__(self, streams: Streams) -> None:
        self._streams, self._feed = streams, streams.feed
        self._subscriptions = Subscriptions(streams.feed.run, streams.turn)
        self._event: int | None = None
        self._resuming = False
        self._spoke_ns = streams.feed.now_ns

    def hello(self) -> Hello:
        """The first message."""
        return Hello(
            software=f"tissue-rig {rig.__version__}", session_id=self._streams.session_id, run=self._feed.run.id,
            monotonic_ns=self._feed.now_ns, event_seq=self._feed.events.last, streams=self._streams.listed(),
        )  # fmt: skip

    def answer(self, text: str | None) -> Spoken:
        """To one message; what is due is asked for once this has been sent."""
        try:
            asked = CLIENT_MESSAGE.validate_json(text or "", strict=True)
            match asked:
                case Subscribe():
                    return self._subscribe(asked)
                case Unsubscribe():
                    return Unsubscribed(channels=self._end(asked.channels))
                case AskAlive():
                    return Alive(type="pong", id=asked.id, monotonic_ns=self._feed.now_ns)
        except ValidationError as error:
            wrong = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()[:3])
            return Misunderstood(code="invalid-message", detail=wrong)
        except RequestRefused as error:
            return Misunderstood(code=error.code, detail=str(error))

    def due(self) -> Iterator[Spoken | bytes]:
        """Everything that is to be sent now, events first; raises TooSlow where an event is not kept any more."""
        for said in chain(self._events(), self._subscriptions.due(self._feed.run, self._feed.now_ns)):
            self._spoke_ns = self._feed.now_ns
            yield said
        if self._feed.now_ns - self._spoke_ns >= QUIET_NS:
            self._spoke_ns = self._feed.now_ns
            yield Alive(type="ping", monotonic_ns=self._feed.now_ns)

    @property
    def catching_up(self) -> bool:
        """Whether there is more to be sent than what comes anew."""
        return self._subscriptions.catching_up

    def close(self) -> None:
        """Lets go of its views."""
        self._end(self._subscriptions.channels)

    def _subscribe(self, asked: Subscribe) -> Subscribed:
        wanted = [self._streams.signal(name) for name in dict.fromkeys(asked.streams)]
        if len(self._subscriptions.channels) + len(wanted) > MOST_STREAMS:
            raise RequestRefused(
                409, "too-many-channels", f"one connection takes {MOST_STREAMS} channels; end some first"
            )
        decimation, run = _decimation(asked), self._subscriptions.run
        channels = [_channel_view(self._begin(signal, decimation, asked)) for signal in wanted]
        self._listen(asked)
        resumed = (asked.run == run.id or not asked.since_seq) and (
            self._same_session(asked) or asked.since_event is None
        )
        return Subscribed(run=run.id, resumed=resumed, channels=channels)

    def _begin(self, signal: LiveSignal, decimation: Decimation, asked: Subscribe) -> View:
        view = self._streams.views.taken(signal, asked.max_rate_hz or 0.0, decimation)
        self._release(self._subscriptions.remove(view.channel))
        since = asked.since_seq.get(signal.name)
        known = asked.run == self._subscriptions.run.id
        begin: Begin = "now" if since is None else since if known else "oldest"
        self._subscriptions.add(view, asked.buffer_s, begin)
        return view

    def _same_session(self, asked: Subscribe) -> bool:
        return asked.session_id == self._streams.session_id

    def _listen(self, asked: Subscribe) -> None:
        if not asked.events:
            self._event = None
        elif asked.since_event is not None:
            newest = self._feed.events.last
            self._event, self._resuming = min(asked.since_event, newest) if self._same_session(asked) else 0, True
        elif self._event is None:
            self._event = self._feed.events.last

    def _events(self) -> Iterator[Gap | LiveEvent]:
        if self._event is None:
            return
        try:
            found = self._feed.events.after(self._event)
        except EventsLost as lost:
            if not self._resuming:
                raise TooSlow(str(lost)) from lost
            first, last = self._event + 1, lost.oldest - 1
            yield Gap(channel=0, stream="events", first=first, last=last, dropped=last - first + 1, cause="expired")
            self._event = last
            return
        self._resuming = False
        for event in found:
            yield event
            self._event = event.seq

    def _end(self, channels: list[int]) -> list[int]:
        ended = [(channel, self._subscriptions.remove(channel)) for channel in channels]
        for _, view in ended:
            self._release(view)
        return [channel for channel, view in ended if view]

    def _release(self, view: View | None) -> None:
        if view:
            self._streams.views.released(view)


def _decimation(asked: Subscribe) -> Decimation:
    """What is asked for by naming a rate or none."""
    if asked.max_rate_hz is None:
        if asked.decimate in ("last", "minmax"):
            raise RequestRefused(422, "no-rate", f"decimate {asked.decimate} needs max_rate_hz: rows a second at most")
        return "none"
    if asked.decimate == "none":
        raise RequestRefused(422, "rate", "decimate none sends every sample; leave max_rate_hz out, or take minmax")
    return asked.decimate or "minmax"


def _channel_view(view: View) -> ChannelView:
    return ChannelView(
        channel=view.channel, stream=view.signal.name, unit=view.signal.unit, decimate=view.decimation,
        max_rate_hz=view.rate_hz or None, columns=view.columns, step=view.signal.step,
    )  # fmt: skip
