"""Bodies that are too large or too slow, and clients that do not read, over real sockets."""

import asyncio
import contextlib
import http.client
import json
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator

import httpx2
import pytest
import uvicorn
from fastapi import FastAPI

from api.http import guard
from api.http.access.access import Access
from api.http.access.rights import LARGEST_BODY_BYTES, PUBLIC, RightsTable
from api.http.connection import ImpatientProtocol, server_settings
from api.http.guard import Guard, Message, Receive, Scope, Send

GIGABYTE = 1_000_000_000
MEGABYTE = b"x" * 1_000_000
Body = bytes | Iterable[bytes]


# The first byte of Linux's struct tcp_info (linux/tcp.h, net/tcp_states.h).
ESTABLISHED = 1


class Hasty(ImpatientProtocol):
    head_s = 0.3
    read_s = 0.3


async def echo(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers with the body's size; `/flood` sends more than any buffer takes, for up to 2 s."""
    flooding = scope["path"] == "/flood"
    text = b"" if flooding else str(len((await receive())["body"])).encode()
    length = [] if flooding else [(b"content-length", str(len(text)).encode())]
    await send({"type": "http.response.start", "status": 200, "headers": length})
    for _ in range(1000 if flooding else 0):
        await send({"type": "http.response.body", "body": MEGABYTE, "more_body": True})
        await asyncio.sleep(0.002)
    await send({"type": "http.response.body", "body": text, "more_body": False})


def guarded(headers: dict[str, str], body_s: float = 5.0) -> Guard:
    """Every address of it is open to all."""
    app = FastAPI(openapi_url=None, docs_url=None, redoc_url=None)
    app.api_route("/{path:path}", methods=["GET", "POST"], dependencies=[PUBLIC])(lambda: None)
    return Guard(echo, headers, Access(), RightsTable(app), body_s)


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    app = guarded({"X-Content-Type-Options": "nosniff"}, body_s=0.3)
    config = uvicorn.Config(app, **server_settings() | {"http": Hasty}, lifespan="off")
    server = uvicorn.Server(config)
    listening = socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=server.run, args=([listening],))
    thread.start()
    while not server.started:
        time.sleep(0.01)
    yield int(listening.getsockname()[1])
    server.should_exit = server.force_exit = True
    thread.join()
    listening.close()


def ask(port: int, head: str, body: bytes = b"") -> tuple[int, str]:
    """Status and body of the answer to one request; the answer is read until the service closes."""
    with socket.create_connection(("127.0.0.1", port), timeout=10) as client:
        client.sendall(f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n{head}\r\n".encode() + body)
        answer = b""
        while part := client.recv(65536):
            answer += part
    status, _, text = answer.decode().partition("\r\n\r\n")
    return int(status.split()[1]), text


def test_a_body_within_the_limit_reaches_the_application_whole(port: int) -> None:
    size = LARGEST_BODY_BYTES
    assert ask(port, f"Content-Length: {size}\r\nConnection: close\r\n", b"x" * size) == (200, str(size))


def test_a_stated_gigabyte_is_refused_before_any_of_it_comes(port: int) -> None:
    began_s = time.monotonic()
    status, text = ask(port, f"Content-Length: {GIGABYTE}\r\n")
    assert (status, json.loads(text)["code"]) == (413, "too-large")
    assert "above 64000 bytes" in text
    assert time.monotonic() - began_s < 2


def told_by_http_client(port: int, method: str, body: Body) -> list[int]:
    client = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    with contextlib.closing(client):
        client.request(method, "/", body)
        return [client.getresponse().status]


def told_by_httpx(port: int, method: str, body: Body) -> list[int]:
    """Twice, on one client: the second request must not go into a connection that is about to close."""
    address = f"http://127.0.0.1:{port}/"
    with httpx2.Client(timeout=10, trust_env=False) as client:
        return [client.request(method, address, content=body).status_code for _ in range(2)]


class Pieces:
    """A body whose size is not stated."""

    def __iter__(self) -> Iterator[bytes]:
        return iter([MEGABYTE] * 3)


@pytest.mark.parametrize("told", [told_by_http_client, told_by_httpx])
@pytest.mark.parametrize("body", [b"x" * 70_000, MEGABYTE * 3, Pieces()], ids=["70 kB", "3 MB", "in pieces"])
def test_whoever_sends_a_body_that_is_refused_reads_why(
    port: int, told: Callable[[int, str, Body], list[int]], body: Body
) -> None:
    """A method that nothing serves is refused before anything is read, a size while it is read."""
    for method, status in (("POST", 413), ("TRACE", 401), ("PUT", 401)):
        for _ in range(3):
            assert set(told(port, method, body)) == {status}, method


def test_what_is_refused_is_answered_before_the_rest_of_it_comes(port: int) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=10) as client:
        client.sendall(f"PUT / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: 1000\r\n\r\nx".encode())
        answer = b""
        while b'"code"' not in answer:
            answer += client.recv(65536)
        assert b"connection: close" in answer.lower()
        client.sendall(b"x" * 999)
        while part := client.recv(65536):
            answer += part
        assert answer.count(b"HTTP/1.1 ") == 1


