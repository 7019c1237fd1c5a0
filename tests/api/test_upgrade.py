"""What a program of an earlier day left on a bench's computer is all there for this one.

`upgrade/2026-11-24` was written by the first program that had a service (commit 3ed4f01): by its own stores and routes,
with a session of S01, a name, a token, an account, a job and its answer. SQLite's file is kept as its statements.
"""

import asyncio
import shutil
import sqlite3
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.catalogue.catalogue import Catalogue, default_file
from api.catalogue.people import read_backup
from api.http.access.access import Access
from api.http.answers import ANSWERS, read_answers
from api.http.app import build
from api.http.idempotency import AnswerStore
from api.http.service import Service
from mock_devices.testing.access import ADDRESS
from rig.config.wiring import Wiring

LEFT = Path(__file__).parent / "upgrade" / "2026-11-24"
API, PASSWORD = "/api/v1", "a few words are a password"
ASKED = b'{"kind":"verify","params":{"session":"first"}}'


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A bench's folder as it was left, with the access rights that copying loses."""
    shutil.copytree(LEFT, tmp_path / "bench")
    sessions = tmp_path / "bench" / "sessions"
    file = default_file(sessions)
    sqlite3.connect(file).executescript((LEFT / "sessions.catalogue.sql").read_text())
    for path in (file, *(tmp_path / "bench" / "state").rglob("*.json*")):
        path.chmod(0o600)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "bench" / "state"))
    monkeypatch.delenv("RIG_CATALOGUE", raising=False)
    return tmp_path / "bench"


@pytest.fixture
def service(bench: Path) -> Service:
    return Service(Wiring(), bench / "sessions", bench / "protocols")


@pytest.fixture
def client(service: Service) -> TestClient:
    """With the token that was made then."""
    told = {"Authorization": f"Bearer {(LEFT / 'token.txt').read_text().strip()}"}
    return TestClient(build(service), base_url=ADDRESS, headers=told, client=("127.0.0.1", 50_000))


def test_the_token_of_then_opens_sessions_names_and_jobs_of_then(client: TestClient) -> None:
    assert client.get(f"{API}/auth/me").json()["name"] == "notebook"
    (subject,) = client.get(f"{API}/subjects").json()["items"]
    assert (subject["subject"], subject["name"], subject["sessions"]) == ("S01", "Ann Example", 1)
    history = client.get(f"{API}/subjects/S01").json()
    assert [each["force_N"] for each in history["thresholds"]] == [7.25]
    assert [each["law"] for each in history["models"]] == ["index"]
    assert [each["verdict"] for each in history["diagnoses"]] == ["explained"]
    (job,) = client.get(f"{API}/jobs").json()["items"]
    assert (job["kind"], job["session"], job["by"]) == ("verify", "first", "notebook")
    assert client.get(f"{API}/jobs/{job['id']}").json()["params"] == {"session": "first", "recording": ""}


def test_the_account_of_then_logs_in_and_the_audit_log_goes_on_unbroken(bench: Path) -> None:
    access = Access()
    caller = asyncio.run(access.accounts.enter("ann", PASSWORD))
    assert caller and caller.scope.word == "admin"
    assert asyncio.run(access.accounts.enter("ann", PASSWORD + "!")) is None
    before = len(access.audit.lines())
    access.audit.add(caller, "POST /api/v1/jobs", "202").result()
    assert before and len(access.audit.lines()) == before + 1 and access.audit.broken() == []


def test_an_answer_of_then_is_given_again(bench: Path) -> None:
    file = bench / "sessions.jobs" / ANSWERS
    (kept,) = (each for each in read_answers(file).values() if "/jobs kept" in each.place)
    again = AnswerStore(file, lambda: kept.at_s + 3600.0).begin(kept.place, ASKED)
    assert again and (again.status, again.headers["location"]) == (202, kept.headers["location"])


def test_names_of_then_are_backed_up_and_the_catalogue_rebuilt(bench: Path) -> None:
    catalogue = Catalogue(bench / "sessions")
    assert catalogue.backup(bench / "names.json").names == 1
    assert catalogue.rebuild().names == 1
    assert [each.name for each in read_backup(bench / "names.json")] == ["Ann Example"]
