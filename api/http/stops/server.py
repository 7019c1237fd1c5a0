"""Stops from other computers: ``python -m api.http.stops.server SETTINGS_JSON LISTENER_FD...``.

Beside the stop process of the bench's own computer, which it shares nothing with but the stop word, and there it has a
lane of its own: whatever clients do here, that one goes on. Under the service's certificate::

    POST /estop, /pain, /stop   200 {"id", "kind", "confirmed": true, "done": what the loop did, "after_ms"}
                                504 {..., "confirmed": false, "done": "NOT CONFIRMED: use the hardware stop"}

Any right will do, of a token or of a login, and on this computer itself none is asked for. Neither is the service: it
may hang. A page of the service sends a simple request, without preflight (Fetch standard, 4.9); its cookie is not of
a port. What is to be done is in the head: a body is never read. Standard output beats, standard input ends with the
service, and with it this process.
"""

import asyncio
import contextlib
import os
import signal
import socket
import ssl
import sys
import time
from collections.abc import AsyncIterator
from http import HTTPStatus
from pathlib import Path

from api.http.access.access import Access, cookie_name
from api.http.access.arrived import Arrived
from api.http.access.scopes import Caller
from api.http.access.served_at import HTTPS, bracketed, tls_context
from api.http.access.store import PrivateFile
from api.http.stops.known import AwaySettings, Known
from controller.stop import http
from controller.stop.http import HttpRequest, Refusal
from controller.stop.server import CONFIRM_S, CONNECTIONS, LINGER_BYTES, LINGER_S, ROUTES, StopSaid
from controller.stop.word import LOOK_S, NOT_CONFIRMED, Lane, Requester, StopReason, StopWord
from rig.apart import stand_back
from rig.errors import RigError

# A handshake and a head take a few round trips, 0.2 s each around the world; the rest is patience.
CONNECTION_S = 5.0
BEAT_S = 0.25
# Until another connection has ended, where this process has no descriptor left for one.
PAUSE_S = 0.05
Answer = StopSaid | dict[str, str]
Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]


class AwayServer:
    """Serves whoever comes to ``listeners``, in one thread; ``accept`` is to be run once for each of them."""

    def __init__(self, settings: AwaySettings, tls: ssl.SSLContext | None) -> None:
        self._settings, self._tls = settings, tls
        self._access = Access(settings.access)
        self._known = PrivateFile(settings.known, Known())
        self._page: StopWord | None = None
        self._requester: Requester | None = None
        self._open: dict[asyncio.Task[None], None] = {}
        self._idle: dict[asyncio.Task[None], None] = {}

    async def accept(self, listener: socket.socket) -> None:
        """For ever."""
        listener.setblocking(False)
        while True:
            try:
                client, _ = await asyncio.get_running_loop().sock_accept(listener)
            except OSError:
                await asyncio.sleep(PAUSE_S)
                continue
            self._admit(client)
            await asyncio.sleep(0)

    def _admit(self, client: socket.socket) -> None:
        """Where all places are taken, whoever has had one longest without asking for a stop leaves."""
        if len(self._open) >= CONNECTIONS:
            leaving = next(iter(self._idle or self._open))
            self._forget(leaving)
            leaving.cancel()
        task = asyncio.create_task(self._serve(client))
        self._open[task] = self._idle[task] = None
        task.add_done_callback(self._forget)
        task.add_done_callback(lambda _: client.close())

    def _forget(self, task: "asyncio.Task[None]") -> None:
        self._open.pop(task, None)
        self._idle.pop(task, None)

    async def _serve(self, client: socket.socket) -> None:
        with contextlib.suppress(OSError, EOFError):  # TimeoutError and what TLS raises are among them
            async with asyncio.timeout(CONNECTION_S), _streams(client, self._tls) as (reader, writer):
                request = await _heard(reader)
                if isinstance(request, Refusal):
                    writer.write(_response(*_no(request), ""))
                else:
                    writer.write(await self._answer(self._arrived(request, writer)))
                await writer.drain()
                if isinstance(request, Refusal) or not request.keep:
                    await _linger(reader)

    def _arrived(self, request: HttpRequest, writer: asyncio.StreamWriter) -> Arrived:
        own, peer = (writer.get_extra_info(name)[0] for name in ("sockname", "peername"))
        port = self._settings.service_port
        return Arrived(request.method, request.path, request.headers, "https", own, port, peer, owner=False)

    async def _answer(self, arrived: Arrived) -> bytes:
        origin = arrived.headers.get("origin", "")
        try:
            status, body = await self._done(arrived)
        except RigError as error:
            status, body = _no(Refusal(HTTPStatus.SERVICE_UNAVAILABLE, f"{NOT_CONFIRMED} ({error})"))
        return _response(status, body, origin if origin.lower() == self._page_at(arrived.host) else "")

    async def _done(self, arrived: Arrived) -> tuple[HTTPStatus, Answer]:
        here = arrived.local and self._tls is not None  # a proxy on this computer speaks for others
        caller = None if here else self._caller(arrived)
        refused = self._foreign(arrived) or (None if here else _unentitled(arrived, caller)) or _unknown(arrived)
        if refused:
            return _no(refused)
        self._idle.pop(_this_task(), None)
        status, said = await self._stopped(ROUTES[arrived.path])
        self._access.audit.add(caller, f"POST {arrived.path} beside the service", f"{status.value} {said['done']}")
        return status, said

    def _caller(self, arrived: Arrived) -> Caller | None:
        self._access.logins.browsers.restore(self._known.read().logins)
        return self._access.caller(arrived.headers, cookie_name(arrived.port), owner=False)

    def _foreign(self, arrived: Arrived) -> Refusal | None:
        """Of another site's page, or sent by another name."""
        origin = arrived.headers.get("origin")
        if not arrived.known_as(self._settings.names):
            return Refusal(HTTPStatus.FORBIDDEN, f"the host name {arrived.host[:80]} is not this service's")
        if origin is not None and origin.lower() != self._page_at(arrived.host):
            return Refusal(HTTPStatus.FORBIDDEN, f"a page of {origin[:80]} may not stop this bench")
        return None

    def _page_at(self, host: str) -> str:
        port = self._settings.page_port
        return f"https://{bracketed(host)}" + ("" if port == HTTPS else f":{port}")

    async def _stopped(self, kind: StopReason) -> tuple[HTTPStatus, StopSaid]:
        requester, began_s = self._asking(), time.monotonic()
        request = requester.request(kind)
        while (answer := requester.answer(request)) is None and time.monotonic() < began_s + CONFIRM_S:
            await asyncio.sleep(LOOK_S)
        confirmed = answer is not None and answer.confirmed
        why = answer.text if answer else "the loop does not answer"
        return HTTPStatus.OK if confirmed else HTTPStatus.GATEWAY_TIMEOUT, {
            "id": request.id,
            "kind": kind.name.lower(),
            "confirmed": confirmed,
            "done": why if confirmed else f"{NOT_CONFIRMED} ({why})",
            "after_ms": round((time.monotonic() - began_s) * 1e3, 2),
        }

    def _asking(self) -> Requester:
        """Its lane of the bench that runs now; raises DeviceError where there is none."""
        path = Path(self._known.read().page)
        if self._requester is None or self._page is None or self._page.path != path:
            before, self._page = self._page, StopWord.open(path)
            self._requester = Requester(self._page, Lane.AWAY)
            if before:
                before.close()
        return self._requester


