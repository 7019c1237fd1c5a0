"""The stop process: ``python -m controller.stop.server STOP_PATH LISTENER_FD KEYPAD_FD SETTINGS_JSON``.

It has a port of its own on 127.0.0.1, and a foot switch or keypad where one is configured::

    POST /estop, /pain, /stop   200 {"id", "kind", "confirmed": true, "done": what the loop did, "after_ms"}
                                504 {..., "confirmed": false, "done": "NOT CONFIRMED: use the hardware stop"}
    GET /state                  200 {"loop": "starting" | "running" | "silent" | "gone", "keypad", "last"}

Neither needs a token: whoever can press may press. Standard input is a pipe from the supervisor. The process goes on
when the supervisor is suspended or dies, as long as the loop lives, and ends with the loop; while the supervisor lives
it goes on without a loop too, and says that nothing is confirmed.
"""

import contextlib
import json
import os
import selectors
import signal
import socket
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import TypedDict

from controller.loop import realtime
from controller.stop import http
from controller.stop.keyboard import Keyboard
from controller.stop.keypad import Keys
from controller.stop.liveness import LoopLife
from controller.stop.word import LOOK_S, NOT_CONFIRMED, StopOutcome, StopReason, StopRequest, StopWord

ROUTES = {"/estop": StopReason.EMERGENCY, "/pain": StopReason.PAIN, "/stop": StopReason.STOP}
# The slowest loop looks every 20 ms, and one that is 100 ms late stops by itself; a person waits no longer than this
# before the hardware stop.
CONFIRM_S = 0.5
# A head comes in one piece; who takes longer has lost the network, or wants the connection and not the stop.
HEAD_S = 2.0
IDLE_S = 60.0
LINGER_S = 0.5
LINGER_BYTES = 65_536  # about a socket's buffer: what the other end may have sent before it reads the refusal
CONNECTIONS = 64  # many times the pages and keypads of a bench, and far below the 1024 descriptors of a process
LONGEST_WAIT_S = 0.2  # the loop takes five of them for silence


class StopSaid(TypedDict):
    """What became of a stop: the answer to whoever asked for it."""

    id: int
    kind: str
    confirmed: bool
    done: str
    after_ms: float


class StopState(TypedDict):
    """How loop and keypad are, how often the keypad was pressed, and the stop asked for last."""

    loop: str
    keypad: str
    presses: int
    last: StopSaid | None


@dataclass
class Connection:
    """One client, and the stop it waits for."""

    socket: socket.socket
    since: float
    parser: http.RequestParser = field(default_factory=http.RequestParser)
    asked: http.HttpRequest | None = None
    stop: StopRequest | None = None
    lingering: bool = False
    lingered_bytes: int = 0

    @property
    def next_waits(self) -> bool:
        """Whether a request has come that is its turn now."""
        return self.stop is None and not self.lingering and self.parser.whole

    @property
    def deadline(self) -> float:
        """When it is answered or closed whatever happens."""
        if self.lingering:
            return self.since + LINGER_S
        if self.stop:
            return self.since + CONFIRM_S
        return self.since + (HEAD_S if self.parser.begun else IDLE_S)


