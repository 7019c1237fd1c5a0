"""Axis and glove calibrated by a job: refused before the loop ends; stopped as a run is, and where control is lost."""

import time
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.http.commissioning.alone import Alone
from api.http.service import Service
from controller.stop.word import Lane, Requester, StopReason, StopWord
from mock_devices.testing.commands import until
from rig.config.products.firmata_glove import FirmataGlove
from tests.api.jobs import test_verbs
from tests.api.jobs.asked import becomes, begun, ended, shown
from tests.api.jobs.test_verbs import WiredBench

bench = test_verbs.bench
BRAKED = "braked while the drive moved by itself: nothing starts"
PLANTED = "tests.api.jobs.planted"
BLOCK = {"gauge_block_mm": 10.0}


@pytest.mark.parametrize(
    ("kind", "params", "said"),
    [
        ("calibrate-axis", {"to_mm": 99.0}, "the axis would go to 99 mm, outside 0 to 60 mm of [limits]; give from_mm"),
        ("calibrate-axis", {"to_mm": 9.0}, "from_mm 2 to_mm 9: 8 mm of travel or more are needed"),
        ("calibrate-axis", BLOCK, "near_mm: where is the table? give the axis position just before it"),
        ("calibrate-axis", BLOCK | {"near_mm": 8.0}, "the axis would go to -3 mm"),
        ("calibrate-axis", {"near_mm": 8.0}, "near_mm says where the table for a gauge block is"),
        ("calibrate-axis", {"gauge_block_mm": 0.5}, "greater than or equal to 1"),
        ("calibrate-axis", {"clear": "yes"}, "clear: Input should be a valid boolean"),
        ("calibrate-dynamics", {"from_mm": 58.0}, "from_mm 58: sweeps go from"),
        ("calibrate-glove", {"weights": "1 N,2 N"}, "0 gloves in the configuration"),
    ],
)
def test_what_cannot_be_calibrated_is_refused_while_the_bench_goes_on(
    client: TestClient, bench: WiredBench, kind: str, params: dict[str, Any], said: str
) -> None:
    refused = client.post("/api/v1/jobs", json={"kind": kind, "params": params})
    assert refused.status_code == 422 and said in refused.json()["detail"], refused.text
    assert "--" not in refused.json()["detail"] and bench.alive


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"weights": "1 N,60 N"}, "60 N is above"),
        ({"weights": "1 N,2 N", "input": "other"}, "input 'other': is no glove; there are: hand"),
    ],
)
def test_a_glove_is_known_by_its_name_and_loaded_no_more_than_a_hand_presses(
    client: TestClient, service: Service, bench: WiredBench, asked: dict[str, Any], said: str
) -> None:
    service.wiring = service.wiring.model_copy(update={"input": {"hand": FirmataGlove()}})
    refused = client.post("/api/v1/jobs", json={"kind": "calibrate-glove", "params": asked})
    assert refused.status_code == 422 and said in refused.json()["detail"], refused.text
    assert bench.alive


@pytest.mark.parametrize("kind", ["calibrate-axis", "calibrate-dynamics"])
def test_what_moves_takes_lease_and_key(client: TestClient, bench: WiredBench, kind: str) -> None:
    stale = client.post("/api/v1/jobs", json={"kind": kind}, headers={"X-Control-Lease": "stale"})
    assert (stale.status_code, stale.json()["code"]) == (423, "no-lease")
    twice = client.post("/api/v1/jobs", json={"kind": kind}, headers={"Idempotency-Key": ""})
    assert (twice.status_code, twice.json()["code"]) == (400, "idempotency-key")
    bench.status = {"latched": {"code": "pain_stop", "text": "the subject's stop", "action": "SOFT"}}
    stopped = client.post("/api/v1/jobs", json={"kind": kind})
    assert (stopped.status_code, stopped.json()["code"]) == (409, "stopped")
    assert bench.alive


def moving(client: TestClient, service: Service, function: str = "moving") -> str:
    """A job whose process moves an axis that is not there, until it is stopped."""
    service.works["calibrate-axis"] = f"{PLANTED}:{function}"
    job = begun(client, "calibrate-axis")
    until(lambda: client.get(f"/api/v1/jobs/{job}").json()["message"] == "moves", 30.0, "the axis moving")
    return job


