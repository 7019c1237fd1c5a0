"""`POST /recover` and how the bench is shown, with a bench that is not there."""

from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.http.service import Service
from controller.loop.messages import Status
from controller.operation import Operation
from controller.recovery.situation import Consent
from mock_devices.testing.access import client_of, in_control
from rig.config.wiring import Wiring
from rig.errors import DeviceError
from rig.results.bench import Question, ResetResult

FAULT = ("the drive is in fault: 0x8130",)
OPEN = ResetResult(happened=FAULT, open=(Question(act="clear", question="may the drive's fault be cleared?"),))
DONE = ResetResult(happened=FAULT, done=("the drive's fault was cleared", "the tip moved out"))


class ScriptedBench:
    """As much of a supervisor as these routes touch."""

    def __init__(self, alive: bool = True) -> None:
        self.alive, self.consents, self.failure = alive, list[Consent](), ""
        self.status: Status = {"mode": "safe", "ready": False}
        self.ready = type("Ready", (), {"devices": {"force": {"product": "BFT"}, "axis": {"product": "EPOS4"}}})()
        self.stop_port = 0
        self.wiring = Wiring()

    def recover(self, consent: Consent) -> ResetResult:
        self.consents.append(consent)
        if self.failure:
            raise DeviceError(self.failure)
        return DONE if consent.clear else OPEN

    def close(self) -> None:
        self.alive = False


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


def bench_of(service: Service) -> Any:
    return service.bench


def test_without_consent_the_answer_asks_and_with_it_says_what_was_done(client: TestClient, service: Service) -> None:
    asked = client.post("/api/v1/recover", json={}).json()
    assert asked == {
        "happened": ["the drive is in fault: 0x8130"], "done": [], "missing": "", "ready": False, "version": 1,
        "open": [{"act": "clear", "question": "may the drive's fault be cleared?"}],
    }  # fmt: skip
    done = client.post("/api/v1/recover", json={"clear": True, "retract": True, "home": True}).json()
    assert done["done"] == ["the drive's fault was cleared", "the tip moved out"]
    assert (done["open"], done["ready"]) == ([], True)
    assert bench_of(service).consents == [Consent(), Consent(clear=True, retract=True, home=True)]


def test_recovery_takes_the_lease(client: TestClient, service: Service) -> None:
    client.headers["X-Control-Lease"] = "another"
    refused = client.post("/api/v1/recover", json={"clear": True})
    assert refused.status_code == 423
    assert refused.json()["type"].endswith("no-lease")
    assert bench_of(service).consents == []


def test_recovery_waits_for_the_end_of_a_job(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Service, "running", property(lambda _: Operation("capture", 1, "trials")))
    refused = client.post("/api/v1/recover", json={})
    assert refused.status_code == 409
    assert "a job is under way" in refused.json()["detail"]
    assert bench_of(service).consents == []


def test_a_recovery_that_fails_is_told_in_the_benchs_words(client: TestClient, service: Service) -> None:
    bench_of(service).failure = "the fault is still there"
    refused = client.post("/api/v1/recover", json={})
    assert refused.status_code == 409
    assert refused.json()["detail"] == "the fault is still there"


def test_a_dead_loop_is_replaced_by_one_that_waits_for_recovery(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench_of(service).alive = False
    started: list[bool] = []

    def start(waiting: bool) -> None:
        started.append(waiting)
        service.bench = ScriptedBench()  # type: ignore[assignment]

    monkeypatch.setattr(service, "_start_bench", start)
    assert client.post("/api/v1/recover", json={"clear": True}).json()["ready"]
    assert started == [True]


def test_the_bench_is_idle_only_while_it_is_ready(client: TestClient, service: Service) -> None:
    lost = {"state": "lost", "detail": "the line is gone", "since_ns": 5}
    well = {"state": "ok", "detail": "", "since_ns": 1}
    bench_of(service).status = {
        "mode": "not ready: force lost",
        "ready": False,
        "devices": {"force": lost, "axis": well},
    }
    shown = client.get("/api/v1/rig").json()
    assert (shown["state"], shown["ready"]) == ("not ready", False)
    assert shown["reason"] == "force is lost: the line is gone"
    assert shown["devices"]["force"] == {"product": "BFT"} | lost
    bench_of(service).status = {"mode": "idle", "ready": True, "devices": {"force": well, "axis": well}}
    assert client.get("/api/v1/rig").json()["state"] == "idle"
