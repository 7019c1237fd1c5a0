"""The stop process turn by turn: one thread, real sockets, and a clock that the test sets."""

import json
import os
import socket
import struct
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from controller.stop import http
from controller.stop import server as module
from controller.stop.keyboard import Keyboard
from controller.stop.keypad import Keys
from controller.stop.server import Connection, StopServer
from controller.stop.word import Deed, Responder, StopReason, StopRequest, StopWord
from tests.controller.descriptors import open_files

KEYS = Keys({}, StopReason.EMERGENCY)
PAIN = b"POST /pain HTTP/1.1\r\n\r\n"


class Served:
    """A server and the loop's end of its page."""

    def __init__(self, folder: Path) -> None:
        self.page = StopWord.create(folder / "a.stop")
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.now = 100.0
        keyboard = Keyboard(self.page, "", -1, KEYS, required=False)
        self.server = StopServer(self.page, self.listener, keyboard, lambda: self.now)
        self.address = self.listener.getsockname()
        self.loop = Responder(self.page)
        self.clients: list[socket.socket] = []

    def client(self, data: bytes = b"") -> socket.socket:
        """A new client that has sent ``data``, and a turn of the server."""
        made = socket.create_connection(self.address, 5)
        self.clients.append(made)
        if data:
            made.sendall(data)
        self.server.turn()
        return made

    @property
    def connections(self) -> list[Connection]:
        return list(self.server._connections.values())

    def close(self) -> None:
        for client in self.clients:
            client.close()
        self.server.close()
        self.page.close(unlink=True)


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    made = Served(tmp_path)
    yield made
    made.close()


def hung_up(client: socket.socket) -> bool:
    """Whether nothing more comes."""
    client.settimeout(0.05)
    try:
        return client.recv(4096) == b""
    except TimeoutError:
        return False


def connection(since: float = 10.0, **values: Any) -> Connection:
    made = Connection(cast(socket.socket, SimpleNamespace()), since)
    for name, value in values.items():
        setattr(made, name, value)
    return made


def begun(data: bytes, **values: Any) -> Connection:
    made = connection(**values)
    made.parser.put(data)
    return made


STOP = StopRequest(1, StopReason.STOP)


@pytest.mark.parametrize(
    ("waits", "deadline"),
    [
        (connection(), 70.0),
        (begun(b"POST /es"), 12.0),
        (connection(stop=STOP), 10.5),
        (begun(b"POST /es", stop=STOP), 10.5),
        (connection(lingering=True), 10.5),
        (begun(b"POST /es", lingering=True), 10.5),
    ],
)
def test_each_client_has_its_time(waits: Connection, deadline: float) -> None:
    assert waits.deadline == deadline


@pytest.mark.parametrize(
    ("waiting", "wait_s"),
    [
        ([], 0.2),
        ([connection()], 0.2),
        ([connection(), begun(PAIN)], 0.0),
        ([connection(), connection(stop=STOP)], 0.0005),
        ([begun(PAIN, stop=STOP), connection()], 0.0005),
        ([begun(PAIN, lingering=True)], 0.2),
        ([begun(PAIN), connection(stop=STOP)], 0.0),
    ],
)
def test_a_turn_waits_as_long_as_nobody_is_kept_waiting(
    served: Served, waiting: list[Connection], wait_s: float
) -> None:
    served.server._connections = dict(enumerate(waiting))
    assert served.server._wait_s() == wait_s
    served.server._connections = {}


def test_a_request_that_came_with_its_connection_is_taken_in_the_same_turn(served: Served) -> None:
    client = served.client(PAIN)
    (request,) = served.loop.take(1)
    assert request.kind is StopReason.PAIN
    served.loop.answer(Deed.RETRACTING, 2)
    served.now += 0.012346
    served.server.turn()
    head, _, body = client.recv(4096).partition(b"\r\n\r\n")
    said = {"id": 1, "kind": "pain", "confirmed": True, "done": "retracting", "after_ms": 12.35}
    assert head.startswith(b"HTTP/1.1 200 OK")
    assert b"Connection: keep-alive" in head
    assert b"Access-Control" not in head
    assert json.loads(body) == said
    assert served.server.state() == {"loop": "silent", "keypad": "none", "presses": 0, "last": said}
    assert not hung_up(client)


