"""Stops from other computers, tried over real TLS and sockets: what has to hold, each a function that asserts it."""

import asyncio
import contextlib
import http.client
import json
import os
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from api.http.access.access import Access, cookie_name
from api.http.access.logins import LOGIN_S
from api.http.access.scopes import Caller, Scope
from api.http.access.secrets import awake_s
from api.http.access.served_at import tls_context
from api.http.access.store import PrivateFile
from api.http.stops import server as module
from api.http.stops.known import AwaySettings, Known
from controller.stop.start import StartGuard
from controller.stop.word import Lane, Requester, Responder, StopReason, StopWord
from tests.api.access.tls import Files

NAME = "bench.example.org"
SERVICE_PORT = 8443
PAGE = f"https://{NAME}:{SERVICE_PORT}"
HELD = "nothing was moving: the bench does not start"


class Answer(NamedTuple):
    """What came of one request."""

    status: int
    headers: http.client.HTTPMessage
    said: dict[str, Any]


@dataclass
class Away:
    """The server in a thread, what it is told by a service, and a loop that answers."""

    port: int
    files: Files | None
    access: Access
    known: PrivateFile[Known]
    page: StopWord
    answering: threading.Event
    """The loop answers while it is set."""

    def tell(self) -> None:
        """As the service does."""
        self.known.write(Known(page=str(self.page.path), logins=self.access.logins.browsers.held))

    def cookie(self, caller: Caller) -> str:
        """Of a browser that has logged in just now."""
        _, secret = self.access.logins.enter(caller)
        self.tell()
        return f"{cookie_name(SERVICE_PORT)}={secret}"

    def connection(self) -> http.client.HTTPConnection:
        """To its port."""
        if self.files is None:
            return http.client.HTTPConnection("127.0.0.1", self.port, timeout=20)
        return http.client.HTTPSConnection("127.0.0.1", self.port, context=self.files.trusting, timeout=20)

    def ask(self, path: str = "/estop", method: str = "POST", body: str = "", **headers: str) -> Answer:
        """One request from another computer, as a page may send it without asking first."""
        sent = {"Host": f"{NAME}:{self.port}", "Content-Type": "text/plain"}
        sent |= {name.replace("_", "-"): value for name, value in headers.items()}
        with contextlib.closing(self.connection()) as connection:
            connection.request(method, path, body or None, sent)
            answer = connection.getresponse()
            return Answer(answer.status, answer.headers, json.loads(answer.read()))

    def bearer(self, scope: Scope = Scope.READ) -> str:
        """Of a new token."""
        return f"Bearer {self.access.tokens.create(f'drill-{os.urandom(4).hex()}', scope).secret}"


@contextlib.contextmanager
def away(folder: Path, files: Files | None) -> Iterator[Away]:
    """With ``files`` under that certificate, without behind a proxy."""
    page = StopWord.create(folder / "a.stop")
    known, access = PrivateFile(folder / "known.stops", Known()), Access(folder / "access")
    answering = threading.Event()
    answering.set()
    listener = socket.create_server(("127.0.0.1", 0))
    settings = AwaySettings(
        known=known.path, access=access.folder, names=(NAME,), files=files and (files.certificate, files.key),
        service_port=SERVICE_PORT, page_port=SERVICE_PORT,
    )  # fmt: skip
    tls = tls_context(files.certificate, files.key) if files else None
    found = Away(listener.getsockname()[1], files, access, known, page, answering)
    found.tell()
    with StartGuard(Sleepy(page, answering)), listener, served(module.AwayServer(settings, tls), listener):
        yield found
    page.close(unlink=True)


@contextlib.contextmanager
def served(server: module.AwayServer, listener: socket.socket) -> Iterator[None]:
    """In a thread."""
    ends, ending = socket.socketpair()

    async def serve() -> None:
        accepting = asyncio.create_task(server.accept(listener))
        ending.setblocking(False)
        await asyncio.get_running_loop().sock_recv(ending, 1)
        accepting.cancel()

    thread = threading.Thread(target=lambda: asyncio.run(serve()))
    thread.start()
    try:
        yield
    finally:
        ends.close()
        thread.join()
        ending.close()


class Sleepy(Responder):
    """A loop that looks away while ``answering`` is not set."""

    def __init__(self, page: StopWord, answering: threading.Event) -> None:
        super().__init__(page)
        self._answering = answering

    def take(self, now_ns: int) -> Any:
        """What is asked, where it looks."""
        return super().take(now_ns) if self._answering.is_set() else ()