class StopServer:
    """Serves sockets and keypad in one thread; ``turn`` waits at most a fifth of a second."""

    def __init__(
        self, page: StopWord, listener: socket.socket, keyboard: Keyboard, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._page, self._listener, self._keyboard, self._now = page, listener, keyboard, now
        self._requester = keyboard.requester
        self._selector = selectors.DefaultSelector()
        listener.setblocking(False)
        self._selector.register(listener, selectors.EVENT_READ, self._accept)
        self._connections: dict[int, Connection] = {}
        self._last: StopSaid | None = None
        self.loop = LoopLife(page, now)

    def watch(self, fd: int, ready: Callable[[], None]) -> None:
        """Calls ``ready`` whenever ``fd`` can be read."""
        self._selector.register(fd, selectors.EVENT_READ, ready)

    def unwatch(self, fd: int) -> None:
        """No longer."""
        self._selector.unregister(fd)

    def turn(self) -> None:
        """Waits for something to do, and does it."""
        for key, _ in self._selector.select(self._wait_s()):
            key.data()
        self._keyboard.turn(self._selector, self._now())
        for connection in list(self._connections.values()):
            try:
                self._look_after(connection)
            except Exception as error:  # whatever a client brings about, the next press is to be taken
                sys.stderr.write(f"stop process: a connection was given up: {type(error).__name__}: {error}\n")
                self._drop(connection)

    def close(self) -> None:
        """Hangs up on everybody."""
        for connection in list(self._connections.values()):
            self._drop(connection)
        self._selector.close()
        self._listener.close()

    def _wait_s(self) -> float:
        connections = self._connections.values()
        if any(connection.next_waits for connection in connections):
            return 0.0
        return LOOK_S if any(connection.stop for connection in connections) else LONGEST_WAIT_S

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            client, _ = self._listener.accept()
            client.setblocking(False)
            if len(self._connections) >= CONNECTIONS:
                self._make_room()
            connection = Connection(client, self._now())
            self._connections[client.fileno()] = connection
            self._selector.register(client, selectors.EVENT_READ, lambda: self._read(connection))
            self._read(connection)

    def _make_room(self) -> None:
        idle = [connection for connection in self._connections.values() if not connection.stop]
        self._drop(min(idle or self._connections.values(), key=lambda connection: connection.since))

    def _read(self, connection: Connection) -> None:
        try:
            data = connection.socket.recv(http.HEADER_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        connection.lingered_bytes += len(data) if connection.lingering else 0
        if not data or connection.lingered_bytes > LINGER_BYTES:
            self._drop(connection)
        elif not connection.lingering:
            connection.since = connection.since if connection.stop or connection.parser.begun else self._now()
            connection.parser.put(data)

    def _hear(self, connection: Connection) -> None:
        found = connection.parser.following()
        if found is None:
            return
        connection.since = self._now()
        if isinstance(found, http.HttpRequest):
            found = http.foreign(found) or found
        if isinstance(found, http.Refusal):
            self._reply(connection, found.status, {"error": found.text})
        else:
            connection.asked = found
            self._do(connection, found)

    def _do(self, connection: Connection, request: http.HttpRequest) -> None:
        kind = ROUTES.get(request.path)
        if request.method == "OPTIONS":
            self._reply(connection, HTTPStatus.NO_CONTENT, None)
        elif request.path == "/state" and request.method == "GET":
            self._reply(connection, HTTPStatus.OK, self.state())
        elif kind is not None and request.method == "POST":
            connection.stop = self._requester.request(kind)
        elif kind is not None or request.path == "/state":
            self._reply(connection, HTTPStatus.METHOD_NOT_ALLOWED, {"error": "POST /estop, /pain, /stop; GET /state"})
        else:
            self._reply(connection, HTTPStatus.NOT_FOUND, {"error": "there are /estop, /pain, /stop and /state"})

    def _look_after(self, connection: Connection) -> None:
        stop = connection.stop
        answer = self._requester.answer(stop) if stop else None
        if stop and (answer or self._now() >= connection.deadline or self.loop.gone):
            connection.stop = None
            self._last = self._said(stop, answer, self._now() - connection.since)
            confirmed = answer is not None and answer.confirmed
            self._reply(connection, HTTPStatus.OK if confirmed else HTTPStatus.GATEWAY_TIMEOUT, self._last)
        elif connection.next_waits:
            self._hear(connection)
        elif not stop and self._now() >= connection.deadline:
            self._drop(connection)

    def _said(self, stop: StopRequest, answer: StopOutcome | None, after_s: float) -> StopSaid:
        confirmed = answer is not None and answer.confirmed
        why = answer.text if answer else "the loop's process is gone" if self.loop.gone else "the loop does not answer"
        return {
            "id": stop.id,
            "kind": stop.kind.name.lower(),
            "confirmed": confirmed,
            "done": why if confirmed else f"{NOT_CONFIRMED} ({why})",
            "after_ms": round(after_s * 1e3, 2),
        }

    def state(self) -> StopState:
        """How loop and keypad are, and the stop asked for last."""
        return {
            "loop": self.loop.state(),
            "keypad": self._page.keypad.name.lower(),
            "presses": self._keyboard.presses,
            "last": self._last,
        }

    def _reply(self, connection: Connection, status: HTTPStatus, body: Mapping[str, object] | None) -> None:
        asked, connection.asked = connection.asked, None
        keep = bool(asked and asked.keep)
        origin = asked.headers.get("origin", "") if asked else ""
        data = http.response(status, body, origin, keep)
        try:
            # A client that leaves no room for a few hundred bytes does not read.
            sent = connection.socket.send(data)
        except OSError:
            sent = 0
        connection.since = self._now()
        if sent < len(data):
            self._drop(connection)
        elif not keep:
            self._linger(connection)

    def _linger(self, connection: Connection) -> None:
        """Lets the client read its answer: to close on bytes that nobody read would take it back."""
        connection.lingering = True
        with contextlib.suppress(OSError):
            connection.socket.shutdown(socket.SHUT_WR)

    def _drop(self, connection: Connection) -> None:
        if self._connections.pop(connection.socket.fileno(), None):
            self._selector.unregister(connection.socket)
        connection.socket.close()


def serve(server: StopServer, parent: int, page: StopWord) -> None:
    """Until the loop has ended and the supervisor has closed the pipe ``parent``."""
    alone: list[bool] = []

    def hung_up() -> None:
        if not alone and not os.read(parent, 1):
            alone.append(True)
            server.unwatch(parent)

    server.watch(parent, hung_up)
    page.beat(time.monotonic_ns())
    page.serve(os.getpid())
    while not (alone and server.loop.over()):
        page.beat(time.monotonic_ns())
        server.turn()


def main(arguments: list[str]) -> int:
    """The process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    settings = json.loads(arguments[3])
    realtime.raise_priority(settings["priority"])
    page = StopWord.open(Path(arguments[0]))
    keys = Keys(
        {int(code): StopReason[kind] for code, kind in settings["keys"].items()}, StopReason[settings["other_keys"]]
    )
    keyboard = Keyboard(page, settings["keypad"], int(arguments[2]), keys, settings["keypad_required"])
    server = StopServer(page, socket.socket(fileno=int(arguments[1])), keyboard)
    try:
        serve(server, sys.stdin.fileno(), page)
    finally:
        server.close()
        page.close(unlink=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
