"""The stop process over real sockets, with a loop played by a thread: answers, limits, clients that misbehave."""

import contextlib
import http.client
import json
import os
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from controller.stop import keyboard
from controller.stop import server as module
from controller.stop.keyboard import Keyboard
from controller.stop.keypad import Keys, open_device
from controller.stop.server import CONFIRM_S, CONNECTIONS, StopServer
from controller.stop.word import NOT_CONFIRMED, Deed, Keypad, Responder, StopReason, StopRequest, StopWord

KEYS = Keys({48: StopReason.PAIN}, StopReason.EMERGENCY)
PRESS_B = struct.pack("<qqHHi", 0, 0, 1, 48, 1)


class Stopped:
    """A server in a thread, and a loop in another that answers everything with ``deed``; None: it does not answer."""

    def __init__(self, folder: Path, keypad: str = "", required: bool = False) -> None:
        self.page = StopWord.create(folder / "a.stop")
        self.deed: Deed | None = Deed.RETRACTING
        self.taken: list[StopRequest] = []
        self._responder = Responder(self.page)
        listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = listener.getsockname()[1]
        keys = Keyboard(self.page, keypad, open_device(keypad) if keypad else -1, KEYS, required)
        self.server = StopServer(self.page, listener, keys)
        self._over = threading.Event()
        self._threads = [threading.Thread(target=self._serve), threading.Thread(target=self._cycle)]
        for thread in self._threads:
            thread.start()

    def _serve(self) -> None:
        while not self._over.is_set():
            self.server.turn()

    def _cycle(self) -> None:
        while not self._over.wait(0.001):
            for request in self._responder.take(time.monotonic_ns()):
                if request not in self.taken:
                    self.taken.append(request)
            if self.deed:
                self._responder.answer(self.deed, time.monotonic_ns())

    def lost(self) -> int:
        """Stops for want of the keypad."""
        return len([request for request in self.taken if request.kind is StopReason.KEYPAD_LOST])

    def post(self, path: str, **headers: str) -> tuple[int, dict[str, Any]]:
        """A request on a connection of its own."""
        with self.connected() as client:
            return asked(client, "POST", path, headers)

    @contextlib.contextmanager
    def connected(self) -> Iterator[http.client.HTTPConnection]:
        """A connection."""
        client = http.client.HTTPConnection("127.0.0.1", self.port, timeout=10)
        try:
            yield client
        finally:
            client.close()

    def raw(self) -> socket.socket:
        """A bare connection."""
        return socket.create_connection(("127.0.0.1", self.port), 10)

    def close(self) -> None:
        self._over.set()
        for thread in self._threads:
            thread.join()
        self.server.close()
        self.page.close(unlink=True)


def asked(client: http.client.HTTPConnection, method: str, path: str, headers: dict[str, str]) -> tuple[int, Any]:
    client.request(method, path, headers=headers)
    answer = client.getresponse()
    body = answer.read()
    return answer.status, json.loads(body) if body else None


def until(condition: Any, what: str, within_s: float = 10.0) -> None:
    deadline = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.005)


@pytest.fixture
def stopped(tmp_path: Path) -> Iterator[Stopped]:
    served = Stopped(tmp_path)
    yield served
    served.close()


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("/estop", StopReason.EMERGENCY),
        ("/pain", StopReason.PAIN),
        ("/stop", StopReason.STOP),
        ("/pain?x=1", StopReason.PAIN),
    ],
)
def test_a_stop_is_answered_with_its_id_and_what_the_loop_did(stopped: Stopped, path: str, kind: StopReason) -> None:
    status, said = stopped.post(path)
    assert status == 200
    assert (said["id"], said["kind"], said["confirmed"], said["done"]) == (1, kind.name.lower(), True, "retracting")
    assert said["after_ms"] < 1e3 * CONFIRM_S
    assert stopped.taken == [StopRequest(1, kind)]


def test_a_second_press_has_an_id_of_its_own_and_is_confirmed_too(stopped: Stopped) -> None:
    with stopped.connected() as client:
        found = [asked(client, "POST", "/pain", {}) for _ in range(3)]
    assert [(status, said["id"], said["confirmed"]) for status, said in found] == [(200, n, True) for n in (1, 2, 3)]


@pytest.mark.parametrize(
    ("deed", "why"), [(None, "the loop does not answer"), (Deed.AXIS_LOST, "the axis does not answer the loop")]
)
def test_what_the_loop_does_not_confirm_is_said_in_time(stopped: Stopped, deed: Deed | None, why: str) -> None:
    stopped.deed = deed
    began = time.monotonic()
    status, said = stopped.post("/estop")
    assert time.monotonic() - began < CONFIRM_S + 1.0
    assert (status, said["confirmed"], said["done"]) == (504, False, f"{NOT_CONFIRMED} ({why})")


def test_a_loop_that_has_ended_confirms_nothing(stopped: Stopped) -> None:
    stopped.deed = None
    ended = subprocess.Popen([sys.executable, "-c", "pass"])
    stopped.page.words[1] = ended.pid
    ended.wait()
    status, said = stopped.post("/pain")
    assert (status, said["done"]) == (504, f"{NOT_CONFIRMED} (the loop's process is gone)")
    with stopped.connected() as client:
        assert asked(client, "GET", "/state", {})[1]["loop"] == "gone"


def test_the_state_says_how_loop_and_keypad_are_and_what_came_last(stopped: Stopped) -> None:
    until(lambda: stopped.page.loop_beat_ns, "a cycle")
    said = stopped.post("/pain")[1]
    with stopped.connected() as client:
        assert asked(client, "GET", "/state", {}) == (
            200,
            {"loop": "running", "keypad": "none", "presses": 0, "last": said},
        )