def a_right_is_needed(at: Away) -> None:
    """From elsewhere, and any will do."""
    assert at.ask().status == 401
    assert at.ask(Authorization="Bearer rig_wrong").status == 401
    assert at.ask(Authorization=at.bearer(Scope.READ)).status == 200


def a_token_that_was_revoked_is_none(at: Away) -> None:
    """From the next request on."""
    made = at.access.tokens.create("leaves", Scope.ADMIN)
    sent = f"Bearer {made.secret}"
    assert at.ask(Authorization=sent).status == 200
    at.access.tokens.revoke("leaves")
    assert at.ask(Authorization=sent).status == 401


ANN = Caller("Ann", Scope.READ, "", "link")


def a_login_that_is_over_is_none(at: Away) -> None:
    """It was told of while it was good: nobody tells that its time is up."""
    at.access.logins.browsers._now_s = lambda: awake_s() - LOGIN_S - 1
    over = at.cookie(ANN)
    assert at.ask(Cookie=over, Origin=PAGE).status == 401


def a_browser_that_logged_in_may_and_one_that_left_may_not(at: Away) -> None:
    """By what the service has told."""
    cookie = at.cookie(ANN)
    assert at.ask(Cookie=cookie, Origin=PAGE).status == 200
    at.access.logins.browsers.drop(lambda caller: caller.name == "Ann")
    at.tell()
    assert at.ask(Cookie=cookie, Origin=PAGE).status == 401


def only_the_services_own_page_may(at: Away) -> None:
    """A cookie is sent along with what any page asks for; also on the bench's own computer."""
    cookie = at.cookie(ANN)
    for origin in ("https://evil.example", f"http://{NAME}:{SERVICE_PORT}", f"https://{NAME}", "null", ""):
        assert at.ask(Cookie=cookie, Origin=origin).status == 403, origin
        assert at.ask(Host="localhost", Origin=origin).status == 403, origin
    assert at.ask(Cookie=cookie).status == 403
    assert at.ask(Host=f"evil.example:{at.port}", Origin=f"https://evil.example:{SERVICE_PORT}").status == 403


def its_page_may_read_the_answer_and_no_other(at: Away) -> None:
    """Without having asked before: what it sends is a simple request."""
    answer = at.ask(Cookie=at.cookie(ANN), Origin=PAGE)
    assert answer.headers["Access-Control-Allow-Origin"] == PAGE
    assert answer.headers["Access-Control-Allow-Credentials"] == "true"
    assert at.ask(Origin=PAGE).headers["Access-Control-Allow-Origin"] == PAGE
    assert at.ask(Origin="https://evil.example").headers["Access-Control-Allow-Origin"] is None


def each_answer_has_the_id_of_its_stop(at: Away) -> None:
    """And says what the loop did about it."""
    sent = at.bearer()
    for number, (path, kind) in enumerate((("/estop", "emergency"), ("/pain", "pain"), ("/stop", "stop")), 1):
        said = at.ask(path, Authorization=sent).said
        assert 0 <= said.pop("after_ms") < 500
        assert said == {"id": number, "kind": kind, "confirmed": True, "done": HELD}


def what_the_loop_does_not_confirm_is_not_confirmed(at: Away) -> None:
    """Within half a second, and a person is told what to do."""
    at.answering.clear()
    answer = at.ask(Authorization=at.bearer())
    assert (answer.status, answer.said["confirmed"]) == (504, False)
    assert answer.said["done"] == "NOT CONFIRMED: use the hardware stop (the loop does not answer)"
    at.known.write(Known())
    assert at.ask(Authorization=at.bearer()).status == 503
    at.answering.set()


def the_local_stops_lane_is_untouched(at: Away) -> None:
    """Its first stop is its first."""
    sent = at.bearer()
    for _ in range(3):
        at.ask(Authorization=sent)
    for lane in (Lane.STOP_PROCESS, Lane.SUPERVISOR):
        here = Requester(at.page, lane)
        assert here.confirmed(here.request(StopReason.EMERGENCY), 5.0) is not None
        assert here.request(StopReason.STOP).id == 2, "one stop was asked for here"


def a_body_without_end_is_cut_off(at: Away) -> None:
    """The stop is done by its head; of the rest little is taken."""
    taken, began_s = 0, time.monotonic()
    with contextlib.closing(at.connection()) as connection, contextlib.suppress(OSError):
        connection.connect()
        head = ("POST /estop HTTP/1.1", f"Host: {NAME}", f"Authorization: {at.bearer()}", "Content-Length: 99999999999")
        connection.sock.sendall("\r\n".join([*head, "", ""]).encode())
        connection.sock.settimeout(2.0)
        while taken < 64_000_000:
            taken += connection.sock.send(bytes(65_536))
    assert taken < 16_000_000
    assert time.monotonic() - began_s < 10
    assert Requester(at.page, Lane.AWAY).request(StopReason.EMERGENCY).id == 2, "it was asked for"


