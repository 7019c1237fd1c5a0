"""As much of HTTP/1.1 (RFC 9112) as a stop needs: headers within a limit, no bodies, short answers. No sockets here."""

import json
import re
from collections.abc import Mapping
from http import HTTPStatus
from typing import NamedTuple
from urllib.parse import urlsplit

HEADER_BYTES = 8192  # what common servers allow (Apache: 8190 a line); a browser's head has below 2 kB
LOCAL = ("127.0.0.1", "localhost", "::1")
_END = b"\r\n\r\n"
_TOKEN = re.compile(r"[!#$%&'*+.^_`|~0-9A-Za-z-]+")


class HttpRequest(NamedTuple):
    """A request's head; names of headers are in small letters."""

    method: str
    path: str
    headers: Mapping[str, str]
    keep: bool
    """Whether another request may follow: not where a body does, which is never read."""


class Refusal(NamedTuple):
    """What was no request, or none of ours."""

    status: HTTPStatus
    text: str


class RequestParser:
    """Bytes to requests. After a Refusal, or a request that is not kept, nothing more is to be looked for."""

    def __init__(self) -> None:
        self._buffer = b""

    @property
    def begun(self) -> bool:
        """Whether part of a request is there."""
        return bool(self._buffer)

    @property
    def whole(self) -> bool:
        """Whether ``following`` has something to return."""
        return _END in self._buffer or len(self._buffer) > HEADER_BYTES

    def put(self, data: bytes) -> None:
        """Adds what has come; beyond what two heads may have it is dropped, and makes the second no request."""
        self._buffer = (self._buffer + data)[: 2 * HEADER_BYTES]

    def following(self) -> HttpRequest | Refusal | None:
        """The next request that is whole, if one is; what follows it is kept."""
        head, found, rest = self._buffer.partition(_END)
        if len(head) > HEADER_BYTES:
            return Refusal(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, f"a request's head has {HEADER_BYTES} bytes")
        if not found:
            return None
        self._buffer = rest
        return _parse(head.decode("latin-1"))


def _parse(head: str) -> HttpRequest | Refusal:
    line, *fields = head.split("\r\n")
    parts = line.split(" ")
    malformed = Refusal(HTTPStatus.BAD_REQUEST, "this is no HTTP/1.1 request")
    if len(parts) != 3 or not _TOKEN.fullmatch(parts[0]) or parts[2] not in ("HTTP/1.0", "HTTP/1.1"):
        return malformed
    headers: dict[str, str] = {}
    for field in fields:
        name, colon, value = field.partition(":")
        if not colon or not _TOKEN.fullmatch(name):
            return malformed
        headers[name.lower()] = value.strip(" \t")
    body = "transfer-encoding" in headers or headers.get("content-length", "0") != "0"
    keep = parts[2] == "HTTP/1.1" and headers.get("connection", "").lower() != "close" and not body
    return HttpRequest(parts[0], parts[1].partition("?")[0], headers, keep)


def foreign(request: HttpRequest) -> Refusal | None:
    """Why a request that is not of this computer's own pages or programs is refused; None for one that is."""
    host = _hostname("//" + request.headers.get("host", "localhost"))
    if host not in LOCAL:
        return Refusal(HTTPStatus.FORBIDDEN, f"the host name {host[:80]} is not this computer's")
    origin = request.headers.get("origin")
    if origin is not None and _hostname(origin) not in LOCAL:
        return Refusal(HTTPStatus.FORBIDDEN, f"a page of {origin[:80]} may not stop this bench")
    return None


def _hostname(url: str) -> str:
    try:
        return urlsplit(url).hostname or ""
    except ValueError:
        return ""


def response(status: HTTPStatus, body: Mapping[str, object] | None, origin: str, keep: bool) -> bytes:
    """An answer; a local page at ``origin`` may read it."""
    content = json.dumps(body).encode() + b"\n" if body is not None else b""
    lines = [
        f"HTTP/1.1 {status.value} {status.phrase}",
        f"Content-Length: {len(content)}",
        "Content-Type: application/json",
        "Cache-Control: no-store",
        f"Connection: {'keep-alive' if keep else 'close'}",
    ]
    if origin:
        lines += [
            f"Access-Control-Allow-Origin: {origin}",
            "Vary: Origin",
            "Access-Control-Allow-Methods: GET, POST",
            "Access-Control-Allow-Headers: Content-Type",
            "Access-Control-Allow-Private-Network: true",
        ]
    return "\r\n".join(lines).encode("latin-1") + _END + content
