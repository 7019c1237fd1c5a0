"""A job shows what its operation says, how long it still takes, and what it returned."""

import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.http.service import Service
from api.operations import motion
from controller.operation import Operation
from mock_devices.testing.access import client_of, in_control
from rig.config.wiring import Wiring
from rig.errors import DeviceError, SafetyStop
from rig.results.bench import RetractResult
from tests.api.test_http_recover import ScriptedBench

Work = Callable[[Operation, object], RetractResult]


@pytest.fixture
def service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Service:
    found = Service(Wiring(), tmp_path / "sessions", tmp_path)
    monkeypatch.setattr(found, "connect", lambda: None)
    found.bench = ScriptedBench()  # type: ignore[assignment]
    return found


@pytest.fixture
def client(service: Service) -> TestClient:
    """In control."""
    return in_control(client_of(service))


def ended(client: TestClient, work: Work, monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    """A retraction that does ``work`` instead, once its thread has ended."""
    monkeypatch.setattr(motion, "retract", work)
    started = client.post("/api/v1/jobs", json={"kind": "retract", "params": {}}).json()
    for thread in threading.enumerate():
        if thread.name == f"job-{started['id']}":
            thread.join(10.0)
    found: dict[str, object] = client.get(f"/api/v1/jobs/{started['id']}").json()
    return found


def test_a_job_shows_the_log_and_the_result_of_its_operation(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    def work(operation: Operation, _bench: object) -> RetractResult:
        operation.say("the tip leaves", "the tip is out")
        return RetractResult(outcome="complete")

    found = ended(client, work, monkeypatch)
    assert (found["state"], found["message"], found["time_left_s"]) == ("succeeded", "done", None)
    assert found["log"] == ["the tip leaves", "the tip is out"]
    assert found["done"] == found["total"] == 1.0
    assert found["result"] == {"version": 1, "outcome": "complete"}


def test_while_it_runs_the_bench_shows_its_time_left_and_not_its_log(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[dict[str, object]] = []

    def work(operation: Operation, _bench: object) -> RetractResult:
        operation.say("a long log")
        operation.advance(0.5, "half way")
        shown.append(client.get("/api/v1/rig").json()["job"])
        return RetractResult(outcome="complete")

    assert ended(client, work, monkeypatch)["log"] == ["a long log"]
    (now,) = shown
    assert (now["state"], now["message"], "log" in now) == ("running", "half way", False)
    assert isinstance(now["time_left_s"], float) and 0 <= now["time_left_s"] < 10


@pytest.mark.parametrize(
    ("error", "state", "code", "message"),
    [
        (SafetyStop("stopped: pain stop", "pain_stop"), "cancelled", "pain_stop", "stopped: pain stop"),
        (SafetyStop("stopped: 13 N", "force_limit"), "failed", "force_limit", "stopped: 13 N"),
        (DeviceError("silent"), "failed", "device", "silent"),
        (ValueError("odd"), "failed", "error", "the job met an error of its own: ValueError('odd')"),
    ],
)
def test_a_job_that_does_not_succeed_says_why(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, error: Exception, state: str, code: str, message: str
) -> None:
    def work(_operation: Operation, _bench: object) -> RetractResult:
        raise error

    found = ended(client, work, monkeypatch)
    assert (found["state"], found["message"], found["result"]) == (state, message, None)
    assert found["problem"] == {"code": code, "detail": message}


def test_a_job_that_is_cancelled_stops_the_bench(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    stops: list[str] = []
    monkeypatch.setattr(ScriptedBench, "stop", lambda _: stops.append("stop"), raising=False)

    def work(operation: Operation, _bench: object) -> RetractResult:
        (job,) = service.jobs.active
        assert client.post(f"/api/v1/jobs/{job.id}/cancel").json()["state"] == "cancelling"
        assert client.post(f"/api/v1/jobs/{job.id}/cancel").json()["state"] == "cancelling"
        assert operation.cancelled
        raise SafetyStop("stopped by the operator")

    found = ended(client, work, monkeypatch)
    assert (found["state"], found["can"], stops) == ("cancelled", [], ["stop"])
    again = client.post(f"/api/v1/jobs/{found['id']}/cancel")
    assert (again.status_code, again.json()["state"]) == (200, "cancelled")
