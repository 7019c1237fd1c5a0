"""The service over a real mock bench: what a lab's UI does, in the order in which it does it."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.cli.mock_bench import plug_into
from api.cli.options import built_in
from api.http.jobs.states import ENDS
from api.http.lease import LeaseRegistry
from api.http.service import Service
from mock_devices.testing.access import client_of
from mock_devices.testing.clock import Clock
from mock_devices.testing.commands import (
    PATIENCE_S,
    PATIENT,
    ServedBench,
    freed,
    pressed,
    served_bench,
    stands_still,
    until,
)
from rig.recording.reader import read_recording
from tests.system.presses import SHORT, SLOW


@pytest.fixture(scope="module")
def clock() -> Clock:
    return Clock()


@pytest.fixture(scope="module")
def served(clock: Clock, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[ServedBench, TestClient, Path]]:
    folder = tmp_path_factory.mktemp("service")
    (folder / "protocols").mkdir()
    (folder / "protocols" / "slow.toml").write_text(SLOW)
    (folder / "protocols" / "short.toml").write_text(SHORT)
    with served_bench("--seed", "2") as bench:
        service = Service(
            plug_into(built_in(["loop.lease_s=1", *PATIENT]), bench.endpoints),
            folder / "sessions",
            folder / "protocols",
        )
        service.control = LeaseRegistry(clock.seconds)
        with client_of(service) as client:
            yield bench, client, folder


@pytest.fixture(autouse=True)
def in_control(served: tuple[ServedBench, TestClient, Path]) -> Iterator[None]:
    """Every test takes the lease, and gives it back."""
    _, client, _ = served
    taken = client.post("/api/v1/control/lease", json={"holder": "test", "ttl_s": 30.0})
    client.headers["X-Control-Lease"] = taken.json()["lease_id"]
    yield
    client.delete("/api/v1/control/lease")


def start(client: TestClient, protocol: str, session: str) -> str:
    answer = client.post("/api/v1/jobs", json={"kind": "capture", "params": {"protocol": protocol, "session": session}})
    assert answer.status_code == 202, answer.text
    assert answer.headers["location"] == f"/api/v1/jobs/{answer.json()['id']}"
    return str(answer.json()["id"])


def ended(client: TestClient, job: str) -> dict[str, Any]:
    until(lambda: client.get(f"/api/v1/jobs/{job}").json()["state"] in ENDS, PATIENCE_S, "the job's end")
    found: dict[str, Any] = client.get(f"/api/v1/jobs/{job}").json()
    return found


def reset(client: TestClient) -> None:
    until(lambda: client.post("/api/v1/estop/reset").status_code == 200, PATIENCE_S, "the reset")
    assert client.get("/api/v1/rig").json()["state"] == "idle"


def test_the_bench_is_shown_with_its_devices_and_their_health(served: tuple[ServedBench, TestClient, Path]) -> None:
    _, client, _ = served
    until(lambda: client.get("/api/v1/rig").json()["cycles"] > 300, PATIENCE_S, "a running loop")
    rig = client.get("/api/v1/rig").json()
    assert rig["state"] == "idle"
    assert set(rig["devices"]) == {"force", "axis", "tracker"}
    assert all(health["alive"] and health["valid"] for health in rig["health"].values())


def test_a_capture_runs_as_a_job_and_its_recording_can_be_downloaded(
    served: tuple[ServedBench, TestClient, Path], tmp_path: Path
) -> None:
    _, client, _ = served
    job = ended(client, start(client, "short", "first"))
    assert job["state"] == "succeeded", job["message"]
    (session,) = (item for item in client.get("/api/v1/recordings").json()["items"] if item["name"] == "first")
    assert (session["trials"], session["dropped"]) == (1, 0)
    href = next(item["href"] for item in session["recordings"] if item["file"].endswith(".mcap"))
    file = tmp_path / "downloaded.mcap"
    file.write_bytes(client.get(href).content)
    assert read_recording(file).complete
    part = client.get(href, headers={"Range": "bytes=0-7"})
    assert (part.status_code, part.content) == (206, b"\x89MCAP0\r\n")


def test_a_session_is_never_overwritten(served: tuple[ServedBench, TestClient, Path]) -> None:
    _, client, folder = served
    (folder / "sessions" / "taken").mkdir(parents=True)
    answer = client.post("/api/v1/jobs", json={"kind": "capture", "params": {"protocol": "short", "session": "taken"}})
    assert (answer.status_code, answer.json()["code"]) == (409, "session-exists")


def test_one_job_at_a_time_and_a_stop_names_its_job(served: tuple[ServedBench, TestClient, Path]) -> None:
    bench, client, _ = served
    job = start(client, "slow", "second")
    pressed(bench)
    second = client.post("/api/v1/jobs", json={"kind": "capture", "params": {"protocol": "short", "session": "third"}})
    assert (second.status_code, second.json()["code"]) == (409, "busy")
    assert job in second.json()["detail"]
    assert client.post("/api/v1/jobs/nobody/cancel").status_code == 404
    assert client.post(f"/api/v1/jobs/{job}/cancel").status_code == 200
    freed(bench)
    assert ended(client, job)["state"] == "cancelled"
    assert client.get("/api/v1/rig").json()["state"] == "stopped"
    reset(client)


def test_the_emergency_stop_holds_until_acknowledged_and_moves_nothing_then(
    served: tuple[ServedBench, TestClient, Path],
) -> None:
    bench, client, folder = served
    job = start(client, "slow", "fourth")
    pressed(bench)
    answer = client.post("/api/v1/estop")
    assert (answer.status_code, answer.json()["detail"]) == (200, "braked")
    assert ended(client, job)["state"] == "cancelled"
    again = client.post("/api/v1/estop").json()
    assert (again["detail"], again["id"] > answer.json()["id"]) == ("braked", True)
    refused = client.post("/api/v1/jobs", json={"kind": "capture", "params": {"protocol": "short", "session": "fifth"}})
    assert (refused.status_code, refused.json()["code"]) == (409, "stopped")
    assert not (folder / "sessions" / "fifth").exists()
    before_mm = bench.control.number("axis.position_mm")
    reset(client)
    stands_still(bench)
    assert bench.control.number("axis.position_mm") == pytest.approx(before_mm, abs=0.05)
    assert bench.control.number("tip.force_N") > 0.5
    out = client.post("/api/v1/jobs", json={"kind": "retract", "params": {}})
    done = ended(client, out.json()["id"])
    assert done["state"] == "succeeded", done["message"]
    freed(bench)


def test_the_subjects_pain_stop_retracts(served: tuple[ServedBench, TestClient, Path]) -> None:
    bench, client, folder = served
    bench.control.set({"tissue.present": False})
    assert client.post("/api/v1/pain").json()["detail"] == "nothing was moving: the axis stays where it is"
    reset(client)
    bench.control.set({"tissue.present": True})
    job = start(client, "slow", "sixth")
    pressed(bench)
    first, second = client.post("/api/v1/pain"), client.post("/api/v1/pain")
    assert (first.json()["detail"], second.json()["detail"]) == ("retracting", "retracting")
    freed(bench)
    assert ended(client, job)["state"] == "cancelled"
    events = read_recording(folder / "sessions" / "sixth" / "trial_001.mcap").events
    assert "pain_stop" in {event.code for event in events}
    reset(client)


def test_a_user_who_does_not_renew_the_lease_is_retracted_from(
    served: tuple[ServedBench, TestClient, Path], clock: Clock
) -> None:
    bench, client, folder = served
    job = start(client, "slow", "seventh")
    pressed(bench)
    clock.advance(31.0)
    freed(bench)
    found = ended(client, job)
    assert (found["state"], found["problem"]["code"]) == ("failed", "operator_silent")
    events = read_recording(folder / "sessions" / "seventh" / "trial_001.mcap").events
    assert "operator_silent" in {event.code for event in events}
    taken = client.post("/api/v1/control/lease", json={"holder": "the next one", "ttl_s": 30.0})
    client.headers["X-Control-Lease"] = taken.json()["lease_id"]
    reset(client)


def test_a_session_whose_folder_is_removed_meanwhile_is_a_stop_with_one_sentence(
    served: tuple[ServedBench, TestClient, Path],
) -> None:
    bench, client, folder = served
    job = start(client, "slow", "eighth")
    pressed(bench)
    shutil.rmtree(folder / "sessions" / "eighth")
    freed(bench)
    done = ended(client, job)
    assert (done["state"], done["problem"]["code"]) == ("failed", "failed")
    assert "trial_001.mcap: was removed or moved while it was recorded" in done["message"]
    assert not (folder / "sessions" / "eighth").exists()
    state = client.get("/api/v1/rig").json()["reason"]
    assert state == "the recording failed, and nothing moves unrecorded: the trial says why", "nobody pressed anything"
    reset(client)
