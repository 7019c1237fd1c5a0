"""A job from its request to its end, as a client sees it."""

from typing import Any

from fastapi.testclient import TestClient

from api.http.jobs.states import ENDS
from mock_devices.testing.commands import until

# A computation yields to everything else on a busy computer.
PATIENCE_S = 240.0


def begun(client: TestClient, kind: str, **params: object) -> str:
    answer = client.post("/api/v1/jobs", json={"kind": kind, "params": params})
    assert answer.status_code == 202, answer.text
    assert answer.headers["location"] == f"/api/v1/jobs/{answer.json()['id']}"
    return str(answer.json()["id"])


def shown(client: TestClient, job: str) -> dict[str, Any]:
    found: dict[str, Any] = client.get(f"/api/v1/jobs/{job}").json()
    return found


def becomes(client: TestClient, job: str, *states: str) -> dict[str, Any]:
    until(lambda: shown(client, job)["state"] in states, PATIENCE_S, f"a job that is {' or '.join(states)}")
    return shown(client, job)


def ended(client: TestClient, job: str) -> dict[str, Any]:
    return becomes(client, job, *ENDS)
