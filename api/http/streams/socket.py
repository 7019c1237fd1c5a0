"""A WebSocket of `rig.v1`: one task sends what is due, one takes what the client asks."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable

from starlette.requests import HTTPConnection
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketDisconnected

from api.http import problems
from api.http.access.limits import RateLimits
from api.http.access.rights import CALLER, ENTITLED, RECHECK_S
from api.http.access.scopes import Caller
from api.http.guard import POLICY
from api.http.problems import RequestRefused
from api.http.streams.connections import MESSAGES
from api.http.streams.messages import PROTOCOL
from api.http.streams.session import LiveClient, Spoken, Streams, TooSlow

# The client is to come back and resume: of the codes that are an application's own.
OVERFLOW = 4008
# Of the registered ones (RFC 6455, IANA): try again later.
LATER = 1013
TOO_OFTEN = f"more than {MESSAGES.per_s:g} messages a second came for a while; send fewer, and come back"
RIGHT_ENDED = "the right to look on has ended; log in, or take another token"


async def serve(socket: WebSocket, streams: Streams) -> None:
    """One connection, from its first to its last message."""
    if PROTOCOL not in socket.scope["subprotocols"]:
        text = f"this address speaks the WebSocket subprotocol {PROTOCOL}: ask for it when connecting"
        await socket.send_denial_response(problems.answer(400, "subprotocol", text))
        return
    await socket.accept(subprotocol=PROTOCOL)
    try:
        with streams.connections.joined(who(socket)):
            await _served(socket, streams)
    except RequestRefused as refused:
        await socket.close(LATER, str(refused))


def who(connection: HTTPConnection) -> str:
    """Whose connections are counted together."""
    caller: Caller | None = connection.scope.get(CALLER)
    return caller.key if caller else ""


async def _served(socket: WebSocket, streams: Streams) -> None:
    client = LiveClient(streams)
    # The second where the service itself has closed it meanwhile, because it ends.
    with contextlib.suppress(WebSocketDisconnect, WebSocketDisconnected), contextlib.closing(client):
        await _said(socket, client.hello())
        turn = asyncio.Lock()
        sending = _send(socket, client, turn, streams.feed.follower())
        try:
            await _first(sending, _take(socket, client, turn), _entitled(socket.scope[ENTITLED]))
        except PermissionError as ended:
            await socket.close(POLICY, str(ended))


async def _first(*parts: Awaitable[None]) -> None:
    """Until one of them ends; what it raised is raised here."""
    tasks = [asyncio.ensure_future(part) for part in parts]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        results = await asyncio.gather(*tasks, return_exceptions=True)
    for result in results:
        if isinstance(result, Exception):
            raise result


async def _send(socket: WebSocket, client: LiveClient, turn: asyncio.Lock, news: Callable[[], Awaitable[None]]) -> None:
    while True:
        sent = False
        async with turn:
            try:
                for said in client.due():
                    await _said(socket, said)
                    sent = True
            except TooSlow as lost:
                await socket.close(OVERFLOW, f"{lost}; come back with since_event")
                return
        if not (sent and client.catching_up):
            await news()


async def _take(socket: WebSocket, client: LiveClient, turn: asyncio.Lock) -> None:
    limits = RateLimits()
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            return
        if limits.wait_s("", MESSAGES):
            raise PermissionError(TOO_OFTEN)
        async with turn:  # nothing comes on a channel before the client has been told what it is
            await _said(socket, client.answer(message.get("text")))


async def _entitled(entitled: Callable[[], bool]) -> None:
    """For as long as they are; then raises PermissionError."""
    while entitled():
        await asyncio.sleep(RECHECK_S)
    raise PermissionError(RIGHT_ENDED)


async def _said(socket: WebSocket, said: Spoken | bytes) -> None:
    if isinstance(said, bytes):
        await socket.send_bytes(said)
    else:
        await socket.send_text(said.model_dump_json(by_alias=True, exclude_none=said.type in ("ping", "pong")))