def test_before_anything_was_asked_there_is_no_last(served: Served) -> None:
    assert served.server.state() == {"loop": "starting", "keypad": "none", "presses": 0, "last": None}


def test_an_answer_that_does_not_come_is_waited_for_half_a_second(served: Served) -> None:
    client = served.client(PAIN)
    served.now += 0.499
    served.server.turn()
    client.settimeout(0.02)
    with pytest.raises(TimeoutError):
        client.recv(10)
    served.now += 0.001
    served.server.turn()
    client.settimeout(5)
    head, _, body = client.recv(4096).partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 504 ")
    assert json.loads(body)["done"] == "NOT CONFIRMED: use the hardware stop (the loop does not answer)"


@pytest.mark.parametrize(("data", "lasts_s"), [(b"", 60.0), (b"POST /es", 2.0)])
def test_who_says_nothing_or_half_of_it_is_hung_up_on_in_time(served: Served, data: bytes, lasts_s: float) -> None:
    client = served.client(data)
    served.now += lasts_s - 0.001
    served.server.turn()
    assert len(served.connections) == 1
    served.now += 0.001
    served.server.turn()
    assert served.connections == []
    assert hung_up(client)


@pytest.mark.parametrize(
    ("line", "status", "text"),
    [
        (b"GET /estop", b"405", "POST /estop, /pain, /stop; GET /state"),
        (b"POST /state", b"405", "POST /estop, /pain, /stop; GET /state"),
        (b"POST /nothing", b"404", "there are /estop, /pain, /stop and /state"),
    ],
)
def test_what_there_is_not_is_answered_with_what_there_is(
    served: Served, line: bytes, status: bytes, text: str
) -> None:
    client = served.client(line + b" HTTP/1.1\r\n\r\n")
    head, _, body = client.recv(4096).partition(b"\r\n\r\n")
    assert head.split(b" ")[1] == status
    assert json.loads(body) == {"error": text}
    assert served.loop.take(1) == ()


