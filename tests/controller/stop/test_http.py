"""HTTP as far as the stop process speaks it: whole, in pieces, malformed, foreign."""

import json
from http import HTTPStatus

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.stop.http import HEADER_BYTES, Refusal, Request, RequestParser, foreign, response

ESTOP = b"POST /estop HTTP/1.1\r\nHost: 127.0.0.1:8001\r\nOrigin: http://127.0.0.1:8000\r\n\r\n"


def fed(data: bytes, parser: RequestParser | None = None) -> Request | Refusal | None:
    parser = parser or RequestParser()
    parser.put(data)
    return parser.following()


def parsed(data: bytes) -> Request:
    found = fed(data)
    assert isinstance(found, Request), found
    return found


def test_a_request_is_read() -> None:
    request = parsed(ESTOP)
    assert (request.method, request.path, request.keep) == ("POST", "/estop", True)
    assert request.headers["origin"] == "http://127.0.0.1:8000"


@given(st.integers(1, len(ESTOP)))
def test_a_request_in_pieces_is_read_once_it_is_whole(size: int) -> None:
    parser = RequestParser()
    found = [fed(ESTOP[at : at + size], parser) for at in range(0, len(ESTOP), size)]
    assert found[:-1] == [None] * (len(found) - 1)
    assert found[-1] == parsed(ESTOP)


def test_two_requests_in_one_piece_come_one_after_the_other() -> None:
    parser = RequestParser()
    assert fed(ESTOP + ESTOP, parser) == parsed(ESTOP)
    assert parser.whole
    assert parser.following() == parsed(ESTOP)
    assert not parser.begun


@pytest.mark.parametrize(
    ("fields", "keep"),
    [
        (b"", True),
        (b"Connection: close\r\n", False),
        (b"Content-Length: 0\r\n", True),
        (b"Content-Length: 1000000000\r\n", False),
        (b"Content-Length: -5\r\n", False),
        (b"Transfer-Encoding: chunked\r\n", False),
    ],
)
def test_no_request_is_looked_for_behind_a_body(fields: bytes, keep: bool) -> None:
    assert parsed(b"POST /pain HTTP/1.1\r\n" + fields + b"\r\n").keep is keep


@pytest.mark.parametrize(
    "head",
    [
        b"\r\n\r\n",
        b"POST /estop\r\n\r\n",
        b"POST  /estop HTTP/1.1\r\n\r\n",
        b"POST /estop HTTP/2\r\n\r\n",
        b"P\x00ST /estop HTTP/1.1\r\n\r\n",
        b"POST /estop HTTP/1.1\r\nno colon\r\n\r\n",
        b"POST /estop HTTP/1.1\r\nHost: a\r\n folded\r\n\r\n",
        b"POST /estop HTTP/1.1\r\nBad Name: a\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\r\n\r\n",
    ],
)
def test_what_is_no_request_is_refused(head: bytes) -> None:
    found = fed(head)
    assert found == Refusal(HTTPStatus.BAD_REQUEST, "this is no HTTP/1.1 request")


@pytest.mark.parametrize("data", [b"x" * (HEADER_BYTES + 1), b"GET / HTTP/1.1\r\nA: " + b"x" * 9000 + b"\r\n\r\n"])
def test_a_head_that_does_not_end_is_refused(data: bytes) -> None:
    found = fed(data)
    assert isinstance(found, Refusal)
    assert found.status == 431


@given(st.lists(st.binary(max_size=300), max_size=20))
def test_no_bytes_raise(pieces: list[bytes]) -> None:
    parser = RequestParser()
    for piece in pieces:
        if isinstance(fed(piece + b"\r\n\r\n", parser), Refusal):
            break


@pytest.mark.parametrize(
    ("fields", "refused"),
    [
        (b"Host: 127.0.0.1:8001\r\n", False),
        (b"Host: localhost\r\nOrigin: http://localhost:8000\r\n", False),
        (b"Host: [::1]:8001\r\n", False),
        (b"", False),
        (b"Host: evil.example\r\n", True),
        (b"Host: 127.0.0.1\r\nOrigin: https://evil.example\r\n", True),
        (b"Host: 127.0.0.1\r\nOrigin: null\r\n", True),
        (b"Host: 127.0.0.1\r\nOrigin: http://[\r\n", True),
        (b"Host: 127.0.0.1.evil.example\r\n", True),
    ],
)
def test_only_this_computers_own_pages_and_programs_may_ask(fields: bytes, refused: bool) -> None:
    assert (foreign(parsed(b"POST /estop HTTP/1.1\r\n" + fields + b"\r\n")) is not None) is refused


def test_an_answer_says_its_length_and_who_may_read_it() -> None:
    head, _, body = response(HTTPStatus.OK, {"id": 3}, "http://127.0.0.1:8000", True).partition(b"\r\n\r\n")
    assert json.loads(body) == {"id": 3}
    assert head.startswith(b"HTTP/1.1 200 OK\r\n")
    assert f"Content-Length: {len(body)}".encode() in head
    assert b"Access-Control-Allow-Origin: http://127.0.0.1:8000" in head
    assert b"Access-Control" not in response(HTTPStatus.OK, {}, "", False)
    assert b"Connection: close" in response(HTTPStatus.OK, {}, "", False)
