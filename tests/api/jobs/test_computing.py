"""What only computes runs in a process of its own: it can be cancelled, it may die, and the service goes on."""

import json
import os
import time
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.http.jobs import process
from api.http.priority import NICE, go_at
from api.http.service import Service
from mock_devices.testing.commands import until
from rig.results.recorded import VerifyResult
from tests.api.jobs.asked import PATIENCE_S, becomes, begun, ended, shown

pytestmark = pytest.mark.timeout(600)
PLANTED = "tests.api.jobs.planted"


def planted(service: Service, function: str) -> None:
    service.works["verify"] = f"{PLANTED}:{function}"


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that does not listen is ended at once; how long it is given otherwise has a test of its own."""
    monkeypatch.setattr(process, "CANCEL_S", 0.5)


def test_a_job_gives_the_result_that_the_command_writes(client: TestClient, first: Path) -> None:
    done = ended(client, begun(client, "verify", session="first"))
    assert (done["state"], done["done"], done["problem"], done["can"]) == ("succeeded", done["total"], None, [])
    found = VerifyResult.model_validate_json(json.dumps(done["result"]))
    assert found.ok and list(found.recordings) == [path.stem for path in first.glob("*.mcap")]
    assert done["params"] == {"session": "first", "recording": ""} and done["session"] == "first"
    assert done["created"] <= done["started"] <= done["ended"]


def test_files_that_a_job_wrote_can_be_downloaded_with_ranges(client: TestClient, first: Path) -> None:
    done = ended(client, begun(client, "export", session="first", formats=["csv"]))
    assert done["state"] == "succeeded", done["message"]
    names = {each["name"]: each for each in done["files"]}
    table = next(each for name, each in names.items() if name.endswith(".csv"))
    assert table["name"].startswith("files/csv/") and table["media_type"] == "text/csv"
    whole = client.get(table["href"])
    assert (whole.status_code, len(whole.content)) == (200, table["bytes"])
    part = client.get(table["href"], headers={"Range": "bytes=0-3"})
    assert (part.status_code, part.content) == (206, whole.content[:4])
    assert not list(first.glob("csv"))


def test_a_report_is_a_file_of_its_session(client: TestClient, first: Path) -> None:
    done = ended(client, begun(client, "report", session="first"))
    assert done["state"] == "succeeded", done["message"]
    (page,) = done["files"]
    assert (page["name"], page["href"]) == ("report.html", "/api/v1/recordings/first/report.html")
    assert client.get(page["href"]).content == (first / "report.html").read_bytes()


def test_what_computes_stands_back_though_the_service_goes_first(
    client: TestClient, service: Service, first: Path
) -> None:
    planted(service, "nice")
    before = os.getpriority(os.PRIO_PROCESS, 0)
    go_at(NICE)
    try:
        done = ended(client, begun(client, "verify", session=first.name))
    finally:
        go_at(before)
    assert done["log"] == ["nice 5", "ended first: 1000"]


@pytest.mark.parametrize(("function", "longest_s"), [("patient", 20.0), ("deaf", 40.0)])
def test_a_computation_can_be_cancelled_also_where_it_does_not_listen(
    client: TestClient, service: Service, first: Path, function: str, longest_s: float
) -> None:
    planted(service, function)
    job = begun(client, "verify", session=first.name)
    until(lambda: bool(shown(client, job)["message"]), PATIENCE_S, "a computation under way")
    began = time.monotonic()
    assert client.post(f"/api/v1/jobs/{job}/cancel").json()["state"] == "cancelling"
    done = ended(client, job)
    assert time.monotonic() - began < longest_s
    assert (done["state"], done["problem"]["code"], done["result"]) == ("cancelled", "cancelled", None)
    assert client.post(f"/api/v1/jobs/{job}/cancel").json()["state"] == "cancelled"


@pytest.mark.parametrize(
    ("function", "code", "said"),
    [
        ("dying", "crashed", "was killed, most often because memory ran out"),
        ("odd", "crashed", "its last words: ZeroDivisionError: the third spring has no length"),
        ("wrong", "data", "trial_001: line 3: force is no number"),
    ],
)
def test_a_computation_that_dies_is_a_failed_job_with_a_sentence_and_the_next_one_runs(
    client: TestClient, service: Service, first: Path, function: str, code: str, said: str
) -> None:
    planted(service, function)
    done = ended(client, begun(client, "verify", session=first.name))
    assert (done["state"], done["problem"]["code"]) == ("failed", code)
    assert said in done["problem"]["detail"] and done["message"] == done["problem"]["detail"]
    service.works.clear()
    assert ended(client, begun(client, "verify", session=first.name))["state"] == "succeeded"


def test_what_a_library_prints_is_no_message_and_the_log_keeps_its_order(
    client: TestClient, service: Service, first: Path
) -> None:
    planted(service, "talkative")
    done = ended(client, begun(client, "verify", session=first.name))
    assert (done["state"], done["log"]) == ("succeeded", ["one", "two", "three"])


def test_what_a_person_is_asked_for_pauses_the_job_until_it_is_done(
    client: TestClient, service: Service, first: Path
) -> None:
    planted(service, "asking")
    job = begun(client, "verify", session=first.name)
    asked = becomes(client, job, "paused")
    assert (asked["message"], asked["can"]) == ("put 1 N on the tip", ["cancel", "resume"])
    client.post(f"/api/v1/jobs/{job}/resume")
    until(lambda: shown(client, job)["message"] == "put 2 N on the tip", PATIENCE_S, "the second request")
    client.post(f"/api/v1/jobs/{job}/resume")
    assert ended(client, job)["log"] == ["1 N is on", "2 N is on"]
    job = begun(client, "verify", session=first.name)
    becomes(client, job, "paused")
    client.post(f"/api/v1/jobs/{job}/cancel")
    assert ended(client, job)["state"] == "cancelled"


def test_an_answer_to_a_request_that_is_sent_again_is_none_to_the_next(
    client: TestClient, service: Service, first: Path
) -> None:
    planted(service, "asking")
    job = begun(client, "verify", session=first.name)
    becomes(client, job, "paused")
    done = {"Idempotency-Key": "1-N-is-on"}
    client.post(f"/api/v1/jobs/{job}/resume", headers=done)
    until(lambda: shown(client, job)["message"] == "put 2 N on the tip", PATIENCE_S, "the second request")
    again = client.post(f"/api/v1/jobs/{job}/resume", headers=done)
    assert (again.status_code, again.headers["idempotent-replayed"]) == (200, "true")
    unnamed = client.post(f"/api/v1/jobs/{job}/resume", headers={"Idempotency-Key": ""})
    assert (unnamed.status_code, unnamed.json()["code"]) == (400, "idempotency-key")
    asked = shown(client, job)
    assert (asked["state"], asked["message"]) == ("paused", "put 2 N on the tip")
    client.post(f"/api/v1/jobs/{job}/cancel")
    assert ended(client, job)["log"] == ["1 N is on"]


@pytest.mark.usefixtures("impatient")
def test_one_computes_while_others_wait_in_their_order(client: TestClient, service: Service, first: Path) -> None:
    planted(service, "patient")
    one, two, three = (begun(client, "verify", session=first.name) for _ in range(3))
    becomes(client, one, "running")
    assert [shown(client, job)["state"] for job in (two, three)] == ["queued", "queued"]
    assert client.post(f"/api/v1/jobs/{two}/cancel").json()["state"] == "cancelled"
    assert shown(client, two)["started"] is None
    client.post(f"/api/v1/jobs/{one}/cancel")
    becomes(client, three, "running")
    client.post(f"/api/v1/jobs/{three}/cancel")
    ended(client, three)


@pytest.mark.usefixtures("impatient")
def test_the_service_answers_while_something_computes(client: TestClient, service: Service, first: Path) -> None:
    planted(service, "deaf")
    job = begun(client, "verify", session=first.name)
    until(lambda: shown(client, job)["message"] == "deaf", PATIENCE_S, "a computation under way")
    began = time.monotonic()
    for _ in range(20):
        assert client.get("/api/v1/rig").status_code == 200
    assert time.monotonic() - began < 4.0
    client.post(f"/api/v1/jobs/{job}/cancel")
    ended(client, job)


@pytest.mark.usefixtures("impatient")
def test_nothing_computes_on_where_the_service_ends(client: TestClient, service: Service, first: Path) -> None:
    planted(service, "deaf")
    job = begun(client, "verify", session=first.name)
    until(lambda: shown(client, job)["message"] == "deaf", PATIENCE_S, "a computation under way")
    service.jobs.close()
    assert ended(client, job)["state"] == "cancelled"
