"""Sessions over HTTP: pages, every format with ranges, erasure in two steps."""

import errno
import io
import os
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import get_args

import h5py
import pytest
from fastapi.testclient import TestClient

from api.http import room
from api.http.access.scopes import Scope
from api.http.cohorts.params import FitCohortParams
from api.http.jobs import views as job_views
from api.http.jobs.kept import EXPORTS
from api.http.jobs.kinds import KINDS
from api.http.jobs.params import ExportParams, FitParams, ModelRef, SimulateParams
from api.http.models import RequestBody
from api.http.routes import sessions
from api.http.service import Service
from controller.operation import Operation
from mock_devices.testing.access import bearer, client_of
from mock_devices.testing.commands import until
from rig.recording.reader import read_recording
from tests.api.catalogue.made import fitted, make_session
from tests.api.jobs import conftest
from tests.api.jobs.asked import PATIENCE_S

service, first, client = conftest.service, conftest.first, conftest.client
pytestmark = pytest.mark.timeout(600)
API = "/api/v1/sessions"


def test_sessions_are_listed_page_by_page_with_filters(client: TestClient, service: Service) -> None:
    for number in range(3):
        make_session(service.sessions, f"s{number}", {"id": f"S{number % 2}", "site": "calf"})
    page = client.get(f"{API}?limit=2").json()
    rest = client.get(f"{API}?limit=2&cursor={page['next']}").json()
    names = [each["session"] for each in (*page["items"], *rest["items"])]
    assert sorted(names) == ["s0", "s1", "s2"] and rest["next"] is None
    assert [each["session"] for each in client.get(f"{API}?subject=S1").json()["items"]] == ["s1"]


def test_a_session_is_shown_with_what_was_found_in_it(client: TestClient, service: Service) -> None:
    fitted(make_session(service.sessions, "first"))
    shown = client.get(f"{API}/first").json()
    files = {file["name"]: file for file in shown["files"]}
    assert "fit/model.json" in files and shown["name"] == "first"
    answer = client.get(files["fit/model.json"]["href"])
    assert answer.content == (service.sessions / "first" / "fit" / "model.json").read_bytes()
    for wrong in ("none", "..", "%2e%2e", "..%2Ffirst"):
        assert client.get(f"{API}/{wrong}").status_code == 404


def file_of_a_session(service: Service) -> tuple[str, bytes]:
    return "/api/v1/recordings/first/trial_001.mcap", (service.sessions / "first" / "trial_001.mcap").read_bytes()


def file_of_a_job(service: Service) -> tuple[str, bytes]:
    job = service.jobs.new(KINDS["export"], ExportParams(session="first"), "Ann", "first", Operation("export"))
    service.jobs.start_computing(job, lambda: None)
    until(lambda: service.jobs.find(job.id) is None, 30.0, "the job's end")
    service.jobs.files(job.id).mkdir(parents=True)
    (service.jobs.files(job.id) / "session.h5").write_bytes(bytes(1000))
    return f"/api/v1/jobs/{job.id}/files/session.h5", bytes(1000)


def export_of_a_session(service: Service) -> tuple[str, bytes]:
    answer = client_of(service).get(f"{API}/first/export/mcap")
    return f"{API}/first/export/mcap", answer.content


@pytest.mark.parametrize("made", [file_of_a_session, file_of_a_job, export_of_a_session])
def test_the_head_of_a_file_says_how_large_it_is_and_sends_none_of_it(
    client: TestClient, service: Service, made: Callable[[Service], tuple[str, bytes]]
) -> None:
    make_session(service.sessions, "first")
    address, content = made(service)
    head, whole = client.head(address), client.get(address)
    assert (head.status_code, head.content, whole.content) == (200, b"", content)
    told = {name: head.headers[name] for name in ("content-length", "etag", "accept-ranges", "last-modified")}
    assert told == {name: whole.headers[name] for name in told}
    assert (told["content-length"], told["accept-ranges"]) == (str(len(content)), "bytes")
    part = client.get(address, headers={"Range": "bytes=1-3", "If-Range": told["etag"]})
    assert (part.status_code, part.content) == (206, content[1:4])
    assert client.head(f"{address}x").status_code in (404, 422)


