"""A takeover while the bench recovers, starts or changes its subject: by rule, and nothing more of it moves."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.http.access.scopes import Scope
from api.http.service import Service
from controller.recovery.situation import Consent
from controller.supervisor import NOT_IN_CONTROL
from mock_devices.testing.access import bearer, client_of, in_control
from mock_devices.testing.commands import until
from rig.config.wiring import Wiring
from rig.errors import SafetyStop
from rig.results.bench import ResetResult
from tests.api.test_http_recover import DONE, ScriptedBench

CONSENT = {"clear": True, "retract": True, "home": True}
PATIENCE_S = 20.0


class HomingBench(ScriptedBench):
    """Its recovery homes until ``over`` is set, then looks whether whoever began it still is in control."""

    def __init__(self) -> None:
        super().__init__()
        self.homes, self.over = threading.Event(), threading.Event()
        self.stopped = 0
        self.attended: Callable[[], bool] = lambda: True

    def stop(self) -> None:
        self.stopped += 1
        self.over.set()

    def recover(self, consent: Consent) -> ResetResult:
        self.homes.set()
        assert self.over.wait(PATIENCE_S)
        if not self.attended():
            raise SafetyStop(NOT_IN_CONTROL, "operator_silent")
        return super().recover(consent)


@pytest.fixture
def service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Service:
    found = Service(Wiring(), tmp_path / "sessions", tmp_path)
    monkeypatch.setattr(found, "connect", lambda: None)
    return found


@pytest.fixture
def bench(service: Service) -> HomingBench:
    made = HomingBench()
    made.attended = service.attended
    service.bench = made  # type: ignore[assignment]
    return made


@pytest.fixture
def client(service: Service) -> TestClient:
    """In control."""
    return in_control(client_of(service), "Ann")


@pytest.fixture
def recovering(client: TestClient, bench: HomingBench) -> Iterator[list[Any]]:
    """A recovery under way; its answer comes into the list."""
    answers: list[Any] = []
    asking = threading.Thread(target=lambda: answers.append(client.post("/api/v1/recover", json=CONSENT)))
    asking.start()
    assert bench.homes.wait(PATIENCE_S)
    yield answers
    bench.over.set()
    asking.join()


def taken_over(client: TestClient, scope: Scope) -> Any:
    return client.post("/api/v1/control/take", json={"holder": "Ben", "reason": "she left"}, headers=bearer(scope))


def test_while_a_recovery_moves_only_an_administrator_takes_over(
    client: TestClient, bench: HomingBench, recovering: list[Any]
) -> None:
    refused = taken_over(client, Scope.OPERATE)
    assert (refused.status_code, refused.json()["code"], bench.stopped) == (423, "lease-moving", 0)
    bench.over.set()
    until(lambda: bool(recovering), PATIENCE_S, "the recovery's end")
    assert recovering[0].json()["done"] == list(DONE.done)
    assert taken_over(client, Scope.OPERATE).status_code == 200


def test_a_recovery_that_is_taken_over_is_stopped_and_says_why_it_ended(
    client: TestClient, bench: HomingBench, recovering: list[Any]
) -> None:
    assert taken_over(client, Scope.ADMIN).status_code == 200
    until(lambda: bool(recovering), PATIENCE_S, "the recovery's end")
    assert (recovering[0].status_code, recovering[0].json()["code"]) == (409, "not-recovered")
    assert recovering[0].json()["detail"] == NOT_IN_CONTROL
    assert (bench.stopped, bench.consents) == (1, [])


def test_a_recovery_longer_than_its_lease_goes_on_where_nobody_else_took_over(
    client: TestClient, service: Service, bench: HomingBench, recovering: list[Any]
) -> None:
    service.control.release(client.headers["X-Control-Lease"])
    bench.over.set()
    until(lambda: bool(recovering), PATIENCE_S, "the recovery's end")
    assert recovering[0].json()["done"] == list(DONE.done)


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("POST", "/recover", CONSENT),
        ("POST", "/rig/connect", None),
        ("PUT", "/subject", {"id": "S01", "site": "calf", "pain_threshold_N": 3.0}),
    ],
)
def test_what_waited_for_its_turn_does_not_begin_under_the_lease_of_before(
    client: TestClient, service: Service, bench: HomingBench, method: str, path: str, body: object,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(service, "connect", lambda lease: Service.connect(service, lease))
    answers: list[Any] = []
    asked = threading.Event()
    checked = service.control.check

    def check(identifier: str) -> None:
        checked(identifier)
        asked.set()

    monkeypatch.setattr(service.control, "check", check)
    ask = threading.Thread(
        target=lambda: answers.append(client.request(method, f"/api/v1{path}", json=body, headers={"If-Match": "*"}))
    )
    with service.starting:
        ask.start()
        assert asked.wait(PATIENCE_S), "the route has let it pass"
        service.control.take_over("Ben", 5.0, "", "she left", moving=False, may_stop=False)
    ask.join(PATIENCE_S)
    assert (answers[0].status_code, answers[0].json()["code"]) == (423, "no-lease")
    assert answers[0].json()["taken_by"] == "Ben" and bench.alive and not bench.homes.is_set()


def test_a_takeover_at_rest_stops_nothing(client: TestClient, service: Service, bench: HomingBench) -> None:
    assert not service.moves
    assert taken_over(client, Scope.OPERATE).status_code == 200
    assert bench.stopped == 0