def test_a_local_page_may_ask_and_read_the_answer_and_no_other(stopped: Stopped) -> None:
    status, _ = stopped.post("/estop", Origin="http://127.0.0.1:8000")
    assert status == 200
    status, said = stopped.post("/estop", Origin="https://evil.example")
    assert (status, said) == (403, {"error": "a page of https://evil.example may not stop this bench"})
    assert stopped.post("/estop", Host="evil.example")[0] == 403
    assert len(stopped.taken) == 1
    with stopped.connected() as client:
        client.request("OPTIONS", "/estop", headers={"Origin": "http://localhost:8000"})
        answer = client.getresponse()
        assert (answer.status, answer.read()) == (204, b"")
        assert answer.headers["Access-Control-Allow-Origin"] == "http://localhost:8000"


@pytest.mark.parametrize(
    ("method", "path", "status"), [("GET", "/estop", 405), ("POST", "/state", 405), ("POST", "/nothing", 404)]
)
def test_what_there_is_not_is_said(stopped: Stopped, method: str, path: str, status: int) -> None:
    with stopped.connected() as client:
        assert asked(client, method, path, {})[0] == status
    assert stopped.taken == []


def test_requests_in_one_piece_are_answered_one_after_the_other(stopped: Stopped) -> None:
    with stopped.raw() as client:
        client.sendall(b"POST /pain HTTP/1.1\r\n\r\n" * 3)
        text = b""
        while text.count(b'"confirmed": true') < 3:
            piece = client.recv(4096)
            assert piece, text
            text += piece
    assert [request.id for request in stopped.taken] == [1, 2, 3]


def test_a_body_of_a_gigabyte_is_not_read_and_the_stop_is_taken_at_once(stopped: Stopped) -> None:
    with stopped.raw() as client:
        client.sendall(b"POST /estop HTTP/1.1\r\nContent-Length: 1000000000\r\n\r\n" + b"x" * 20_000)
        answer = client.recv(4096)
        assert answer.startswith(b"HTTP/1.1 200 OK")
        assert b"Connection: close" in answer
        sent = 0
        with contextlib.suppress(ConnectionError):
            while sent < 50_000_000:
                sent += client.send(b"x" * 65_536)
    assert sent < 50_000_000
    assert stopped.post("/pain")[0] == 200


def test_malformed_and_endless_heads_are_refused_and_hung_up_on(stopped: Stopped) -> None:
    for data, status in ((b"\x00\x01\x02\r\n\r\n", b"400"), (b"A" * 9000, b"431")):
        with stopped.raw() as client:
            client.sendall(data)
            assert client.recv(4096).split(b" ")[1] == status
            assert client.recv(4096) == b""
    assert stopped.post("/pain")[0] == 200


def test_a_head_that_dawdles_is_hung_up_on(stopped: Stopped, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "HEAD_S", 0.2)
    with stopped.raw() as client:
        client.sendall(b"POST /est")
        client.settimeout(5)
        assert client.recv(10) == b""


def test_more_clients_than_there_is_room_for_do_not_keep_a_stop_out(stopped: Stopped) -> None:
    with contextlib.ExitStack() as opened:
        for number in range(CONNECTIONS + 20):
            client = opened.enter_context(stopped.raw())
            if number % 2:
                client.sendall(b"POST /estop HTTP/1.1\r\n")
        assert stopped.post("/estop")[0] == 200


def test_a_client_that_reads_nothing_is_dropped_and_holds_up_nobody(stopped: Stopped) -> None:
    with stopped.raw() as client:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.settimeout(0.2)
        with contextlib.suppress(OSError):
            for _ in range(20_000):
                client.sendall(b"GET /state HTTP/1.1\r\n\r\n" * 50)
        assert stopped.post("/estop")[0] == 200


def test_a_foot_switch_is_a_stop(tmp_path: Path) -> None:
    path = tmp_path / "pad"
    os.mkfifo(path)
    writer = os.open(path, os.O_RDWR)
    stopped = Stopped(tmp_path, str(path))
    try:
        assert stopped.page.keypad is Keypad.OK
        os.write(writer, PRESS_B[:11])
        time.sleep(0.05)
        assert stopped.taken == []
        os.write(writer, PRESS_B[11:] + struct.pack("<qqHHi", 0, 0, 1, 30, 1))
        until(lambda: len(stopped.taken) == 2, "both keys")
        assert {request.kind for request in stopped.taken} == {StopReason.PAIN, StopReason.EMERGENCY}
    finally:
        os.close(writer)
        stopped.close()


@pytest.mark.parametrize("required", [True, False])
def test_a_keypad_that_is_pulled_out_is_shown_and_stops_where_it_is_required(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, required: bool
) -> None:
    monkeypatch.setattr(keyboard, "RETRY_S", 0.05)
    path = tmp_path / "pad"
    os.mkfifo(path)
    writer = os.open(path, os.O_RDWR)
    stopped = Stopped(tmp_path, str(path), required)
    try:
        path.unlink()
        os.close(writer)
        until(lambda: stopped.page.keypad is Keypad.LOST, "the loss")
        if required:
            until(lambda: stopped.lost() > 1, "a stop again and again: it cannot be acknowledged away")
        else:
            time.sleep(0.5)
            assert stopped.lost() == 0
        os.mkfifo(path)
        writer = os.open(path, os.O_RDWR)
        until(lambda: stopped.page.keypad is Keypad.OK, "its return")
        os.write(writer, PRESS_B)
        until(lambda: stopped.taken and stopped.taken[-1].kind is StopReason.PAIN, "a press after its return")
        os.close(writer)
    finally:
        stopped.close()
