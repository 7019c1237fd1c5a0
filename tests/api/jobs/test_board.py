"""Jobs are listed page by page, outlast the service, and none is left as if it still ran."""

import json
import os
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.http.jobs import board, store, views
from api.http.jobs import job as job_module
from api.http.jobs.board import JobBoard
from api.http.jobs.kept import KEPT_S
from api.http.jobs.kinds import KINDS
from api.http.jobs.params import VerifyParams
from api.http.service import Service
from api.http.streams.events import EventLog
from controller.operation import Operation
from mock_devices.testing.access import client_of
from mock_devices.testing.commands import until
from rig.errors import DataError, DiskFull
from tests.api.jobs.asked import begun, ended


def made(
    jobs: JobBoard, session: str = "first", wait: bool = False, work: Callable[[Path], object] = lambda _: None
) -> str:
    """A job of no ``work``, or what that does with the folder of its files; one that is to ``wait`` is never begun."""
    kind, operation = KINDS["verify"], Operation("verify")
    job = jobs.new(kind, VerifyParams(session=session), "Ann", session, operation)
    if wait:
        jobs._enter(job)
    else:
        jobs.start_computing(job, lambda: work(jobs.files(job.id)))
        until(lambda: jobs.find(job.id) is None, 10.0, "the job's end")
    return job.id


@pytest.fixture
def jobs(tmp_path: Path) -> JobBoard:
    return JobBoard(tmp_path / "sessions", tmp_path, EventLog())


def again(jobs: JobBoard) -> JobBoard:
    """The board of the next service over the same folder."""
    return JobBoard(jobs.folder.with_name("sessions"), jobs.folder.parent, EventLog())


def test_pages_follow_each_other_without_a_gap_while_jobs_are_added(client: TestClient, service: Service) -> None:
    names = [made(service.jobs) for _ in range(5)][::-1]
    page = client.get("/api/v1/jobs?limit=2").json()
    assert [job["id"] for job in page["items"]] == names[:2]
    made(service.jobs)
    found = [job["id"] for job in page["items"]]
    while page["next"]:
        page = client.get(f"/api/v1/jobs?limit=2&cursor={page['next']}").json()
        found += [job["id"] for job in page["items"]]
    assert found == names
    refused = client.get("/api/v1/jobs?cursor=nonsense")
    assert (refused.status_code, refused.json()["code"]) == (422, "refused")


def test_jobs_are_found_by_kind_state_and_session(client: TestClient, service: Service) -> None:
    made(service.jobs, "first")
    second = made(service.jobs, "second")
    for query in ("session=second", "session=second&kind=verify&state=succeeded", "session=second&moves=false"):
        assert [job["id"] for job in client.get(f"/api/v1/jobs?{query}").json()["items"]] == [second]
    for query in ("kind=fit", "state=failed", "moves=true"):
        assert client.get(f"/api/v1/jobs?{query}").json()["items"] == []
    assert client.get("/api/v1/jobs?state=dancing").status_code == 422


def test_a_job_outlasts_the_service_with_its_result(service: Service, client: TestClient, first: Path) -> None:
    job = begun(client, "verify", session=first.name)
    before = ended(client, job)
    other = Service(service.wiring, service.sessions, service.protocols)
    assert client_of(other).get(f"/api/v1/jobs/{job}").json() == before


def test_what_was_under_way_when_the_service_died_is_interrupted(jobs: JobBoard) -> None:
    job = made(jobs, wait=True)
    jobs._store.let_go(job)
    found = json.loads(again(jobs).shown(job))
    assert (found["state"], found["problem"]["code"], found["can"]) == ("interrupted", "interrupted", [])
    assert found["ended"] and "start it again" in found["problem"]["detail"]


def test_what_another_service_has_under_way_is_left_to_it(jobs: JobBoard) -> None:
    job = made(jobs, wait=True)
    assert again(jobs)._known() == {}
    assert json.loads(jobs.shown(job))["state"] == "queued"


def test_a_record_that_was_cut_hides_no_other(jobs: JobBoard) -> None:
    good, cut = made(jobs), made(jobs)
    file = jobs.folder / cut / "job.json"
    file.write_text(file.read_text()[:100])
    assert list(again(jobs)._known()) == [good]