def a_head_without_end_is_refused(at: Away) -> None:
    """A limit, a sentence, and the next is served."""
    assert at.ask(X_Long="a" * 9000, Authorization="x").status == 431
    assert at.ask("/nothing", Authorization=at.bearer()).status == 404
    assert at.ask("/stop", "GET", Authorization=at.bearer()).status == 405


def connections_are_bounded(at: Away) -> None:
    """200 that never finish their handshakes, and a stop among them."""
    with contextlib.ExitStack() as stack:
        silent = [stack.enter_context(socket.create_connection(("127.0.0.1", at.port), 20)) for _ in range(200)]
        assert at.ask(Authorization=at.bearer()).status == 200
        assert sum(closed(one, within_s=0.0) for one in silent) >= 200 - 64


def who_begins_and_does_not_go_on_keeps_no_connection(at: Away) -> None:
    """Neither before the handshake nor within a head."""
    with socket.create_connection(("127.0.0.1", at.port), 20) as silent:
        assert closed(silent, within_s=5.0)
    with contextlib.closing(at.connection()) as slow:
        slow.connect()
        slow.sock.sendall(b"POST /estop HTT")
        assert closed(slow.sock, within_s=5.0)


def closed(client: socket.socket, within_s: float) -> bool:
    """Whether the other end has hung up."""
    client.settimeout(within_s)
    try:
        return client.recv(1) == b""
    except (TimeoutError, BlockingIOError):
        return False
    except (ssl.SSLError, OSError):
        return True


def malformed_requests_stop_nothing_and_hold_nothing_up(at: Away) -> None:
    """What is no TLS, and what is no HTTP."""
    with socket.create_connection(("127.0.0.1", at.port), 20) as plain:
        plain.sendall(b"POST /estop HTTP/1.1\r\n\r\n")
        plain.settimeout(20)
        with contextlib.suppress(OSError):
            while plain.recv(1000):
                pass
    with contextlib.closing(at.connection()) as other:
        other.connect()
        other.sock.sendall(b"\x00\xff nothing\r\n\r\n")
        assert other.sock.recv(1000).startswith(b"HTTP/1.1 400 ")
    assert Requester(at.page, Lane.AWAY).request(StopReason.STOP).id == 1


def on_this_computer_none_is_asked_for(at: Away) -> None:
    """Whatever became of the files of tokens."""
    (at.access.folder / "tokens.json").parent.mkdir(parents=True, exist_ok=True)
    (at.access.folder / "tokens.json").write_text("broken")
    for host in ("127.0.0.1", "localhost"):
        assert at.ask(Host=f"{host}:{at.port}").status == 200
        assert at.ask(Host=f"{host}:{at.port}", Origin=f"https://{host}:{SERVICE_PORT}").status == 200
    assert at.ask(Host="localhost", X_Forwarded_For="192.0.2.7").status == 401
    assert at.ask(Authorization="Bearer rig_any").status == 503
    (at.access.folder / "tokens.json").unlink()


def who_stopped_is_in_the_audit_log(at: Away) -> None:
    """By the name of the token."""
    made = at.access.tokens.create("watch", Scope.READ)
    at.ask("/pain", Authorization=f"Bearer {made.secret}")
    deadline = time.monotonic() + 20
    while not list(at.access.audit.lines()) and time.monotonic() < deadline:
        time.sleep(0.01)
    line = list(at.access.audit.entries())[-1]
    assert (line.who, line.what) == ("watch", "POST /pain beside the service")
    assert line.outcome == f"200 {HELD}"


Check = Callable[[Away], None]
CHECKS: tuple[Check, ...] = (
    a_right_is_needed, a_token_that_was_revoked_is_none, a_login_that_is_over_is_none,
    a_browser_that_logged_in_may_and_one_that_left_may_not, only_the_services_own_page_may,
    its_page_may_read_the_answer_and_no_other, each_answer_has_the_id_of_its_stop,
    what_the_loop_does_not_confirm_is_not_confirmed, the_local_stops_lane_is_untouched, a_body_without_end_is_cut_off,
    a_head_without_end_is_refused, connections_are_bounded, who_begins_and_does_not_go_on_keeps_no_connection,
    malformed_requests_stop_nothing_and_hold_nothing_up, on_this_computer_none_is_asked_for,
    who_stopped_is_in_the_audit_log,
)  # fmt: skip
