"""What every request passes before a route sees it: who asks, how large the body is, how long it takes to come.

Pure ASGI, outside the framework: a body is refused before it is read or parsed, and nothing here copies a stream.
"""

import asyncio
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from typing import Any
from urllib.parse import urlsplit

from starlette.responses import Response

from api.http import problems

LOCAL = ("127.0.0.1", "localhost", "::1")
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
# The largest request of this service is a tracking job of 20 forces, below 2 kB.
LARGEST_BODY_BYTES = 64_000
# A body of that size takes 60 ms on the slowest line that a page is used over (10 Mbit/s); the rest is patience.
BODY_S = 5.0

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]


class TooLarge(Exception):
    """More of a body came than its limit."""


class Guard:
    """Wraps ``app``; ``headers`` are added to every response."""

    def __init__(self, app: Application, headers: Mapping[str, str], body_s: float = BODY_S) -> None:
        self._app, self._body_s = app, body_s
        self._headers = [(name.lower().encode(), value.encode()) for name, value in headers.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def decorated(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message["headers"], *self._headers]}
            await send(message)

        headers = _headers_of(scope)
        refused = _refuse_caller(scope, headers) or _refuse_stated_size(headers)
        if refused:
            await refused(scope, receive, decorated)
            return
        try:
            body = await asyncio.wait_for(_read_body(headers, receive), self._body_s)
        except TooLarge:
            await _too_large(f"more than {LARGEST_BODY_BYTES}")(scope, receive, decorated)
        except TimeoutError:
            text = f"the body did not come within {self._body_s:g} s; send it whole"
            await _closing(problems.answer(408, "slow-body", text))(scope, receive, decorated)
        else:
            await self._app(scope, _replay(body, receive), decorated)


def _refuse_caller(scope: Scope, headers: Mapping[str, str]) -> Response | None:
    """No other site's page may move this bench: the host must be local, and so must the page that asks."""
    stated = headers.get("host", "")
    host = urlsplit(f"//{stated}").hostname or ""
    address, _ = scope.get("server") or ("", 0)
    if host not in (*LOCAL, address):
        return problems.answer(403, "host", f"the host name {host} is not this service's")
    origin = headers.get("origin")
    if origin and scope["method"] not in SAFE_METHODS and urlsplit(origin).netloc != stated:
        return problems.answer(403, "origin", f"a page of {origin} may not act on this bench")
    return None


def _refuse_stated_size(headers: Mapping[str, str]) -> Response | None:
    stated = headers.get("content-length", "0")
    if not (stated.isascii() and stated.isdigit()):
        return problems.answer(400, "content-length", f"Content-Length {stated[:40]!r} is no number of bytes")
    return _too_large(stated) if int(stated) > LARGEST_BODY_BYTES else None


def _too_large(size: str) -> Response:
    text = f"a body of {size} bytes is above {LARGEST_BODY_BYTES} bytes, the largest this service reads"
    return _closing(problems.answer(413, "too-large", text))


def _closing(response: Response) -> Response:
    """The rest of what the client sends is not read any more."""
    response.headers["Connection"] = "close"
    return response


def _headers_of(scope: Scope) -> dict[str, str]:
    return {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}


async def _read_body(headers: Mapping[str, str], receive: Receive) -> bytes:
    if headers.get("content-length", "0") == "0" and "transfer-encoding" not in headers:
        return b""
    body = b""
    while True:
        message = await receive()
        part: bytes = message.get("body", b"")
        body += part
        if len(body) > LARGEST_BODY_BYTES:
            raise TooLarge
        if message["type"] == "http.disconnect" or not message.get("more_body", False):
            return body


def _replay(body: bytes, receive: Receive) -> Receive:
    """Hands out ``body`` once, then what comes from the client: that it is gone."""
    pending = [{"type": "http.request", "body": body, "more_body": False}]

    async def replayed() -> Message:
        return pending.pop() if pending else await receive()

    return replayed
