"""Routes of live samples and events."""

from typing import Annotated

from fastapi import APIRouter, Header, Query, Request, WebSocket
from fastapi.responses import StreamingResponse

from api.http.access.rights import ENTITLED, READ
from api.http.listing import Listing, listing
from api.http.problems import responses
from api.http.routes.common import PREFIX, PageQuery, Word
from api.http.streams import sse
from api.http.streams.latest import MOST_LATEST, LatestView
from api.http.streams.messages import StreamView
from api.http.streams.session import Streams
from api.http.streams.socket import serve, who
from api.http.streams.sse import EventAnswer

EventId = Annotated[
    str,
    Header(
        alias="Last-Event-ID", pattern=r"^$|^[0-9a-f]{32}-[0-9]{1,15}$", description="id of the last event that came"
    ),
]
Since = Annotated[int | None, Query(ge=0, le=2**53, description="number of the last event that came; 0: all there are")]


def build(streams: Streams) -> APIRouter:
    """`/stream`, `/streams`, the newest of one of them, and `/events`."""
    router = APIRouter(prefix=PREFIX)

    @router.websocket("/stream", dependencies=[READ])
    async def stream(socket: WebSocket) -> None:
        await serve(socket, streams)

    @router.get(
        "/streams", dependencies=[READ], summary="Live streams that `WS /stream` (subprotocol rig.v1) can be asked for"
    )
    async def listed(page: PageQuery, name: Word = "", topic: Word = "", unit: Word = "") -> Listing[StreamView]:
        place = {name: (f"{at:03}", "") for at, name in enumerate(streams.signals)}
        found = streams.listed()
        return listing("streams", found, page, lambda one: place[one.name], name=name, topic=topic, unit=unit)

    @router.get(
        "/streams/{stream}/latest",
        dependencies=[READ],
        summary="The newest samples of a stream; one that is not live says why, and gives none as if it were",
        responses=responses("404 no-such-stream"),
    )
    async def newest(stream: str, limit: Annotated[int, Query(ge=1, le=MOST_LATEST)] = 1) -> LatestView:
        return streams.latest(stream, limit)

    @router.get(
        "/events",
        dependencies=[READ],
        summary="What happens, as server-sent events; with Last-Event-ID what was missed comes first",
        response_class=StreamingResponse,
        responses={
            200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}},
            **responses("429 too-many-open"),
        },
    )
    async def events(request: Request, last_event_id: EventId = "", since: Since = None) -> EventAnswer:
        newest = streams.feed.events.last
        last = sse.after(streams.session_id, last_event_id) if last_event_id else newest if since is None else since
        told = sse.told(streams.feed, streams.session_id, min(last, newest), request.scope[ENTITLED])
        return EventAnswer(told, streams.connections, who(request))

    return router
