"""The process that takes stops from other computers, as the service has it: told, watched, replaced, ended."""

import os
import signal
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.cli.serve import run_service
from api.http.access.access import Access, cookie_name
from api.http.access.served_at import ServedAt, ServeOptions, served_at
from api.http.app import build
from api.http.service import Service
from api.http.stops import process as module
from api.http.stops.process import AwayStops
from api.http.streams.events import EventLog
from controller.stop.start import StartGuard
from controller.stop.word import Lane, Requester, Responder, StopReason, StopWord
from mock_devices.testing.commands import until
from rig.config.wiring import Wiring
from rig.errors import UsageError
from tests.api.access.tls import Files, made
from tests.api.stops.drill import ANN, NAME, PAGE, SERVICE_PORT, Away

LOADED_S = 60.0  # on a computer that does everything else first


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return made(tmp_path_factory.mktemp("tls"), NAME, "127.0.0.1")


def placed(files: Files, host: str = "127.0.0.1") -> ServedAt:
    return served_at(ServeOptions(host, SERVICE_PORT, (NAME,), files.certificate, files.key, "", 0))


class Kept:
    """The process, a service's logins and events, and a loop that answers."""

    def __init__(self, files: Files, folder: Path) -> None:
        self.access, self.events = Access(folder / "access"), EventLog()
        self.page = StopWord.create(folder / "a.stop")
        self.stops = AwayStops(placed(files), [socket.create_server(("127.0.0.1", 0))])
        self.files = files

    @property
    def codes(self) -> list[str]:
        return [event.code for event in self.events.after(0)]

    def ask(self, **headers: str) -> int:
        """What a browser is answered."""
        return Away.ask(self, **headers).status  # type: ignore[arg-type]

    port = property(lambda self: self.stops.port)
    connection = Away.connection


@contextmanager
def keeping(files: Files, folder: Path) -> Iterator[Kept]:
    found = Kept(files, folder)
    with StartGuard(Responder(found.page)), closing(found.stops), found.stops.running(found.access, found.events):
        found.stops.follow(found.page.path)
        until(lambda: found.codes == ["away-stops-ready"], LOADED_S, "the process serving")
        yield found
    found.page.close(unlink=True)


@pytest.fixture
def kept(files: Files, tmp_path: Path) -> Iterator[Kept]:
    with keeping(files, tmp_path) as found:
        yield found


def test_who_logs_in_after_its_start_may_stop_and_who_leaves_may_not(kept: Kept) -> None:
    _, secret = kept.access.logins.enter(ANN)
    cookie = f"{cookie_name(SERVICE_PORT)}={secret}"
    assert kept.ask(Cookie=cookie, Origin=PAGE) == 200
    kept.access.logins.browsers.drop(lambda caller: caller.name == "Ann")
    assert kept.ask(Cookie=cookie, Origin=PAGE) == 401
    assert kept.stops.address("bench") == f"https://bench:{kept.port}"
    assert kept.stops.address("2001:db8::7") == f"https://[2001:db8::7]:{kept.port}"


@pytest.mark.parametrize("end", [signal.SIGSTOP, signal.SIGKILL])
def test_one_that_is_frozen_or_dead_is_told_of_and_replaced_at_the_same_port(kept: Kept, end: signal.Signals) -> None:
    before = kept.stops.pid
    os.kill(before, end)
    here = Requester(kept.page, Lane.STOP_PROCESS)
    assert here.confirmed(here.request(StopReason.EMERGENCY), LOADED_S), "the bench's own computer does not wait for it"
    until(lambda: kept.codes[1:2] == ["away-stops-lost"], LOADED_S, "its loss being told of")
    until(lambda: kept.codes[2:] == ["away-stops-ready"], LOADED_S, "another serving")
    assert kept.stops.pid != before
    _, secret = kept.access.logins.enter(ANN)
    assert kept.ask(Cookie=f"{cookie_name(SERVICE_PORT)}={secret}", Origin=PAGE) == 200


def test_a_new_bench_is_followed(kept: Kept, tmp_path: Path) -> None:
    sent = f"Bearer {kept.access.tokens.create('program', ANN.scope).secret}"
    assert kept.ask(Authorization=sent) == 200
    other = StopWord.create(tmp_path / "b.stop")
    with StartGuard(Responder(other)):
        kept.stops.follow(other.path)
        assert kept.ask(Authorization=sent) == 200
        assert Requester(other, Lane.AWAY).request(StopReason.STOP).id == 2, "it was asked for there"
    other.close(unlink=True)


def test_it_ends_with_the_service_and_leaves_nothing(files: Files, tmp_path: Path) -> None:
    with keeping(files, tmp_path) as kept:
        (known,) = Path("/dev/shm").glob(f"tissue-rig-*-{os.getpid()}-*.stops")
        assert oct(known.stat().st_mode & 0o777) == "0o600"
        pid = kept.stops.pid
    assert kept.codes == ["away-stops-ready"], "an end that was asked for is no loss"
    assert not known.exists()
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
    with socket.create_server(("127.0.0.1", kept.port)):
        pass


def test_the_service_says_where_it_is_and_lets_the_page_ask_there(
    files: Files, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MODULE", "nothing")
    service = Service(Wiring(), tmp_path, tmp_path)
    plain = TestClient(build(service), base_url="http://127.0.0.1:8000").get("/api/v1/info")
    assert plain.json()["away_stops"] == ""
    assert "https:" not in plain.headers["Content-Security-Policy"]
    with closing(AwayStops(placed(files), [socket.create_server(("127.0.0.1", 0))])) as stops:
        service.away = stops
        client = TestClient(build(service, names=(NAME,)), base_url=PAGE)
        assert client.get("/api/v1/info").json()["away_stops"] == "", "it does not serve yet"
        stops._serving = True
        told = client.get("/api/v1/info")
        assert told.json()["away_stops"] == f"https://{NAME}:{stops.port}"
        assert (
            f"connect-src 'self' http://127.0.0.1:* http://localhost:* https://*:{stops.port};"
            in (told.headers["Content-Security-Policy"])
        )
    proxied = served_at(ServeOptions("127.0.0.1", 1, (), None, None, f"https://{NAME}", 0))
    with closing(AwayStops(proxied, [socket.create_server(("127.0.0.1", 0))])) as stops:
        stops._serving = True
        assert stops.address(NAME) == f"https://{NAME}/stops"


def test_its_port_is_near_the_services_or_the_one_asked_for(files: Files, tmp_path: Path) -> None:
    def port(of: int, asked: int | None = None) -> int:
        return served_at(ServeOptions("127.0.0.1", of, (), files.certificate, files.key, "", asked)).stop_port

    assert (port(8443), port(8443, 9000), port(65_535)) == (8445, 9000, 65_535)
    with socket.create_server(("127.0.0.1", 0)) as listening:
        taken: int = listening.getsockname()[1]
        place = replace(placed(files), port=0, stop_port=taken)
        with pytest.raises(UsageError, match=rf"--stop-port {taken}: Address already in use; end what"):
            run_service(Wiring(), place, tmp_path, tmp_path)
