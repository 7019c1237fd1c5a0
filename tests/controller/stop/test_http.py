"""HTTP as far as the stop process speaks it: whole, in pieces, malformed, foreign."""

import json
from http import HTTPStatus

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.stop.http import HEADER_BYTES, HttpRequest, Refusal, RequestParser, foreign, response

ESTOP = b"POST /estop HTTP/1.1\r\nHost: 127.0.0.1:8001\r\nOrigin: http://127.0.0.1:8000\r\n\r\n"


def fed(data: bytes, parser: RequestParser | None = None) -> HttpRequest | Refusal | None:
    parser = parser or RequestParser()
    parser.put(data)
    return parser.following()


def parsed(data: bytes) -> HttpRequest:
    found = fed(data)
    assert isinstance(found, HttpRequest), found
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


@pytest.mark.parametrize(("version", "keep"), [("HTTP/1.1", True), ("HTTP/1.0", False)])
def test_both_versions_are_spoken_and_only_the_newer_keeps_its_connection(version: str, keep: bool) -> None:
    assert parsed(f"GET /state {version}\r\n\r\n".encode()).keep is keep


def test_blanks_around_a_value_are_none_of_it_and_all_else_is() -> None:
    assert parsed(b"GET /state HTTP/1.1\r\nA: \t XX-x \t\r\n\r\n").headers == {"a": "XX-x"}


def test_a_head_may_have_as_many_bytes_as_are_said_and_no_more() -> None:
    line = b"GET /state HTTP/1.1\r\nA: "
    fitting = line + b"x" * (HEADER_BYTES - len(line))
    parser = RequestParser()
    parser.put(fitting)
    assert not parser.whole
    assert isinstance(fed(b"\r\n\r\n", parser), HttpRequest)
    assert isinstance(fed(fitting + b"x\r\n\r\n"), Refusal)
    assert len(parser._buffer) == 0
    parser.put(b"x" * 5 * HEADER_BYTES)
    assert len(parser._buffer) == 2 * HEADER_BYTES


@pytest.mark.parametrize("headers", [{}, {"host": "localhost"}, {"host": "127.0.0.1:8001"}, {"host": "LOCALHOST:80"}])
def test_who_names_no_host_or_this_computer_is_local(headers: dict[str, str]) -> None:
    assert foreign(HttpRequest("POST", "/stop", headers, True)) is None


@pytest.mark.parametrize("host", ["[", "", "XXXX"])
def test_a_host_that_is_none_is_foreign_and_named_in_at_most_80_letters(host: str) -> None:
    refusal = foreign(HttpRequest("POST", "/stop", {"host": host}, True))
    name = host.lower() if host == "XXXX" else ""
    assert refusal == Refusal(HTTPStatus.FORBIDDEN, f"the host name {name} is not this computer's")
    long = foreign(HttpRequest("POST", "/stop", {"host": "h" * 81, "origin": ""}, True))
    assert long and long.text == f"the host name {'h' * 80} is not this computer's"
    page = foreign(HttpRequest("POST", "/stop", {"origin": "p" * 81}, True))
    assert page and page.text == f"a page of {'p' * 80} may not stop this bench"


def test_an_answer_says_its_length_and_whether_the_connection_stays() -> None:
    assert response(HTTPStatus.NO_CONTENT, None, "", False).endswith(b"\r\nConnection: close\r\n\r\n")
    assert b"Content-Length: 0\r\n" in response(HTTPStatus.NO_CONTENT, None, "", False)
    kept = response(HTTPStatus.OK, {"a": 1}, "", True)
    assert kept.endswith(b'\r\nConnection: keep-alive\r\n\r\n{"a": 1}\n')
    assert b"Content-Length: 9\r\n" in kept