@contextlib.asynccontextmanager
async def _streams(client: socket.socket, tls: ssl.SSLContext | None) -> AsyncIterator[Streams]:
    """What ``client`` says, once its handshake is done; closed in order, or at once where it does not let us."""
    loop = asyncio.get_running_loop()
    client.setblocking(False)
    reader = asyncio.StreamReader(http.HEADER_BYTES)
    protocol = asyncio.StreamReaderProtocol(reader)
    transport, _ = await loop.connect_accepted_socket(lambda: protocol, client, ssl=tls)
    writer = asyncio.StreamWriter(transport, protocol, reader, loop)
    try:
        yield reader, writer
        writer.close()
        await writer.wait_closed()
    finally:
        transport.abort()


async def _heard(reader: asyncio.StreamReader) -> HttpRequest | Refusal:
    parser = http.RequestParser()
    while (found := parser.following()) is None:
        data = await reader.read(http.HEADER_BYTES)
        if not data:
            raise EOFError
        parser.put(data)
    return found


async def _linger(reader: asyncio.StreamReader) -> None:
    """Lets the client read its answer: to close on bytes that nobody read would take it back."""
    left = LINGER_BYTES
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(LINGER_S):
            while left > 0 and (data := await reader.read(http.HEADER_BYTES)):
                left -= len(data)


def _this_task() -> "asyncio.Task[None]":
    task = asyncio.current_task()
    assert task
    return task


def _unentitled(arrived: Arrived, caller: Caller | None) -> Refusal | None:
    """A cookie comes by itself, so a browser has to say whose page asks."""
    if caller is None:
        return Refusal(HTTPStatus.UNAUTHORIZED, "log in on the service's page, or send `Authorization: Bearer TOKEN`")
    if caller.by != "token" and "origin" not in arrived.headers:
        return Refusal(HTTPStatus.FORBIDDEN, "a browser names the page that asks (Origin); a program sends a token")
    return None


def _unknown(arrived: Arrived) -> Refusal | None:
    there = f"there are POST {', '.join(ROUTES)}"
    if arrived.path not in ROUTES:
        return Refusal(HTTPStatus.NOT_FOUND, there)
    return None if arrived.method == "POST" else Refusal(HTTPStatus.METHOD_NOT_ALLOWED, there)


def _no(refusal: Refusal) -> tuple[HTTPStatus, Answer]:
    return refusal.status, {"error": refusal.text}


def _response(status: HTTPStatus, body: Answer, origin: str) -> bytes:
    """A page may read it that sent its cookie along."""
    first, end, rest = http.response(status, body, origin, keep=False).partition(b"\r\n")
    return first + end + b"Access-Control-Allow-Credentials: true\r\n" * bool(origin) + rest


async def serve(server: AwayServer, listeners: list[socket.socket]) -> None:
    """Until standard input ends."""
    left = asyncio.Event()
    asyncio.get_running_loop().add_reader(sys.stdin.fileno(), left.set)
    tasks = [asyncio.create_task(server.accept(listener)) for listener in listeners]
    os.set_blocking(sys.stdout.fileno(), False)
    while not left.is_set():
        with contextlib.suppress(OSError):  # whom it tells is suspended
            os.write(sys.stdout.fileno(), b".")
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(left.wait(), BEAT_S)
    for task in tasks:
        task.cancel()


def main(arguments: list[str]) -> int:
    """The process."""
    for number in (signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    settings = AwaySettings.model_validate_json(arguments[0])
    stand_back()  # below loop, stop process and service, which strangers' handshakes must not slow down
    tls = tls_context(*settings.files) if settings.files else None
    listeners = [socket.socket(fileno=int(fd)) for fd in arguments[1:]]
    try:
        asyncio.run(serve(AwayServer(settings, tls), listeners))
    finally:
        settings.known.unlink(missing_ok=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
