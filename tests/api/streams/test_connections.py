"""As many connections and messages as are allowed are served; what is more is refused in one sentence."""

import contextlib
import http.client
import json
from collections.abc import Iterator

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from api.http.streams import connections, messages
from mock_devices.testing.commands import until
from tests.api.streams.foreign_client import ForeignClient
from tests.api.streams.played import PlayedService

PING = {"type": "ping", "id": 1}


@contextlib.contextmanager
def reading(port: int) -> Iterator[http.client.HTTPResponse]:
    """Events, for as long as the block lasts."""
    with contextlib.closing(http.client.HTTPConnection("127.0.0.1", port, timeout=10)) as client:
        client.request("GET", "/api/v1/events")
        with contextlib.closing(client.getresponse()) as answer:
            yield answer


def refusal(port: int) -> tuple[int, str]:
    """Code and reason with which one more WebSocket is closed."""
    address = f"ws://127.0.0.1:{port}/api/v1/stream"
    with connect(address, subprotocols=[Subprotocol("rig.v1")]) as more, pytest.raises(ConnectionClosed) as closed:
        more.recv(10)
    assert closed.value.rcvd
    return closed.value.rcvd.code, closed.value.rcvd.reason


@pytest.fixture(params=["MOST_OPEN", "MOST_OPEN_EACH"])
def two(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Two connections are as many as there may be."""
    monkeypatch.setattr(connections, request.param, 2)
    return "come back later" if request.param == "MOST_OPEN" else "close one"


def test_one_more_than_may_look_on_is_told_so_and_comes_in_once_another_has_gone(
    service: PlayedService, two: str
) -> None:
    with ForeignClient(service.port) as client:
        with reading(service.port) as events:
            assert events.status == 200 and events.readline() == b"retry: 1000\n"
            code, reason = refusal(service.port)
            assert code == 1013 and "2" in reason and reason.endswith(two)
            with reading(service.port) as more:
                problem = json.loads(more.read())
                assert (more.status, problem["code"], more.headers["Retry-After"]) == (429, "too-many-open", "5")
                assert problem["detail"].endswith(two)
            assert client.ask(PING)["type"] == "pong"

        def comes_in() -> bool:
            with reading(service.port) as again:
                return again.status == 200

        until(comes_in, 20.0, "room for another")


def test_more_messages_than_are_read_in_the_long_run_close_the_connection(service: PlayedService) -> None:
    with ForeignClient(service.port) as client:
        for _ in range(100):
            assert client.ask(PING)["type"] == "pong"
        with pytest.raises(ConnectionClosed) as closed:
            for _ in range(100):
                client.ask(PING)
    assert closed.value.rcvd and closed.value.rcvd.code == 1008
    assert closed.value.rcvd.reason == "more than 20 messages a second came for a while; send fewer, and come back"


def test_a_message_above_the_largest_closes_the_connection_with_its_size(service: PlayedService) -> None:
    with ForeignClient(service.port) as client:
        assert client.ask(" " * messages.LARGEST_MESSAGE_BYTES)["code"] == "invalid-message"
        with pytest.raises(ConnectionClosed) as closed:
            client.ask(" " * (messages.LARGEST_MESSAGE_BYTES + 1))
    assert closed.value.rcvd and closed.value.rcvd.code == 1009
    assert str(messages.LARGEST_MESSAGE_BYTES) in closed.value.rcvd.reason
