"""Stops from other computers hold what they promise, and each promise is seen broken where its bug is planted."""

from collections.abc import Callable, Iterator
from http import HTTPStatus
from pathlib import Path
from types import SimpleNamespace

import pytest

from api.http.access.logins import Passes
from api.http.access.store import PrivateFile
from api.http.stops import server as module
from api.http.stops.server import AwayServer
from controller.stop.server import StopSaid
from controller.stop.word import Lane, StopReason
from tests.api.access.tls import Files, made
from tests.api.stops import drill
from tests.api.stops.drill import CHECKS, NAME, PAGE, Away, Check, away

Plant = Callable[[pytest.MonkeyPatch], None]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return made(tmp_path_factory.mktemp("tls"), NAME, "127.0.0.1")


@pytest.fixture
def at(tmp_path: Path, files: Files, monkeypatch: pytest.MonkeyPatch) -> Iterator[Away]:
    monkeypatch.setattr(module, "CONNECTION_S", 2.0)
    with away(tmp_path, files) as found:
        yield found


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_it_holds(at: Away, check: Check) -> None:
    check(at)


def rights_unchecked(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(module, "_unentitled", lambda *_: None)


def tokens_read_once(patch: pytest.MonkeyPatch) -> None:
    read = PrivateFile.read
    patch.setattr(PrivateFile, "read", lambda self: self._content if self._seen else read(self))


def logins_for_ever(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Passes, "_in_force", lambda self: self._passes)


def pages_unchecked(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(AwayServer, "_foreign", lambda *_: None)


def every_page_may_read(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(AwayServer, "_page_at", lambda *_: "https://evil.example")


def no_id(patch: pytest.MonkeyPatch) -> None:
    stopped = AwayServer._stopped

    async def without(self: AwayServer, kind: StopReason) -> tuple[HTTPStatus, StopSaid]:
        status, said = await stopped(self, kind)
        return status, {**said, "id": 0}

    patch.setattr(AwayServer, "_stopped", without)


def confirmed_by_nobody(patch: pytest.MonkeyPatch) -> None:
    stopped = AwayServer._stopped

    async def hopeful(self: AwayServer, kind: StopReason) -> tuple[HTTPStatus, StopSaid]:
        _, said = await stopped(self, kind)
        return HTTPStatus.OK, said

    patch.setattr(AwayServer, "_stopped", hopeful)


def the_local_lane(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(module, "Lane", SimpleNamespace(AWAY=Lane.STOP_PROCESS))


def the_supervisors_lane(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(module, "Lane", SimpleNamespace(AWAY=Lane.SUPERVISOR))


def no_end_to_a_body(patch: pytest.MonkeyPatch) -> None:
    for limit in ("LINGER_BYTES", "LINGER_S", "CONNECTION_S"):
        patch.setattr(module, limit, 1e9)


def no_end_to_connections(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(module, "CONNECTIONS", 10_000)
    patch.setattr(module, "CONNECTION_S", 1e9)


def no_end_to_waiting(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(module, "CONNECTION_S", 1e9)


def rights_asked_for_here(patch: pytest.MonkeyPatch) -> None:
    patch.setattr("api.http.access.arrived.LOOPBACK", ())


PLANTS: dict[Plant, Check] = {
    rights_unchecked: drill.a_right_is_needed,
    tokens_read_once: drill.a_token_that_was_revoked_is_none,
    logins_for_ever: drill.a_login_that_is_over_is_none,
    pages_unchecked: drill.only_the_services_own_page_may,
    every_page_may_read: drill.its_page_may_read_the_answer_and_no_other,
    no_id: drill.each_answer_has_the_id_of_its_stop,
    confirmed_by_nobody: drill.what_the_loop_does_not_confirm_is_not_confirmed,
    the_local_lane: drill.the_local_stops_lane_is_untouched,
    the_supervisors_lane: drill.the_local_stops_lane_is_untouched,
    no_end_to_a_body: drill.a_body_without_end_is_cut_off,
    no_end_to_connections: drill.connections_are_bounded,
    no_end_to_waiting: drill.who_begins_and_does_not_go_on_keeps_no_connection,
    rights_asked_for_here: drill.on_this_computer_none_is_asked_for,
}


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: plant.__name__)
def test_its_absence_is_seen(at: Away, monkeypatch: pytest.MonkeyPatch, plant: Plant) -> None:
    plant(monkeypatch)
    with pytest.raises(AssertionError):
        PLANTS[plant](at)


def test_behind_a_proxy_every_stop_needs_a_right(tmp_path: Path) -> None:
    with away(tmp_path, None) as at:
        assert at.ask(Host="127.0.0.1").status == 401
        assert at.ask(Host=NAME, X_Forwarded_For="192.0.2.7").status == 401
        assert at.ask(Host=NAME, Cookie=at.cookie(drill.ANN), Origin=PAGE).status == 200