def test_what_is_refused_is_not_read_for_ever(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "DRAIN_S", 0.3)
    began_s = time.monotonic()
    assert ask(port, f"Content-Length: {GIGABYTE}\r\n")[0] == 413  # and no more comes of it
    assert 0.2 < time.monotonic() - began_s < 5
    monkeypatch.setattr(guard, "DRAIN_S", 60.0)
    with socket.create_connection(("127.0.0.1", port), timeout=10) as client:
        client.sendall(f"PUT / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: {GIGABYTE}\r\n\r\n".encode())
        with pytest.raises(ConnectionError):
            for _ in range(1000):
                client.sendall(MEGABYTE)


def test_a_body_that_was_read_leaves_the_connection_open(port: int) -> None:
    client = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    with contextlib.closing(client):
        for _ in range(2):
            client.request("POST", "/", b"x" * 1000)
            answer = client.getresponse()
            assert (answer.read(), answer.getheader("connection")) == (b"1000", None)


def test_an_unstated_size_is_refused_when_the_limit_is_passed(port: int) -> None:
    chunk = b"8000\r\n" + b"x" * 0x8000 + b"\r\n"
    status, text = ask(port, "Transfer-Encoding: chunked\r\n", chunk * 3)
    assert (status, json.loads(text)["code"]) == (413, "too-large")


def test_a_body_that_trickles_is_refused(port: int) -> None:
    status, text = ask(port, "Content-Length: 1000\r\n", b"x")
    assert (status, json.loads(text)["code"]) == (408, "slow-body")


@pytest.mark.parametrize("head", [b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"])
def test_a_head_that_does_not_come_loses_the_connection(port: int, head: bytes) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=10) as client:
        client.sendall(head)
        with pytest.raises(ConnectionError):
            assert client.recv(100) == b""
            raise ConnectionError


def assert_served(client: socket.socket) -> None:
    """The whole of one answer of `echo`."""
    answer = b""
    while not answer.endswith(b"\r\n\r\n0"):
        answer += client.recv(1) or pytest.fail(f"closed after {answer!r}")
    assert answer.startswith(b"HTTP/1.1 200 ")


@pytest.mark.parametrize("head", [b"\r\n", b"GET / HT", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"])
def test_a_later_head_that_does_not_come_loses_the_connection_as_well(port: int, head: bytes) -> None:
    """It is no longer waiting to be kept alive either: the deadline of that ended with the first byte."""
    with socket.create_connection(("127.0.0.1", port), timeout=10) as client:
        client.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        assert_served(client)
        client.sendall(head)
        with pytest.raises(ConnectionError):
            assert client.recv(100) == b""
            raise ConnectionError


def in_parts(port: int, fields: int) -> socket.socket:
    """A connection by which a head without its end was sent, 1 kB a field, each by itself."""
    client = socket.create_connection(("127.0.0.1", port), timeout=10)
    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    client.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n".encode())
    with contextlib.suppress(ConnectionError):
        for number in range(fields):
            client.sendall(f"X-{number:04}: {'x' * 1000}\r\n".encode())
            time.sleep(0.001)
    return client


def test_a_head_without_end_loses_the_connection(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Hasty, "head_s", 60.0)
    with in_parts(port, 50) as client:
        client.sendall(b"\r\n")
        assert_served(client)
    with in_parts(port, 80) as client, pytest.raises(ConnectionError):
        assert client.recv(100) == b""
        raise ConnectionError


def test_a_client_that_does_not_read_loses_its_connection(port: int) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=10) as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.sendall(f"GET /flood HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        while client.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0] == ESTABLISHED:
            time.sleep(0.01)
        with pytest.raises(ConnectionError):
            while client.recv(1_000_000):
                pass
            raise ConnectionError


def test_a_client_that_reads_slowly_but_reads_keeps_its_connection(port: int) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=10) as client:
        client.sendall(f"GET /flood HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        until_s = time.monotonic() + 1.0
        while time.monotonic() < until_s:
            assert client.recv(1_000_000)
            time.sleep(0.001)


def test_a_size_that_is_no_number_is_refused() -> None:
    sent: list[Message] = []

    async def send(message: Message) -> None:
        sent.append(message)

    async def receive() -> Message:
        assert sent, "nothing is read before the answer"
        return {"type": "http.disconnect"}

    headers = [(b"host", b"127.0.0.1"), (b"content-length", b"-5")]
    scope = {"type": "http", "method": "POST", "path": "/", "headers": headers, "server": ("127.0.0.1", 80)}
    asyncio.run(guarded({})(scope, receive, send))
    assert sent[0]["status"] == 400
