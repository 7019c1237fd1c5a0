"""Whoever is erased is gone from what jobs keep of their sessions too: results, files, exports and uploads."""

import base64
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from api.catalogue.catalogue import Catalogue
from api.catalogue.subjects import erase_subject
from api.cli.app import build
from api.http.answers import ANSWERS, read_answers
from api.http.jobs.kinds import KINDS
from api.http.jobs.params import FitParams, ImportParams, SimulateParams, VerifyParams
from api.http.models import RequestBody
from api.http.service import Service
from api.operations.cohort import kept
from controller.operation import Operation
from mock_devices.testing.access import client_of
from mock_devices.testing.commands import until
from tests.api.catalogue.made import make_session

API, MINE, UPLOAD = "/api/v1", b"the force on S01", "0a1b2c3d4e5f"
WORKED: dict[str, tuple[RequestBody, str | None]] = {
    "verify": (VerifyParams(session="first"), "first"),
    "fit": (FitParams(sessions=["other", "first"]), None),
    "simulate": (SimulateParams.model_validate({"model": {"session": "first"}, "reference": "step:5"}), None),
    "import": (ImportParams(upload=UPLOAD, session="first"), "first"),
    "propose": (KINDS["propose"].params.model_validate({"upload": UPLOAD}), None),
}
OTHERS = (VerifyParams(session="other"), "other")


@pytest.fixture
def service(service: Service, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Service:
    """With sessions of two subjects, and files that one of them was imported from."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    make_session(service.sessions, "first")
    make_session(service.sessions, "other", {"id": "S02", "site": "calf"})
    (service.jobs.uploads / UPLOAD).mkdir(parents=True)
    (service.jobs.uploads / UPLOAD / "raw.csv").write_bytes(MINE)
    kept.keep("fit-of-first", {"model.json": MINE})
    return service


def worked(service: Service, kind: str, params: RequestBody, session: str | None) -> str:
    """A job that has ended and left a file."""
    job = service.jobs.new(KINDS[kind], params, "Ann", session, Operation(kind))

    def work() -> None:
        service.jobs.files(job.id).mkdir(parents=True)
        (service.jobs.files(job.id) / "left.bin").write_bytes(MINE)

    service.jobs.start_computing(job, work)
    until(lambda: service.jobs.find(job.id) is None, 30.0, "the job's end")
    return job.id


def all_worked(service: Service) -> tuple[list[str], str]:
    """Ids of the jobs on the one subject, and of the job on the other."""
    mine = [worked(service, kind, *asked) for kind, asked in WORKED.items()]
    return mine, worked(service, "verify", *OTHERS)


def erased(client: TestClient, what: str) -> None:
    first = client.delete(f"{API}/{what}").json()
    assert client.delete(f"{API}/{what}", params={"confirm": first["confirm"]}).json()["done"]


def holding(folder: Path, content: bytes) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file() and content in path.read_bytes()]


@pytest.mark.parametrize("what", ["subjects/S01", "sessions/first"])
def test_nothing_that_jobs_made_of_an_erased_session_is_served_or_left(
    client: TestClient, service: Service, tmp_path: Path, what: str
) -> None:
    mine, other = all_worked(service)
    assert client.get(f"{API}/sessions/first/export/mcap").status_code == 200
    erased(client, what)
    for job in mine:
        assert client.get(f"{API}/jobs/{job}").status_code == 404
        assert client.get(f"{API}/jobs/{job}/files/left.bin").status_code == 404
    assert [job["id"] for job in client.get(f"{API}/jobs").json()["items"]] == [other]
    assert client.get(f"{API}/jobs/{other}/files/left.bin").content == MINE
    assert client.get(f"{API}/uploads").json()["items"] == []
    assert [path.parents[1].name for path in holding(tmp_path, MINE)] == [other]
    assert not list(service.jobs.folder.rglob("*.zip"))


def test_the_command_line_erases_the_same_and_the_next_service_knows_none_of_it(
    service: Service,
) -> None:
    mine, other = all_worked(service)
    confirm = erase_subject(Catalogue(service.sessions), "S01").confirm
    arguments = ["subject", "erase", "S01", "--sessions", str(service.sessions), "--confirm", confirm]
    assert "S01: erased: 1 sessions" in CliRunner().invoke(build("subject"), arguments).output
    assert {path.name for path in service.jobs.folder.iterdir()} & {*mine, other} == {other}
    assert not holding(service.jobs.uploads, MINE)


def by_command_line(service: Service) -> None:
    confirm = erase_subject(Catalogue(service.sessions), "S01").confirm
    arguments = ["subject", "erase", "S01", "--sessions", str(service.sessions), "--confirm", confirm]
    assert CliRunner().invoke(build("subject"), arguments).exit_code == 0


def by_service(service: Service) -> None:
    erased(client_of(service), "subjects/S01")


ERASERS = pytest.mark.parametrize("erase", [by_service, by_command_line])


@ERASERS
def test_no_answer_that_is_kept_tells_of_who_was_erased_and_none_of_it_is_done_again(
    client: TestClient, service: Service, erase: Callable[[Service], None]
) -> None:
    service.works["verify"] = "tests.api.jobs.planted:wrong"

    def verified(session: str) -> Any:
        asked = {"kind": "verify", "params": {"session": session}}
        key = {"Idempotency-Key": {"first": "one", "other": "two"}[session]}
        return client.post(f"{API}/jobs", json=asked, headers=key)

    def answers() -> bytes:
        kept_there = read_answers(service.jobs.folder / ANSWERS).values()
        return b"".join(base64.b64decode(each.body) + repr(each).encode() for each in kept_there)

    mine, other = verified("first"), verified("other")
    until(lambda: not service.jobs.active, 60.0, "the jobs' end")
    assert mine.json()["id"].encode() in answers() and b'"first"' in answers()
    erase(service)
    assert mine.json()["id"].encode() not in answers() and b'"first"' not in answers()
    again = verified("first")
    assert (again.status_code, again.json()["code"]) == (404, "gone")
    assert verified("other").json() == other.json()
    assert [job["id"] for job in client.get(f"{API}/jobs").json()["items"]] == [other.json()["id"]]


def test_what_the_command_line_erased_is_in_no_list_of_the_service_beside_it(
    client: TestClient, service: Service
) -> None:
    mine, other = all_worked(service)
    assert len(client.get(f"{API}/jobs").json()["items"]) == len(mine) + 1
    by_command_line(service)
    assert [job["id"] for job in client.get(f"{API}/jobs").json()["items"]] == [other]
    assert {client.get(f"{API}/jobs/{job}").status_code for job in mine} == {404}


def test_a_failure_to_remove_what_jobs_keep_brings_the_session_back(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: Path, names: Sequence[str]) -> None:
        raise PermissionError(13, "Permission denied", f"job of {names[0]}")

    monkeypatch.setattr("api.http.jobs.board.erase_kept", broken)
    confirm = client.delete(f"{API}/subjects/S01").json()["confirm"]
    refused = client_of(service).delete(f"{API}/subjects/S01", params={"confirm": confirm})
    assert (refused.status_code, refused.json()["code"]) == (503, "storage")
    assert "nothing was erased" in refused.json()["detail"] and (service.sessions / "first").is_dir()