def test_who_leaves_no_room_for_an_answer_is_dropped_without_a_word(
    served: Served, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    client = served.client()
    (waiting,) = served.connections
    monkeypatch.setattr(http, "response", lambda *_: b"x" * 50_000_000)
    client.sendall(b"GET /state HTTP/1.1\r\n\r\n")
    served.server.turn()
    assert (served.connections, waiting.socket.fileno(), capsys.readouterr().err) == ([], -1, "")


def test_more_bytes_of_a_head_give_it_no_more_time(served: Served) -> None:
    client = served.client(b"POST /es")
    served.now += 1.5
    client.sendall(b"top")
    served.server.turn()
    served.now += 0.5
    served.server.turn()
    assert served.connections == []


def test_the_clock_of_a_head_begins_with_its_first_byte(served: Served) -> None:
    client = served.client()
    served.now += 30.0
    client.sendall(b"POST /es")
    served.server.turn()
    assert [waiting.since for waiting in served.connections] == [130.0]


def test_a_client_beyond_the_room_there_is_takes_the_place_of_the_oldest_that_waits_for_no_stop(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "CONNECTIONS", 3)
    clients = []
    for data in (PAIN, b"", b"", b""):
        clients.append(served.client(data))
        served.now += 0.01
    assert len(served.connections) == 3
    assert [hung_up(client) for client in clients] == [False, True, False, False]
    for client in clients[2:]:
        client.sendall(PAIN)
        served.server.turn()
    assert all(waiting.stop for waiting in served.connections)
    served.client()
    assert hung_up(clients[0]), "where all wait for a stop, the oldest has had its time"
    assert len(served.connections) == 3


def test_a_client_that_is_reset_is_forgotten(served: Served) -> None:
    before = open_files()
    client = served.client(b"POST")
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.close()
    served.server.turn()
    assert served.connections == []
    assert open_files() <= before


def test_a_client_that_was_told_to_go_may_send_so_much_and_wait_so_long(served: Served) -> None:
    client = served.client(b"\x00\r\n\r\n")
    (lingering,) = served.connections
    assert lingering.lingering
    told = client.recv(4096)
    assert told.startswith(b"HTTP/1.1 400 ")
    assert b"Access-Control" not in told
    assert hung_up(client)
    lingering.lingered_bytes = 65_526
    client.sendall(b"x" * 10)
    served.server.turn()
    assert (served.connections, lingering.lingered_bytes) == ([lingering], 65_536)
    client.sendall(b"x")
    served.server.turn()
    assert served.connections == []
    other = served.client(b"\x00\r\n\r\n")
    served.now += 0.499
    served.server.turn()
    assert len(served.connections) == 1
    served.now += 0.001
    served.server.turn()
    assert served.connections == []
    other.close()


def test_bytes_of_a_client_that_stays_are_not_counted_as_lingering(served: Served) -> None:
    served.client(PAIN)
    assert served.connections[0].lingered_bytes == 0


def test_whatever_goes_wrong_with_a_client_costs_that_client_alone(
    served: Served, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    client, look = served.client(), served.server._look_after

    def fails(waiting: Connection) -> None:
        raise ValueError("broken")

    monkeypatch.setattr(served.server, "_look_after", fails)
    served.now += 1.0
    served.server.turn()
    assert capsys.readouterr().err == "stop process: a connection was given up: ValueError: broken\n"
    assert served.connections == []
    assert hung_up(client)
    monkeypatch.setattr(served.server, "_look_after", look)
    served.client(PAIN)
    assert len(served.loop.take(1)) == 1


def test_a_listener_with_nobody_there_is_not_waited_for(served: Served) -> None:
    assert not served.listener.getblocking()
    served.server._accept()
    assert served.connections == []


def test_what_is_watched_is_called_until_it_is_not(served: Served) -> None:
    reading, writing = os.pipe()
    called: list[bytes] = []
    served.server.watch(reading, lambda: called.append(os.read(reading, 1)))
    os.write(writing, b"a")
    served.server.turn()
    served.server.unwatch(reading)
    os.write(writing, b"b")
    served.server.turn()
    assert called == [b"a"]
    os.close(reading)
    os.close(writing)


def test_the_end_hangs_up_on_everybody_and_gives_everything_back(tmp_path: Path) -> None:
    before = open_files()
    made = Served(tmp_path)
    client = made.client()
    made.server.close()
    assert hung_up(client)
    assert made.connections == []
    assert made.server._selector.get_map() is None
    assert made.listener.fileno() == -1
    client.close()
    made.page.close(unlink=True)
    assert open_files() <= before


def test_bounds_of_the_server() -> None:
    bounds = (module.CONFIRM_S, module.HEAD_S, module.IDLE_S, module.LINGER_S, module.LINGER_BYTES)
    assert bounds == (0.5, 2.0, 60.0, 0.5, 65_536)
    assert (module.CONNECTIONS, module.LONGEST_WAIT_S) == (64, 0.2)


def test_a_client_that_is_gone_already_is_let_go_without_a_word(
    served: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    def shutdown(_: int) -> None:
        raise OSError("not connected")

    gone = Connection(cast(socket.socket, SimpleNamespace(shutdown=shutdown)), 0.0)
    served.server._linger(gone)
    assert gone.lingering
    served.client()
    (waiting,) = served.connections
    served.now += 60.0
    served.server.turn()
    served.server._drop(waiting)
    assert (served.connections, capsys.readouterr().err) == ([], "")
