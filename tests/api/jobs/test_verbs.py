"""A job that uses the bench: one at a time, under the lease and a key; it waits between trials, with the tip out."""

import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.http.access.scopes import Scope
from api.http.service import Service
from api.operations import motion
from controller.operation import Operation
from mock_devices.testing.access import client_of
from mock_devices.testing.commands import until
from rig.config.wiring import Wiring
from rig.errors import SafetyStop
from rig.results.recorded import CaptureResult
from tests.api.jobs.asked import becomes, begun, ended, shown
from tests.api.jobs.test_board import made
from tests.api.test_http_recover import ScriptedBench

DONE = CaptureResult(session="s", recordings=2, samples=0, dropped=0, trials=())


class Trials:
    """A capture of two trials that goes on when it is told to."""

    def __init__(self) -> None:
        self.made = list[int]()
        self.may = threading.Semaphore(0)

    def __call__(self, operation: Operation, _bench: object, _plan: object, _folder: object) -> CaptureResult:
        for trial in (1, 2):
            operation.advance(trial - 1, f"trial {trial}")
            self.made.append(trial)
            assert self.may.acquire(timeout=20.0)
            operation.say(f"trial {trial}: good")
            if operation.cancelled:
                raise SafetyStop(f"stopped by the operator after {trial} of 2 trials")
        operation.advance(2, "done")
        return DONE


class Confirming:
    """Confirms each stop at once."""

    def request(self, _kind: object) -> int:
        return 1

    def confirmed(self, _request: int, _within_s: float) -> object:
        return type("Answer", (), {"confirmed": True, "text": "braked", "id": 1})()


class WiredBench(ScriptedBench):
    """One that a protocol can be checked for; ``stopped`` counts the operator's stops."""

    wiring, stops = Wiring(), Confirming()

    def __init__(self) -> None:
        super().__init__()
        self.stopped = 0

    def stop(self) -> None:
        self.stopped += 1


@pytest.fixture
def bench(service: Service) -> WiredBench:
    (service.protocols / "p.toml").write_text('kind = "indentation"\ndepth_mm = 5\n')
    made = WiredBench()
    service.bench = made  # type: ignore[assignment]
    return made


@pytest.fixture
def trials(bench: WiredBench, monkeypatch: pytest.MonkeyPatch) -> Trials:
    made = Trials()
    monkeypatch.setattr(motion, "capture", made)
    return made


def capture(client: TestClient) -> str:
    return begun(client, "capture", protocol="p", session="s")


def test_a_pause_waits_for_the_trial_and_the_next_one_for_the_resume(client: TestClient, trials: Trials) -> None:
    job = capture(client)
    until(lambda: trials.made == [1], 10.0, "the first trial")
    assert shown(client, job)["can"] == ["cancel", "pause"]
    for _ in range(2):
        assert client.post(f"/api/v1/jobs/{job}/pause").json()["state"] == "pausing"
    trials.may.release()
    assert becomes(client, job, "paused")["can"] == ["cancel", "resume"]
    assert client.post(f"/api/v1/jobs/{job}/pause").status_code == 200
    assert trials.made == [1]
    assert client.get("/api/v1/rig").json()["job"]["state"] == "paused"
    for _ in range(2):
        assert client.post(f"/api/v1/jobs/{job}/resume").json()["state"] == "running"
    trials.may.release()
    done = ended(client, job)
    assert (done["state"], trials.made) == ("succeeded", [1, 2])
    assert done["result"]["recordings"] == 2


def test_a_pause_that_was_taken_back_does_not_wait(client: TestClient, trials: Trials) -> None:
    job = capture(client)
    until(lambda: trials.made == [1], 10.0, "the first trial")
    client.post(f"/api/v1/jobs/{job}/pause")
    assert client.post(f"/api/v1/jobs/{job}/resume").json()["state"] == "running"
    trials.may.release(2)
    assert ended(client, job)["state"] == "succeeded"


def _cancel(client: TestClient, job: str) -> None:
    client.post(f"/api/v1/jobs/{job}/cancel")


def _emergency(client: TestClient, _job: str) -> None:
    client.post("/api/v1/estop")