def stop(client: TestClient) -> None:
    answer = client.post("/api/v1/estop")
    assert (answer.status_code, answer.json()["detail"]) == (200, BRAKED), answer.text


def test_the_services_stops_reach_the_process_that_moves(
    client: TestClient, service: Service, bench: WiredBench
) -> None:
    job = moving(client, service)
    assert client.get("/api/v1/info").json()["stop_port"] > 0
    stop(client)
    done = ended(client, job)
    assert (done["state"], done["problem"]["code"]) == ("cancelled", "operator_stop")
    assert client.get("/api/v1/info").json()["stop_port"] == 0
    assert client.post("/api/v1/estop").status_code == 503


def test_a_service_that_does_not_know_where_stops_go_is_found(
    client: TestClient, service: Service, bench: WiredBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Service, "_hear", lambda _, stops: stops.prepare())
    job = moving(client, service)
    with pytest.raises(AssertionError, match="503"):
        stop(client)
    assert ended(client, job)["state"] == "cancelled", "it is asked to end, and killed where it does not"


def test_stops_from_other_computers_reach_it(client: TestClient, service: Service, bench: WiredBench) -> None:
    followed = list[Path]()
    service.away = type("Away", (), {"follow": lambda _, page: followed.append(page)})()
    job = moving(client, service)
    page = StopWord.open(followed[-1])
    asking = Requester(page, Lane.AWAY)
    answer = asking.confirmed(asking.request(StopReason.EMERGENCY), 2.0)
    page.close()
    assert answer is not None and answer.confirmed
    assert ended(client, job)["state"] == "cancelled"


def test_a_stop_that_nobody_answers_in_time_is_not_confirmed(
    client: TestClient, service: Service, bench: WiredBench
) -> None:
    job = moving(client, service, "moving_deaf")
    answer = client.post("/api/v1/estop")
    assert (answer.status_code, answer.json()["code"]) == (504, "not-confirmed")
    client.post(f"/api/v1/jobs/{job}/cancel")
    assert ended(client, job)["state"] == "cancelled"


def take_over(client: TestClient, job: str) -> None:
    body = {"holder": "another", "ttl_s": 30.0, "purpose": "", "reason": "the limb is in the way"}
    assert client.post("/api/v1/control/take", json=body).status_code == 200
    until(lambda: shown(client, job)["state"] != "running", 3.0, "the axis braked")


def test_a_takeover_brakes_it_and_says_whose_control_was_lost(
    client: TestClient, service: Service, bench: WiredBench
) -> None:
    job = moving(client, service)
    take_over(client, job)
    done = ended(client, job)
    assert (done["state"], done["problem"]["code"]) == ("failed", "operator_silent")


def test_a_job_that_nobody_watches_over_is_found(
    client: TestClient, service: Service, bench: WiredBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Alone, "_attend", lambda _: None)
    job = moving(client, service)
    with pytest.raises(AssertionError, match="the axis braked"):
        take_over(client, job)
    client.post(f"/api/v1/jobs/{job}/cancel")
    assert ended(client, job)["state"] == "cancelled"


def test_at_a_question_control_may_be_lost_and_whoever_goes_on_has_it(
    client: TestClient, service: Service, bench: WiredBench
) -> None:
    service.works["calibrate-axis"] = f"{PLANTED}:asking"
    job = begun(client, "calibrate-axis")
    becomes(client, job, "paused")
    lease = client.headers["X-Control-Lease"]
    client.delete("/api/v1/control/lease", headers={"X-Control-Lease": lease})
    time.sleep(0.5)
    assert becomes(client, job, "paused", "failed")["state"] == "paused"
    lost = client.post(f"/api/v1/jobs/{job}/resume")
    assert (lost.status_code, lost.json()["code"]) == (423, "no-lease")
    assert client.post("/api/v1/estop").status_code == 504, "who asks here looks for no stop, and is ended all the same"
    assert ended(client, job)["state"] == "cancelled"
