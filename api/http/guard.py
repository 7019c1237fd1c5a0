"""What every request passes before a route sees it: who asks, whether they may, how large and how slow the body is.

Pure ASGI, outside the framework: a body is refused before it is read or parsed, and nothing here copies a stream.
"""

import asyncio
import contextlib
import math
import re
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from starlette.responses import Response

from api.http import problems
from api.http.access.access import Access, cookie_name
from api.http.access.arrived import Arrived
from api.http.access.limits import KNOWN, UNKNOWN, Rate
from api.http.access.rights import CALLER, ENTITLED, PASSED, WEBSOCKET, Right, RightsTable
from api.http.access.scopes import Caller
from rig.errors import RigError

SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
# A body of 64 kB takes 60 ms on the slowest line that a page is used over (10 Mbit/s); the rest is patience.
BODY_S = 5.0
# Of a body that is refused: a client that sends before it reads would lose its answer with the connection. So much of
# it is read and thrown away, and for no longer.
DRAINED_BYTES = 4_000_000
DRAIN_S = 1.0
BAD = 400
REFUSALS = (401, 403, 423, 429)
SUBJECTS, LEASE = "/api/v1/subjects", "/api/v1/control/lease"
# Refusals of whoever has no credential that are noted: enough to see that somebody tries, too few to fill a disk.
STRANGER = Rate(5, 1 / 60)
CODE = re.compile(rb'"code":"([a-z-]+)"')
# Said to a WebSocket that is closed before it is accepted: "policy violation", RFC 6455.
POLICY = 1008

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]


class TooLarge(Exception):
    """More of a body came than its limit."""