@pytest.mark.parametrize("form", ["csv", "hdf5", "mcap"])
def test_an_export_that_would_fill_the_disk_does_not_begin(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch, form: str
) -> None:
    make_session(service.sessions, "first")
    monkeypatch.setattr(room, "LEFT_FREE_BYTES", 10**18)
    asked = {"kind": "export", "params": {"session": "first"}}
    for refused in (client.get(f"{API}/first/export/{form}"), client.post("/api/v1/jobs", json=asked)):
        assert (refused.status_code, refused.json()["code"]) == (507, "disk-full")
    assert client.get("/api/v1/jobs").json()["items"] == []
    assert not list((service.jobs.folder / "exports").rglob("*"))


def test_an_export_that_a_full_disk_ends_leaves_nothing(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_session(service.sessions, "first")

    def full(name: str, _form: str, _folder: Path) -> str:
        Path(f"{name}.zip").write_bytes(bytes(1000))
        raise OSError(errno.ENOSPC, "No space left on device", f"{name}.zip")

    monkeypatch.setattr("shutil.make_archive", full)
    refused = client.get(f"{API}/first/export/mcap")
    assert (refused.status_code, refused.json()["code"]) == (507, "disk-full")
    assert not list((service.jobs.folder / "exports").rglob("*"))


@pytest.mark.parametrize("planted", ["without_room", "without_room_unsaid"])
def test_a_format_for_which_the_disk_had_no_room_is_507_and_so_is_its_job(
    client: TestClient, service: Service, planted: str
) -> None:
    make_session(service.sessions, "first")
    service.works["export"] = f"tests.api.jobs.planted:{planted}"
    refused = client.get(f"{API}/first/export/hdf5")
    assert (refused.status_code, refused.json()["code"]) == (507, "disk-full"), refused.text
    (job,) = client.get("/api/v1/jobs?kind=export").json()["items"]
    assert (job["state"], job["problem"]["code"]) == ("failed", "disk-full")
    assert "space" in job["problem"]["detail"] or "quota" in job["problem"]["detail"]


def test_who_only_looks_on_gets_every_format_in_parts_and_fills_no_queue(
    client: TestClient, service: Service, first: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sessions, "PATIENCE_S", PATIENCE_S)
    looks_on = bearer(Scope.READ)
    for form in get_args(sessions.Format):
        whole = client.get(f"{API}/first/export/{form}", headers=looks_on)
        part = client.get(f"{API}/first/export/{form}", headers=looks_on | {"Range": "bytes=2-9"})
        assert (whole.status_code, part.status_code, part.content) == (200, 206, whole.content[2:10])
    monkeypatch.setattr(sessions, "MOST_UNDER_WAY", 1)
    monkeypatch.setattr(sessions, "PATIENCE_S", 0.1)
    make_session(service.sessions, "second")
    service.works["export"] = "tests.api.jobs.planted:patient"
    assert client.get(f"{API}/second/export/csv", headers=looks_on).status_code == 202
    refused = client.get(f"{API}/second/export/mat", headers=looks_on)
    assert (refused.status_code, refused.json()["code"]) == (429, "queue-full")
    assert client.get(f"{API}/first/export/csv", headers=looks_on).status_code == 200
    assert client.post("/api/v1/jobs", json={"kind": "verify", "params": {"session": "first"}}).status_code == 202
    for job in client.get("/api/v1/jobs").json()["items"]:
        client.post(f"/api/v1/jobs/{job['id']}/cancel")


def test_how_many_files_are_not_listed_is_said(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_session(service.sessions, "first")
    whole = client.get(f"{API}/first").json()
    assert len(whole["files"]) > 1 and whole["files_left_out"] == 0
    monkeypatch.setattr(job_views, "MOST_FILES", 1)
    part = client.get(f"{API}/first").json()
    assert (len(part["files"]), part["files_left_out"]) == (1, len(whole["files"]) - 1)


def test_a_page_in_a_session_is_shown_without_any_right_and_everything_else_is_only_saved(
    client: TestClient, service: Service
) -> None:
    folder = make_session(service.sessions, "first")
    for name in ("report.html", "what.svg", "notes.txt"):
        (folder / name).write_text("<script>1</script>")
        answer = client.get(f"/api/v1/recordings/first/{name}")
        (policy,) = answer.headers.get_list("content-security-policy")
        rules = [rule.split() for rule in policy.split(";")]
        shown = name == "report.html"
        assert (["sandbox"] in rules) == (["default-src", "'none'"] in rules) == shown
        assert answer.headers["content-disposition"].startswith("inline" if shown else "attachment")
        assert answer.headers["x-content-type-options"] == "nosniff"


def test_who_asks_for_what_takes_long_is_told_to_come_back_and_it_is_made_once(
    client: TestClient, service: Service, first: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sessions, "PATIENCE_S", 0.2)
    for _ in range(2):
        early = client.get(f"{API}/{first.name}/export/mat")
        assert (early.status_code, early.json()["retry_after_s"], early.headers["retry-after"]) == (202, 5, "5")
    monkeypatch.setattr(sessions, "PATIENCE_S", PATIENCE_S)
    assert client.get(f"{API}/{first.name}/export/mat").content[:6] == b"MATLAB"
    assert len(client.get("/api/v1/jobs?kind=export").json()["items"]) == 1


def test_a_session_is_sent_in_each_format_and_made_once(
    client: TestClient, service: Service, first: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sessions, "PATIENCE_S", PATIENCE_S)
    whole = client.get(f"{API}/first/export/hdf5")
    assert whole.status_code == 200, whole.text
    with h5py.File(io.BytesIO(whole.content)) as file:
        assert len(file) > 0
    part = client.get(f"{API}/first/export/hdf5", headers={"Range": "bytes=0-7"})
    assert (part.status_code, part.content) == (206, b"\x89HDF\r\n\x1a\n")
    assert len(client.get("/api/v1/jobs?kind=export").json()["items"]) == 1
    with zipfile.ZipFile(io.BytesIO(client.get(f"{API}/first/export/csv").content)) as archive:
        assert any(name.endswith(".csv") for name in archive.namelist())
    with zipfile.ZipFile(io.BytesIO(client.get(f"{API}/first/export/mcap").content)) as archive:
        names = archive.namelist()
        archive.extractall(service.sessions.with_name("taken"))
    (trial,) = first.glob("*.mcap")
    assert trial.name in names and read_recording(service.sessions.with_name("taken") / trial.name).complete
    (first / "session.json").touch()
    client.get(f"{API}/first/export/hdf5")
    assert len(client.get("/api/v1/jobs?kind=export").json()["items"]) == 3
    assert client.get(f"{API}/first/export/xls").status_code == 422


def test_exports_of_a_session_as_it_was_go_after_a_week(client: TestClient, service: Service, first: Path) -> None:
    client.get(f"{API}/first/export/mcap")
    exports = service.jobs.folder / EXPORTS
    (old,) = exports.iterdir()
    (left := exports / ".of-a-service-that-was-killed").mkdir()
    for path, days in ((old, 6.9), (left, 7.1)):
        os.utime(path, (time.time() - days * 24 * 3600,) * 2)
    (first / "session.json").touch()
    client.get(f"{API}/first/export/mcap")
    assert old.exists() and not left.exists() and len(list(exports.iterdir())) == 2
    os.utime(old, (time.time() - 7.1 * 24 * 3600,) * 2)
    (first / "session.json").touch()
    client.get(f"{API}/first/export/mcap")
    assert not old.exists() and len(list(exports.iterdir())) == 2


def test_old_exports_go_when_the_service_starts_though_nobody_exports(service: Service) -> None:
    exports = service.jobs.folder / EXPORTS
    exports.mkdir(parents=True)
    for name, days in (("old.zip", 7.1), ("new.zip", 6.9)):
        (exports / name).write_bytes(b"zip")
        os.utime(exports / name, (time.time() - days * 24 * 3600,) * 2)
    with client_of(service):
        assert [path.name for path in exports.iterdir()] == ["new.zip"]


def test_a_session_is_erased_in_two_steps_by_whoever_may(client: TestClient, first: Path) -> None:
    asked = client.delete(f"{API}/first")
    assert (asked.status_code, asked.json()["done"], asked.json()["files"]) == (202, False, len(list(first.iterdir())))
    wrong = client.delete(f"{API}/first?confirm=nonsense")
    assert (wrong.status_code, wrong.json()["code"]) == (409, "stale")
    (first / "note.txt").write_text("something came meanwhile")
    late = client.delete(f"{API}/first?confirm={asked.json()['confirm']}")
    assert late.status_code == 409 and first.is_dir()
    confirm = client.delete(f"{API}/first").json()["confirm"]
    assert client.delete(f"{API}/first?confirm={confirm}", headers=bearer(Scope.OPERATE)).status_code == 403
    done = client.delete(f"{API}/first?confirm={confirm}")
    assert (done.status_code, done.json()["done"]) == (200, True)
    assert not first.exists() and client.delete(f"{API}/first").status_code == 404


def test_a_session_that_is_worked_on_is_not_erased(client: TestClient, service: Service, first: Path) -> None:
    service.works["verify"] = "tests.api.jobs.planted:patient"
    job = client.post("/api/v1/jobs", json={"kind": "verify", "params": {"session": "first"}}).json()["id"]
    refused = client.delete(f"{API}/first")
    assert (refused.status_code, refused.json()["code"]) == (409, "busy") and first.is_dir()
    client.post(f"/api/v1/jobs/{job}/cancel")


@pytest.mark.parametrize(
    ("kind", "asked"),
    [
        ("fit", FitParams(sessions=["other", "first"])),
        ("fit-cohort", FitCohortParams(sessions=["other", "first"])),
        ("simulate", SimulateParams(model=ModelRef(session="first"), reference="press:3")),
    ],
)
def test_a_session_that_one_of_several_or_a_model_is_of_is_not_erased(
    client: TestClient, service: Service, first: Path, kind: str, asked: RequestBody
) -> None:
    make_session(service.sessions, "free")
    service.jobs._enter(service.jobs.new(KINDS[kind], asked, "Ann", None, Operation(kind)))
    refused = client.delete(f"{API}/first")
    assert (refused.status_code, refused.json()["code"]) == (409, "busy") and first.is_dir()
    assert client.delete(f"{API}/free").status_code == 202


def test_one_protocol_that_cannot_be_read_is_listed_with_its_error_and_the_others_stay(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = service.protocols
    (folder / "plain.toml").write_text("depth_mm = 5\n")
    (folder / "wiring.toml").write_text('[force]\nproduct = "bota"\n')
    (folder / "folder.toml").mkdir()
    (folder / "gone.toml").symlink_to(folder / "nowhere")
    listed = {each["name"]: each["refusal"] for each in client.get("/api/v1/protocols").json()["items"]}
    assert listed.keys() == {"plain", "folder", "gone"} and listed["plain"] == ""
    assert "Is a directory" in listed["folder"] and "No such file" in listed["gone"]
    monkeypatch.setattr("api.http.protocols.load", lambda _kind, path: pytest.fail(f"{path} was read again"))
    assert len(client.get("/api/v1/protocols").json()["items"]) == 3
    monkeypatch.undo()
    (folder / "plain.toml").write_text("depth_mm = 500\n")
    assert "500 mm deep" in next(
        each["refusal"] for each in client.get("/api/v1/protocols").json()["items"] if each["name"] == "plain"
    )
