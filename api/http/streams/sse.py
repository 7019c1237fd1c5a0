"""Events as server-sent events, for scripts and curl: a reader that comes back says which was its last."""

import time
from collections.abc import AsyncIterator, Callable

from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from api.http.access.rights import RECHECK_S
from api.http.streams.connections import OpenConnections
from api.http.streams.events import EventsLost
from api.http.streams.feed import Feed
from api.http.streams.messages import Gap

# A comment after this much silence, so that proxies and readers know that the line is there.
SILENCE_S = 5.0
RETRY_MS = 1000


class EventAnswer(StreamingResponse):
    """Events for as long as the reader stays; raises RequestRefused where as many look on as may."""

    def __init__(self, told: AsyncIterator[str], connections: OpenConnections, who: str) -> None:
        super().__init__(told, media_type="text/event-stream")
        self._connections, self._who = connections, who

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Counted from the first byte to the last, however it ends."""
        with self._connections.joined(self._who):
            await super().__call__(scope, receive, send)


def after(session_id: str, last_event_id: str) -> int:
    """Number of the event that a reader had last; 0, so that it gets all there are, where another service gave it."""
    session, _, number = last_event_id.rpartition("-")
    return int(number) if session == session_id else 0


async def told(feed: Feed, session_id: str, last: int, entitled: Callable[[], bool]) -> AsyncIterator[str]:
    """Every event after number ``last``, for as long as the reader stays and may; one too far behind is ended."""
    yield f"retry: {RETRY_MS}\n\n"
    try:
        feed.events.after(last)
    except EventsLost as lost:
        yield _gap(last + 1, lost.oldest - 1)
        last = lost.oldest - 1
    turn, now_s = feed.follower(), time.monotonic()
    spoke_s = checked_s = now_s
    while now_s - checked_s < RECHECK_S or entitled():
        if now_s - checked_s >= RECHECK_S:
            checked_s = now_s
        try:
            events = feed.events.after(last)
        except EventsLost:
            return
        for event in events:
            last = event.seq
            yield f"id: {session_id}-{last}\nevent: {event.source}\ndata: {event.model_dump_json()}\n\n"
        if events:
            spoke_s = now_s
        elif now_s - spoke_s >= SILENCE_S:
            spoke_s = now_s
            yield ": nothing new\n\n"
        await turn()
        now_s = time.monotonic()


def _gap(first: int, last: int) -> str:
    gap = Gap(channel=0, stream="events", first=first, last=last, dropped=last - first + 1, cause="expired")
    return f"event: gap\ndata: {gap.model_dump_json(by_alias=True)}\n\n"