def test_a_job_that_ends_where_the_disk_takes_nothing_is_shown_as_it_ended(
    jobs: JobBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise DiskFull("no room")

    job = made(jobs, work=lambda _: monkeypatch.setattr(store, "write_text", full))
    (listed,) = jobs.listed()
    assert listed.state == json.loads(jobs.shown(job))["state"] == "succeeded"
    monkeypatch.undo()
    assert json.loads(again(jobs).shown(job))["state"] == "interrupted"  # as of the last that it took


def test_a_file_that_goes_while_those_of_a_job_are_listed_hides_neither_its_end_nor_others(
    jobs: JobBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    def writes(folder: Path) -> None:
        folder.mkdir(parents=True)
        for name in ("gone", "kept"):
            (folder / name).write_text("")

        def listing(name: str) -> bool:
            if name == "gone":
                (folder / name).unlink()
            return True

        monkeypatch.setattr(views, "is_text", listing)

    found = json.loads(jobs.shown(made(jobs, work=writes)))
    assert (found["state"], [file["name"] for file in found["files"]]) == ("succeeded", ["files/kept"])


def test_a_job_that_ends_in_words_that_are_no_text_keeps_no_other_waiting(jobs: JobBoard) -> None:
    def fails(_: Path) -> None:
        raise DataError("/srv/\udcff.mcap: is damaged")

    found = json.loads(jobs.shown(made(jobs, work=fails)))
    assert (found["state"], found["problem"]["detail"]) == ("failed", "/srv/?.mcap: is damaged")
    assert json.loads(jobs.shown(made(jobs)))["state"] == "succeeded"


def test_the_oldest_are_forgotten_with_their_files(jobs: JobBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MOST_JOBS", 3)
    names = [made(jobs) for _ in range(5)]
    assert set(jobs._known()) == set(names[2:])
    assert {path.name for path in jobs.folder.iterdir()} == set(names[2:])


def test_a_clock_that_was_set_back_makes_no_new_job_the_oldest(jobs: JobBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MOST_JOBS", 3)
    before = [made(jobs) for _ in range(3)]
    monkeypatch.setattr(job_module, "stamp", lambda: "1970-01-01T00:00:00.000000Z")
    board, now = jobs, [before[2]]
    for _ in range(2):
        board = again(board)  # and so across a start of the service
        now.append(made(board))
    assert set(board._known()) == set(now)
    assert [job.id for job in sorted(board.listed(), key=store.place)] == now


def test_a_clock_that_was_set_forward_takes_no_files(jobs: JobBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    first = made(jobs)
    jobs.files(first).mkdir()
    real = time.time
    monkeypatch.setattr(time, "time", lambda: real() + 2 * KEPT_S)
    made(jobs)
    assert jobs.files(first).is_dir()
    last, seen = made(jobs), jobs._store._now_s()
    jobs.files(last).mkdir()
    os.utime(jobs.files(last), (0, 0))  # as the system says where its clock was set back
    monkeypatch.setattr(jobs._store, "_now_s", lambda: seen)
    made(jobs)
    assert jobs.files(last).is_dir()


def test_files_go_before_their_job_does(jobs: JobBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    job = made(jobs)
    jobs.files(job).mkdir()
    made(jobs)
    assert jobs.files(job).is_dir()
    monkeypatch.setattr(store, "KEPT_S", -1.0)
    made(jobs)
    assert not jobs.files(job).exists() and jobs.shown(job)


def test_a_queue_has_an_end(client: TestClient, service: Service, first: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(board, "MOST_WAITING", 0)
    refused = client.post("/api/v1/jobs", json={"kind": "verify", "params": {"session": first.name}})
    assert (refused.status_code, refused.json()["code"]) == (429, "queue-full")
    assert client.get("/api/v1/jobs").json()["items"] == []


def test_what_waits_does_not_begin_where_the_service_ends(jobs: JobBoard, monkeypatch: pytest.MonkeyPatch) -> None:
    began, released = list[str](), threading.Event()
    first, *others = (
        jobs.new(KINDS["verify"], VerifyParams(session=name), "Ann", name, Operation("verify"))
        for name in ("first", "second", "third")
    )

    def work(name: str) -> None:
        began.append(name)
        assert released.wait(10.0)

    def cancel() -> None:
        released.set()
        until(lambda: jobs.find(first.id) is None, 10.0, "the end of the first")

    monkeypatch.setattr(first, "cancel", cancel)
    jobs.start_computing(first, lambda: work("first"))
    for job in others:
        jobs.start_computing(job, partial(work, job.id))
    jobs.close()
    assert began == ["first"] and jobs.active == []


def test_each_state_of_a_job_is_an_event(jobs: JobBoard) -> None:
    job = made(jobs)
    told = [(event.source, event.code, event.data["state"]) for event in jobs._events.after(0)]
    assert told == [("job", f"job-{state}", state) for state in ("queued", "running", "succeeded")]
    assert {event.data["id"] for event in jobs._events.after(0)} == {job}


@pytest.mark.parametrize("name", ["none", "../first", "..%2f..%2fetc", "job.json"])
def test_a_job_that_is_none_is_not_found(client: TestClient, name: str) -> None:
    for path in (f"/api/v1/jobs/{name}", f"/api/v1/jobs/{name}/files/job.json"):
        assert client.get(path).status_code == 404
    assert client.post(f"/api/v1/jobs/{name}/cancel").status_code == 404


@pytest.mark.parametrize("path", ["../job.json", "..%2Fjob.json", "/etc/passwd", "none"])
def test_of_a_job_only_its_files_are_served(client: TestClient, service: Service, path: str) -> None:
    job = made(service.jobs)
    service.jobs.files(job).mkdir(exist_ok=True)
    assert client.get(f"/api/v1/jobs/{job}/files/{path}").status_code == 404