@pytest.mark.parametrize("stopping", [_cancel, _emergency])
def test_no_trial_begins_after_a_stop_while_it_was_paused(
    client: TestClient, trials: Trials, stopping: Callable[[TestClient, str], None]
) -> None:
    job = capture(client)
    until(lambda: trials.made == [1], 10.0, "the first trial")
    client.post(f"/api/v1/jobs/{job}/pause")
    trials.may.release()
    becomes(client, job, "paused")
    stopping(client, job)
    done = ended(client, job)
    assert (done["state"], trials.made) == ("cancelled", [1])
    assert done["message"] == "stopped by the operator while it was paused"


def test_a_cancel_while_a_trial_runs_stops_the_bench_and_no_trial_follows(
    client: TestClient, trials: Trials, bench: WiredBench
) -> None:
    job = capture(client)
    until(lambda: trials.made == [1], 10.0, "the first trial")
    _cancel(client, job)
    assert bench.stopped == 1
    refused = client.post(f"/api/v1/jobs/{job}/pause")
    assert (refused.status_code, refused.json()["state"]) == (409, "cancelling")
    trials.may.release()
    assert (ended(client, job)["state"], trials.made) == ("cancelled", [1])
    for verb in ("pause", "resume"):
        refused = client.post(f"/api/v1/jobs/{job}/{verb}")
        assert (refused.status_code, refused.json()["state"]) == (409, "cancelled")


def test_a_job_that_moves_is_ended_by_anybody_here_and_a_stranger_is_told_nothing_of_it(
    client: TestClient, service: Service, trials: Trials, bench: WiredBench
) -> None:
    job = capture(client)
    until(lambda: trials.made == [1], 10.0, "the first trial")
    stopped = client_of(service, scope=None).post(f"/api/v1/jobs/{job}/cancel")
    assert (stopped.status_code, stopped.content, bench.stopped) == (204, b"", 1)
    looking = client_of(service, Scope.READ).post(f"/api/v1/jobs/{job}/cancel")
    assert (looking.status_code, looking.json()["state"]) == (200, "cancelling")
    trials.may.release()
    assert (ended(client, job)["state"], trials.made) == ("cancelled", [1])


@pytest.mark.parametrize(("scope", "status", "code"), [(None, 401, "no-credential"), (Scope.READ, 403, "scope")])
def test_what_only_computes_is_ended_by_nobody_without_the_right_to_operate(
    service: Service, scope: Scope | None, status: int, code: str
) -> None:
    job = made(service.jobs, wait=True)
    refused = client_of(service, scope).post(f"/api/v1/jobs/{job}/cancel")
    assert (refused.status_code, refused.json()["code"]) == (status, code)
    assert service.jobs.alive(job).state == "queued"
    done = client_of(service, Scope.OPERATE).post(f"/api/v1/jobs/{job}/cancel")
    assert (done.status_code, done.json()["state"]) == (200, "cancelling")


def test_what_has_succeeded_cannot_be_cancelled(client: TestClient, trials: Trials) -> None:
    job = capture(client)
    trials.may.release(2)
    ended(client, job)
    refused = client.post(f"/api/v1/jobs/{job}/cancel")
    assert (refused.status_code, refused.json()["code"], refused.json()["state"]) == (409, "job-state", "succeeded")


def test_one_job_uses_the_bench_at_a_time_and_the_refusal_names_it(client: TestClient, trials: Trials) -> None:
    job = capture(client)
    until(lambda: trials.made == [1], 10.0, "the first trial")
    refused = client.post("/api/v1/jobs", json={"kind": "capture", "params": {"protocol": "p", "session": "t"}})
    assert (refused.status_code, refused.json()["code"]) == (409, "busy")
    assert job in refused.json()["detail"]
    trials.may.release(2)
    ended(client, job)


def test_whoever_resumes_takes_the_job_over(client: TestClient, service: Service, trials: Trials) -> None:
    job = capture(client)
    until(lambda: trials.made == [1], 10.0, "the first trial")
    client.post(f"/api/v1/jobs/{job}/pause")
    trials.may.release()
    becomes(client, job, "paused")
    client.delete("/api/v1/control/lease")
    assert not service.attended()
    stale = client.post(f"/api/v1/jobs/{job}/resume")
    assert (stale.status_code, stale.json()["code"]) == (423, "no-lease")
    taken = client.post("/api/v1/control/lease", json={"holder": "the next one", "ttl_s": 30.0}).json()
    client.headers["X-Control-Lease"] = taken["lease_id"]
    client.post(f"/api/v1/jobs/{job}/resume")
    assert service.attended()
    trials.may.release()
    ended(client, job)