class Guard:
    """Wraps ``app``; ``headers`` are those of each response that states none of its own, ``names`` other host names."""

    def __init__(
        self,
        app: Application,
        headers: Mapping[str, str],
        access: Access,
        rights: RightsTable,
        body_s: float = BODY_S,
        names: tuple[str, ...] = (),
    ) -> None:
        self._app, self._body_s, self._names = app, body_s, names
        self._access, self._rights = access, rights
        self._headers = [(name.lower().encode(), value.encode()) for name, value in headers.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await self._socket(scope, _arrived(scope), receive, send)
        else:
            arrived, said = _arrived(scope), Said()
            body = UnreadBody(arrived.headers, receive)
            try:
                await self._request(scope, arrived, body.receive, self._decorated(send, said, body))
            except Exception:
                said = Said(500, "error")  # which is answered outside
                raise
            finally:
                self._record(scope, arrived, said)

    def _decorated(self, send: Send, said: "Said", body: "UnreadBody") -> Send:
        async def decorated(message: Message) -> None:
            if message["type"] == "http.response.start":
                said.status = message["status"]
                closing = [(b"connection", b"close")] if body.coming else []
                stated = {name.lower() for name, _ in message["headers"]}
                ours = [header for header in self._headers if header[0] not in stated]
                message = {**message, "headers": [*message["headers"], *ours, *closing]}
            elif said.status >= BAD and not said.code:
                said.code = _code(message.get("body", b""))
            if message["type"] == "http.response.body" and body.coming and not message.get("more_body", False):
                await send({**message, "more_body": True})
                await body.drain()
                message = {"type": "http.response.body"}
            await send(message)

        return decorated

    def _record(self, scope: Scope, arrived: Arrived, said: "Said") -> None:
        """What acted, what was refused, and who looked at subjects; not the renewals of a lease, once a second."""
        caller = scope.get(CALLER)
        acted = arrived.method not in SAFE_METHODS or arrived.path.startswith(SUBJECTS)
        renewed = arrived.method == "PUT" and arrived.path == LEASE and said.status < BAD
        refused = said.status in REFUSALS and (caller or not self._access.limits.wait_s(arrived.client, STRANGER))
        if (acted and not renewed and (caller or said.status < BAD)) or refused:
            outcome = f"{said.status} {said.code}".strip()
            self._access.audit.add(caller, f"{arrived.method} {arrived.path}", outcome)

    async def _socket(self, scope: Scope, arrived: Arrived, receive: Receive, send: Send) -> None:
        refused = self._refused(scope, arrived)
        if refused:
            self._record(scope, arrived, Said(refused.status_code, _code(bytes(refused.body))))
            await receive()
            await send({"type": "websocket.close", "code": POLICY, "reason": ""})
        else:
            await self._app(scope, receive, send)

    async def _request(self, scope: Scope, arrived: Arrived, receive: Receive, send: Send) -> None:
        refused = self._refused(scope, arrived)
        if refused:
            await refused(scope, receive, send)
            return
        right: Right = scope[PASSED]
        if right.streamed:
            await self._app(scope, _counted(receive, right.largest_body_bytes), send)
            return
        if not _announced(arrived.headers):  # most requests: waiting for nothing would cost them a task and a timer
            await self._app(scope, _replay(b"", receive), send)
            return
        try:
            body = await asyncio.wait_for(_read_body(receive, right.largest_body_bytes), self._body_s)
        except TooLarge:
            await _too_large("more than allowed", right.largest_body_bytes)(scope, receive, send)
        except TimeoutError:
            text = f"the body did not come within {self._body_s:g} s; send it whole"
            await problems.answer(408, "slow-body", text)(scope, receive, send)
        else:
            await self._app(scope, _replay(body, receive), send)

    def _refused(self, scope: Scope, arrived: Arrived) -> Response | None:
        """The refusal, or None; then right and caller are in ``scope``."""
        refused = self._refuse_place(arrived)
        if refused:
            return refused
        rule = self._rights.find(arrived.method, arrived.path)
        try:
            caller = self._caller(arrived)
        except (RigError, OSError) as error:
            if not (rule and rule.right and rule.right.stop and arrived.local):  # which asks for no credential
                return problems.answer(503, "access", str(error))
            caller = None
        if rule is None:
            return _unknown(caller, self._rights.methods(arrived.path))
        if rule.right is None:
            return problems.answer(403, "no-right", f"{rule.path} declares no right, so it serves nobody; report this")
        scope[PASSED], scope[CALLER] = rule.right, caller
        scope[ENTITLED] = partial(self._entitled, rule.right, arrived)
        if not rule.right.stop and (wait_s := self._wait_s(caller, arrived)):
            return limited(wait_s)
        return _refuse_caller(rule.right, caller, arrived) or _refuse_stated_size(arrived.headers, rule.right)

    def _caller(self, arrived: Arrived) -> Caller | None:
        return self._access.caller(arrived.headers, cookie_name(arrived.port), arrived.owner)

    def _entitled(self, right: Right, arrived: Arrived) -> bool:
        """Whether what was let in would be let in now."""
        try:
            return _refuse_caller(right, self._caller(arrived), arrived) is None
        except (RigError, OSError):
            return False

    def _wait_s(self, caller: Caller | None, arrived: Arrived) -> float:
        who = caller.key if caller else arrived.client
        return self._access.limits.wait_s(who, KNOWN if caller else UNKNOWN)

    def _refuse_place(self, arrived: Arrived) -> Response | None:
        """No other site's page may move this bench: the host must be this one, and so must the page that asks."""
        if not arrived.known_as(self._names):
            return problems.answer(403, "host", f"the host name {arrived.host[:80]} is not this service's")
        origin = arrived.headers.get("origin")
        own = f"{arrived.scheme}://{arrived.headers.get('host', '')}"
        if origin and arrived.method not in SAFE_METHODS and origin.lower() != own.lower():
            return problems.answer(403, "origin", f"a page of {origin[:80]} may not act on this bench")
        return None


@dataclass
class Said:
    """What was answered; ``code`` of a problem."""

    status: int = 0
    code: str = ""


def _code(body: bytes) -> str:
    found = CODE.search(body)
    return found[1].decode() if found else ""


def limited(wait_s: float) -> Response:
    """Somebody asks too often."""
    text = f"too many requests; try again in {wait_s:.1f} s"
    return problems.answer(429, "too-many", text, headers={"Retry-After": str(math.ceil(wait_s))})


HOW = (
    "log in on the page, or send `Authorization: Bearer TOKEN` with a token of `rig token create NAME --scope {scope}`;"
    " `rig token link` prints an address that logs a browser in"
)


def _unauthorised(word: str) -> Response:
    text = f"nobody is logged in here: {HOW.format(scope=word)}"
    return problems.answer(401, "no-credential", text, headers={"WWW-Authenticate": "Bearer"})


def _unknown(caller: Caller | None, methods: frozenset[str]) -> Response:
    """Of a path that no route serves; which there are is told to nobody without a credential."""
    if caller is None:
        return _unauthorised("read")
    if not methods:
        return problems.answer(404, "no-such-route", "there is nothing at this address; see /api/v1/openapi.json")
    taken = ", ".join(sorted(methods))
    return problems.answer(405, "method", f"this address takes {taken}", headers={"Allow": taken})


def _refuse_caller(right: Right, caller: Caller | None, arrived: Arrived) -> Response | None:
    if right.scope is None or (right.stop and arrived.local):
        return None
    if caller is None:
        return _unauthorised(right.scope.word)
    if caller.may(right.scope):
        return _refuse_forged(caller, arrived)
    text = f"{caller.name} may {caller.scope.word} here, and this asks for the scope {right.scope.word}"
    return problems.answer(403, "scope", text)


def lacking(right: Right, scope: Scope) -> Response | None:
    """The refusal where whoever asks has no such ``right``: for a route that asks some for more than its own."""
    return _refuse_caller(right, scope.get(CALLER), _arrived(scope))


def _refuse_forged(caller: Caller, arrived: Arrived) -> Response | None:
    """A cookie comes by itself, so what it lets pass must say that this service's own page has sent it."""
    acts = arrived.method not in SAFE_METHODS
    if caller.by not in ("login", "link") or not acts or "origin" in arrived.headers:
        return None
    text = "a browser names the page that asks (Origin), and this request names none; a program sends a token instead"
    return problems.answer(403, "origin", text)


def _refuse_stated_size(headers: Mapping[str, str], right: Right) -> Response | None:
    stated = headers.get("content-length", "0")
    if not (stated.isascii() and stated.isdigit()):
        return problems.answer(400, "content-length", f"Content-Length {stated[:40]!r} is no number of bytes")
    return _too_large(stated, right.largest_body_bytes) if int(stated) > right.largest_body_bytes else None


def _too_large(size: str, largest: int) -> Response:
    text = f"a body of {size} bytes is above {largest} bytes, the largest this address reads"
    return problems.answer(413, "too-large", text)


def _arrived(scope: Scope) -> Arrived:
    address, port = scope.get("server") or ("", 0)
    headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
    client, _ = scope.get("client") or ("", 0)
    method = WEBSOCKET if scope["type"] == "websocket" else scope["method"]
    scheme = "https" if scope.get("scheme") in ("https", "wss") else "http"
    return Arrived(method, scope["path"], headers, scheme, address, port or 0, client, owner=port is None)


class UnreadBody:
    """What comes of a request's body; ``coming``: there is more of it."""

    def __init__(self, headers: Mapping[str, str], receive: Receive) -> None:
        self._receive = receive
        self.coming = _announced(headers)

    async def receive(self) -> Message:
        """The next part of it."""
        message = await self._receive()
        self.coming = self.coming and message["type"] == "http.request" and message.get("more_body", False)
        return message

    async def drain(self) -> None:
        """Throws away the rest, within bounds."""
        left = DRAINED_BYTES
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(DRAIN_S):
                while self.coming and left > 0:
                    left -= len((await self.receive()).get("body", b""))


def _announced(headers: Mapping[str, str]) -> bool:
    return headers.get("content-length", "0") != "0" or "transfer-encoding" in headers


async def _read_body(receive: Receive, largest: int) -> bytes:
    body = b""
    while True:
        message = await receive()
        part: bytes = message.get("body", b"")
        body += part
        if len(body) > largest:
            raise TooLarge
        if message["type"] == "http.disconnect" or not message.get("more_body", False):
            return body


def _counted(receive: Receive, largest: int) -> Receive:
    """A body that its route reads: no more of it than ``largest``, whatever was stated."""
    count = 0

    async def counted() -> Message:
        nonlocal count
        message = await receive()
        count += len(message.get("body", b""))
        if count > largest:
            text = f"the body is above {largest} bytes, the largest this address reads"
            raise problems.RequestRefused(413, "too-large", text)
        return message

    return counted


def _replay(body: bytes, receive: Receive) -> Receive:
    """Hands out ``body`` once, then what comes from the client: that it is gone."""
    pending = [{"type": "http.request", "body": body, "more_body": False}]

    async def replayed() -> Message:
        return pending.pop() if pending else await receive()

    return replayed
