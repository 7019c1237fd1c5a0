"""Subject and site go with what is recorded next; the threshold is the loop's, which is started anew for another."""

from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.http.access.scopes import Scope
from api.http.service import Service
from mock_devices.testing.access import bearer, client_of, in_control
from rig.config.wiring import Wiring
from tests.api.jobs.test_verbs import WiredBench

SUBJECT = {"id": "S01", "site": "left forearm", "pain_threshold_N": 15.0}


@pytest.fixture
def service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Service:
    found = Service(Wiring(), tmp_path / "sessions", tmp_path)
    monkeypatch.setattr(found, "connect", lambda: None)
    found.bench = WiredBench()  # type: ignore[assignment]
    return found


@pytest.fixture
def client(service: Service) -> TestClient:
    return in_control(client_of(service))


@pytest.fixture
def restarts(service: Service, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The thresholds of loops that were started."""
    started: list[float] = []

    def start(waiting: bool) -> None:
        assert not waiting
        started.append(service.wiring.subject.pain_threshold_N)

    monkeypatch.setattr(service, "_start_bench", start)
    return started


def changed(client: TestClient, match: str | None = None, /, **values: str | float) -> tuple[int, str]:
    tag = client.get("/api/v1/subject").headers["etag"] if match is None else match
    answer = client.put("/api/v1/subject", json=SUBJECT | values, headers={"If-Match": tag})
    return answer.status_code, answer.json().get("code", "")


def test_whoever_is_recorded_next_is_known_without_moving_anything(
    client: TestClient, service: Service, restarts: list[float]
) -> None:
    assert changed(client) == (200, "")
    assert client.get("/api/v1/subject").json() == SUBJECT
    assert service.bench and service.bench.wiring.subject.id == "S01" and restarts == []


def test_another_threshold_is_the_loops(client: TestClient, service: Service, restarts: list[float]) -> None:
    assert changed(client, pain_threshold_N=7.5) == (200, "")
    assert restarts == [7.5] and service.wiring.force_limit_N == 7.5


def test_no_change_of_somebody_else_is_lost(client: TestClient) -> None:
    old = client.get("/api/v1/subject").headers["etag"]
    assert changed(client, site="calf") == (200, "")
    assert changed(client, old) == (412, "stale")
    assert changed(client, "") == (428, "if-match")
    assert client.get("/api/v1/subject").json()["site"] == "calf"


def test_nobody_is_exchanged_while_the_bench_is_stopped_or_without_control(
    client: TestClient, service: Service
) -> None:
    assert service.bench
    service.bench.status = {"latched": {"code": "pain_stop", "text": "pain", "action": "SOFT"}}  # type: ignore[misc]
    assert changed(client) == (409, "stopped")
    tag = {"If-Match": "*", "X-Control-Lease": ""}
    assert client.put("/api/v1/subject", json=SUBJECT, headers=tag).status_code == 423
    assert client.put("/api/v1/subject", json=SUBJECT, headers=bearer(Scope.READ)).status_code == 403


@pytest.mark.parametrize(
    "wrong", [{"pain_threshold_N": 0.0}, {"pain_threshold_N": "7"}, {"id": ""}, {"site": "x" * 81}, {"name": "Ann"}]
)
def test_what_is_no_subject_is_refused(client: TestClient, wrong: dict[str, str | float]) -> None:
    assert changed(client, None, **wrong) == (422, "invalid-request")