def test_what_moves_asks_for_a_key_and_what_computes_does_not(client: TestClient, trials: Trials) -> None:
    body = {"kind": "capture", "params": {"protocol": "p", "session": "s"}}
    for path, sent in (("/jobs", body), ("/recover", {}), ("/rig/connect", None), ("/jobs/x/resume", None)):
        refused = client.post(f"/api/v1{path}", json=sent, headers={"Idempotency-Key": ""})
        assert (refused.status_code, refused.json()["code"]) == (400, "idempotency-key"), path
    assert trials.made == []
    computed = client.post(
        "/api/v1/jobs", json={"kind": "verify", "params": {"session": "none"}}, headers={"Idempotency-Key": ""}
    )
    assert computed.status_code == 404


def test_a_start_that_comes_again_after_another_took_control_gets_the_first_answer_and_moves_nothing(
    client: TestClient, service: Service, trials: Trials
) -> None:
    asked, key = {"kind": "capture", "params": {"protocol": "p", "session": "s"}}, {"Idempotency-Key": "once"}
    first = client.post("/api/v1/jobs", json=asked, headers=key)
    trials.may.release(2)
    ended(client, first.json()["id"])
    other = client_of(service)
    assert other.post("/api/v1/control/take", json={"holder": "Bob", "reason": "my turn"}).status_code == 200
    again = client.post("/api/v1/jobs", json=asked, headers=key)
    assert (again.status_code, again.json()) == (first.status_code, first.json())
    late = client.post("/api/v1/jobs", json=asked, headers={"Idempotency-Key": "late"})
    assert (late.status_code, late.json()["code"]) == (423, "no-lease")
    assert trials.made == [1, 2]


def test_verbs_that_come_in_the_wrong_order_are_refused_by_state_and_change_nothing(
    client: TestClient, trials: Trials
) -> None:
    job = capture(client)
    until(lambda: trials.made == [1], 10.0, "the first trial")
    assert client.post(f"/api/v1/jobs/{job}/resume").json()["state"] == "running"  # before the pause that it answers
    assert client.post(f"/api/v1/jobs/{job}/pause").json()["state"] == "pausing"
    assert client.post(f"/api/v1/jobs/{job}/cancel").json()["state"] == "cancelling"
    for verb in ("resume", "pause"):
        refused = client.post(f"/api/v1/jobs/{job}/{verb}")
        assert (refused.status_code, refused.json()["state"]) == (409, "cancelling")
    trials.may.release()
    assert (ended(client, job)["state"], trials.made) == ("cancelled", [1])


def test_nothing_is_started_on_a_stopped_bench(client: TestClient, trials: Trials, bench: WiredBench) -> None:
    bench.status = {"latched": {"code": "pain_stop", "text": "the subject's stop", "action": "SOFT"}}
    refused = client.post("/api/v1/jobs", json={"kind": "capture", "params": {"protocol": "p", "session": "s"}})
    assert (refused.status_code, refused.json()["code"]) == (409, "stopped")
    assert "the subject's stop; acknowledge that" in refused.json()["detail"] and trials.made == []


def test_a_session_that_is_there_is_not_recorded_into(client: TestClient, service: Service, trials: Trials) -> None:
    (service.sessions / "s").mkdir(parents=True)
    refused = client.post("/api/v1/jobs", json={"kind": "capture", "params": {"protocol": "p", "session": "s"}})
    assert (refused.status_code, refused.json()["code"]) == (409, "session-exists")
    assert trials.made == []


def test_without_a_bench_what_uses_it_is_refused(service: Service, first: Path) -> None:
    with client_of(service) as client:
        lease = client.post("/api/v1/control/lease", json={"holder": "test"}).json()["lease_id"]
        for kind, params in (
            ("retract", {}),
            ("threshold", {"model": {"session": first.name}, "up_to_N": 5.0}),
            ("track", {"model": {"session": first.name}, "reference": "press:3"}),
        ):
            body = {"kind": kind, "params": params}
            refused = client.post("/api/v1/jobs", json=body, headers={"X-Control-Lease": lease})
            assert (refused.status_code, refused.json()["code"]) == (503, "disconnected")
