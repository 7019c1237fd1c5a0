"""Subject and site go with what is recorded next; the threshold is the loop's, which is started anew for another."""

import os
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.http.access.scopes import Scope
from api.http.service import Service
from controller.experiments.capture import new_session
from mock_devices.testing.access import bearer, client_of, in_control
from rig.config.subject import Subject
from rig.config.wiring import Wiring
from rig.recording.reader import TRACKING
from rig.results.glove import GloveThreshold
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


def changed(client: TestClient, match: str | None = None, /, **values: object) -> tuple[int, str]:
    tag = client.get("/api/v1/subject").headers["etag"] if match is None else match
    answer = client.put("/api/v1/subject", json=SUBJECT | values, headers={"If-Match": tag})
    return answer.status_code, answer.json().get("code", "")


def test_whoever_is_recorded_next_is_known_without_moving_anything(
    client: TestClient, service: Service, restarts: list[float]
) -> None:
    assert changed(client) == (200, "")
    assert client.get("/api/v1/subject").json() == SUBJECT | {"site_thresholds_N": {}}
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


def test_a_code_of_blanks_is_refused_with_a_sentence_and_blanks_about_one_are_no_part_of_it(client: TestClient) -> None:
    tag = {"If-Match": client.get("/api/v1/subject").headers["etag"]}
    answer = client.put("/api/v1/subject", json=SUBJECT | {"id": "   "}, headers=tag)
    assert (answer.status_code, answer.json()["code"]) == (422, "refused")
    assert answer.json()["detail"].startswith("subject: its code is empty; give the code")
    assert changed(client, id=" S02 ") == (200, "")
    assert client.get("/api/v1/subject").json()["id"] == "S02"


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
    "wrong",
    [
        {"pain_threshold_N": 0.0},
        {"pain_threshold_N": "7"},
        {"id": ""},
        {"site": "x" * 81},
        {"name": "Ann"},
        {"site_thresholds_N": {"a": 0.0}},
        {"site_thresholds_N": {"a": 60.0}},
    ],
)
def test_what_is_no_subject_is_refused(client: TestClient, wrong: dict[str, object]) -> None:
    assert changed(client, None, **wrong) == (422, "invalid-request")


SITES = {"left forearm": 7.9, "calf": 11.0}


def settings(client: TestClient) -> dict[str, object]:
    found: dict[str, object] = client.get("/api/v1/subject").json()
    return found


def test_a_threshold_at_a_site_holds_there_and_the_subjects_own_elsewhere(
    client: TestClient, service: Service, restarts: list[float]
) -> None:
    assert changed(client, site_thresholds_N=SITES) == (200, "")
    assert (settings(client)["site_thresholds_N"], service.wiring.force_limit_N) == (SITES, 7.9)
    assert changed(client, site="calf") == (200, "")
    assert (settings(client)["site_thresholds_N"], service.wiring.force_limit_N) == (SITES, 11.0)
    assert changed(client, site="thigh") == (200, "")
    assert service.wiring.force_limit_N == 15.0 and len(restarts) == 3


def test_thresholds_of_one_person_are_not_those_of_the_next(client: TestClient, service: Service) -> None:
    assert changed(client, site_thresholds_N=SITES) == (200, "")
    assert changed(client, id="S02") == (200, "")
    assert settings(client)["site_thresholds_N"] == {}


def found_by_glove(folder: Path, number: int, site: str, force_N: float) -> None:
    """What `rig threshold --glove` leaves in a session, found ``number`` seconds after the first."""
    wiring = Wiring(subject=Subject(id="S02", site="thigh"))
    if not folder.exists():
        new_session(folder, "track", {"name": "glove", "kind": TRACKING}, wiring)
    file = folder / f"glove_{number:03d}.threshold.json"
    GloveThreshold(
        force_N=force_N, up_to_N=50.0, recording="r.mcap", subject="S02", site=site, input="glove", presses=(), rule="-"
    ).write(file)
    os.utime(file, (1.8e9 + number, 1.8e9 + number))


def test_what_was_found_for_a_subject_is_the_limit_when_it_comes_again(
    client: TestClient, service: Service, restarts: list[float]
) -> None:
    for number, (site, force_N) in enumerate([("calf", 5.29), ("calf", 6.18), ("thigh", 9.04), ("neck", 0.04)]):
        found_by_glove(service.sessions / "thresholds", number, site, force_N)
    assert changed(client, id="S02", site="calf") == (200, "")
    assert settings(client)["site_thresholds_N"] == {"calf": 6.1, "thigh": 9.0}
    assert (service.wiring.force_limit_N, restarts) == (6.1, [15.0])
    assert changed(client, id="S02", site="calf", site_thresholds_N={}) == (200, "")
    assert service.wiring.force_limit_N == 15.0
