"""The catalogue over HTTP: who may see what, pages, archives, erasure in two steps, and problems in words."""

import contextlib
import io
import os
import shutil
import threading
import zipfile
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import quote

import pytest
from fastapi.testclient import TestClient

from api.catalogue import subjects
from api.catalogue.catalogue import Catalogue, default_file
from api.http import room
from api.http.access.scopes import Scope
from api.http.jobs.kept import EXPORTS
from api.http.jobs.kinds import KINDS
from api.http.jobs.params import VerifyParams
from api.http.routes import catalogue
from api.http.service import Service
from controller.operation import Operation
from mock_devices.testing.access import bearer, client_of
from mock_devices.testing.commands import until
from rig.config.products.bota_sensone import BotaWiring
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Wiring
from tests.api.catalogue.made import diagnosed, fitted, make_session, trial, with_threshold

API = "/api/v1"
NAME = "Ann Unmistakable-Example"


@pytest.fixture
def lab(root: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("RIG_CATALOGUE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(root.parent / "cache"))
    with_threshold(diagnosed(fitted(make_session(root, "first")), "friction"), 7.25)
    make_session(root, "second", {"id": "../S 02/ä", "site": "calf"}, trials=(trial(1, "bad"),))
    Catalogue(root).rename("S01", NAME)
    return root


@pytest.fixture
def service(lab: Path) -> Service:
    """One that is not started: no bench is looked for."""
    wiring = Wiring(force=BotaWiring(port="/dev/no-sensor"), axis=Epos4Wiring(port="/dev/no-adapter"), tracker=None)
    return Service(wiring, lab, lab)


@pytest.fixture
def client(service: Service) -> TestClient:
    return client_of(service)


def as_(scope: Scope) -> dict[str, str]:
    return bearer(scope)


@pytest.mark.parametrize(
    ("path", "found"),
    [
        ("/trials?quality=bad", ["second/trial_001"]),
        ("/models?subject=S01&law=index", ["first/fit/model.json"]),
        ("/models?law=fung", []),
        ("/diagnoses?cause=friction&verdict=explained", ["first/diagnosis/diagnosis.json"]),
        ("/causes?since=2026-11-01", ["first/cause 1 friction"]),
        ("/operations?kind=threshold", ["first/threshold:track_001.threshold.json"]),
    ],
)
def test_each_list_is_asked_by_query(client: TestClient, path: str, found: list[str]) -> None:
    answer = client.get(f"{API}{path}")
    assert answer.status_code == 200, answer.text
    assert [each["key"] for each in answer.json()["items"]] == found


def test_sites_and_history_are_those_of_the_command_line(client: TestClient, lab: Path) -> None:
    assert client.get(f"{API}/sites").json() == Catalogue(lab).sites().model_dump(mode="json")
    assert client.get(f"{API}/subjects/S01").json() == Catalogue(lab).history("S01").model_dump(mode="json")
    odd = client.get(f"{API}/subjects/..%2FS%2002%2F%C3%A4")
    assert odd.json()["subject"]["sessions"] == 1, odd.text


def test_a_reader_sees_no_names_anywhere(client: TestClient) -> None:
    for path in ("/subjects", "/subjects/S01", "/sites", "/operations", "/models"):
        answer = client.get(f"{API}{path}", headers=as_(Scope.READ))
        assert answer.status_code == 200 and NAME not in answer.text
    for path in ("/subjects", "/subjects/S01"):
        assert NAME in client.get(f"{API}{path}", headers=as_(Scope.OPERATE)).text


@pytest.mark.parametrize(
    ("method", "path", "scope"),
    [
        ("GET", "/subjects/S01/export", Scope.READ),
        ("PUT", "/subjects/S01/name", Scope.READ),
        ("DELETE", "/subjects/S01", Scope.READ),
        ("DELETE", "/subjects/S01", Scope.OPERATE),
        ("POST", "/catalogue/rebuild", Scope.OPERATE),
    ],
)
def test_a_smaller_right_is_refused_and_changes_nothing(
    client: TestClient, lab: Path, method: str, path: str, scope: Scope
) -> None:
    answer = client.request(method, f"{API}{path}", json={"name": "x"}, headers=as_(scope))
    assert answer.status_code == 403, answer.text
    assert Catalogue(lab).history("S01").subject.name == NAME


@pytest.mark.parametrize("path", ["/subjects", "/subjects/S01", "/models", "/subjects/S01/export"])
def test_without_a_credential_nothing_is_said(client: TestClient, path: str) -> None:
    answer = client.get(f"{API}{path}", headers={"Authorization": ""})
    assert answer.status_code == 401 and NAME not in answer.text


def named(client: TestClient, name: str, match: str | None = None) -> tuple[int, str]:
    """What comes of naming S01, under the mark of what is there where no other is given."""
    tag = client.get(f"{API}/subjects/S01").headers["etag"] if match is None else match
    answer = client.put(f"{API}/subjects/S01/name", json={"name": name}, headers={"If-Match": tag})
    return answer.status_code, answer.json().get("code", "")


def test_a_name_is_kept_and_forgotten(client: TestClient, lab: Path) -> None:
    assert named(client, "Bo") == (200, "")
    assert Catalogue(lab).history("S01").subject.name == "Bo"
    assert named(client, "") == (200, "")
    assert named(client, "") == (404, "no-such-subject")


def test_no_name_that_somebody_else_gave_meanwhile_is_lost(client: TestClient, lab: Path) -> None:
    old = client.get(f"{API}/subjects/S01").headers["etag"]
    assert named(client, "Bo", old) == (200, "")
    assert named(client, "Cy", old) == (412, "stale")
    assert named(client, "Cy", "") == (428, "if-match")
    assert Catalogue(lab).history("S01").subject.name == "Bo"
    assert named(client, "Di", "*") == (200, "")
    # Of a code that nobody has there is nothing to name, and its first name needs no look.
    assert client.put(f"{API}/subjects/S%2F9/name", json={"name": "Ed"}).status_code == 200
    assert client.put(f"{API}/subjects/S%2F9/name", json={"name": "Flo"}).status_code == 428


def test_the_mark_of_a_name_tells_a_reader_nothing_of_it(client: TestClient) -> None:
    marks = set[str]()
    for name in ("Bo", "Cy"):
        assert named(client, name) == (200, "")
        marks.add(client.get(f"{API}/subjects/S01", headers=as_(Scope.READ)).headers["etag"])
    assert len(marks) == 1


def test_of_two_who_name_at_once_one_is_told(client: TestClient) -> None:
    tag = client.get(f"{API}/subjects/S01").headers["etag"]
    found: list[int] = []
    threads = [threading.Thread(target=lambda name=name: found.append(named(client, name, tag)[0])) for name in "abcd"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
    assert sorted(found) == [200, 412, 412, 412]


def test_an_archive_is_sent_whole_and_leaves_no_file(client: TestClient, service: Service) -> None:
    answer = client.get(f"{API}/subjects/S01/export", headers=as_(Scope.OPERATE))
    assert answer.headers["content-type"] == "application/zip"
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None and "sessions/first/trial_001.mcap" in archive.namelist()
    assert client.get(f"{API}/subjects/S99/export").status_code == 404
    assert not list((service.jobs.folder / EXPORTS).iterdir())


def test_an_archive_leaves_the_room_that_recordings_need_and_is_made_beside_them(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    exports, made = service.jobs.folder / EXPORTS, list[Path]()

    def make(_lists: Catalogue, _subject: str, out: Path) -> None:
        made.append(out)
        out.write_bytes(b"zip")

    monkeypatch.setattr(catalogue, "export_subject", make)
    assert client.get(f"{API}/subjects/S01/export").content == b"zip"
    assert made[0].parents[1] == exports
    free_bytes = room.LEFT_FREE_BYTES + room.size_of(service.sessions / "first")
    for spare, status in ((0, 200), (-1, 507)):
        usage = SimpleNamespace(free=free_bytes + spare)
        monkeypatch.setattr("shutil.disk_usage", lambda _, usage=usage: usage)
        assert client.get(f"{API}/subjects/S01/export").status_code == status
    assert len(made) == 2 and not list(exports.iterdir())


def test_an_erasure_takes_an_export_under_way_with_it_and_what_that_writes_meanwhile(
    client: TestClient, lab: Path, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    exports, remove = service.jobs.folder / EXPORTS, os.rmdir
    (scratch := exports / ".under-way").mkdir(parents=True)

    def late(*at: object, **stated: object) -> None:
        with contextlib.suppress(FileNotFoundError):
            (scratch / "subject.zip").write_bytes(b"of S01")
        remove(*at, **stated)  # type: ignore[arg-type]

    confirm = client.delete(f"{API}/subjects/S01").json()["confirm"]
    monkeypatch.setattr(os, "rmdir", late)
    assert client.delete(f"{API}/subjects/S01", params={"confirm": confirm}).json()["done"]
    assert not exports.exists() and not list(service.jobs.folder.rglob("*.zip")) and not (lab / "first").exists()


def test_an_archive_that_an_erasure_took_meanwhile_is_gone(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    def make(_lists: Catalogue, _subject: str, out: Path) -> None:
        out.write_bytes(b"zip")
        service.jobs.erase(["first"])

    monkeypatch.setattr(catalogue, "export_subject", make)
    answer = client.get(f"{API}/subjects/S01/export")
    assert (answer.status_code, answer.json()["code"]) == (404, "gone")


def test_a_subject_is_erased_in_two_steps(client: TestClient, lab: Path) -> None:
    first = client.delete(f"{API}/subjects/S01")
    assert first.status_code == 202 and (lab / "first").exists()
    assert "nothing brings them back" in first.json()["statement"]
    wrong = client.delete(f"{API}/subjects/S01", params={"confirm": "yes"})
    assert wrong.status_code == 422 and (lab / "first").exists()
    done = client.delete(f"{API}/subjects/S01", params={"confirm": first.json()["confirm"]})
    assert (done.status_code, done.json()["done"]) == (200, True)
    assert not (lab / "first").exists() and (lab / "second").exists()
    assert client.get(f"{API}/subjects/S01").status_code == 404


@pytest.mark.parametrize("code", ["S\n03", "S/03/name", "\r\nX-Planted: 1", "\u2028"])
def test_a_subject_whose_code_has_any_character_is_shown_named_sent_and_erased(
    client: TestClient, lab: Path, code: str
) -> None:
    make_session(lab, "third", {"id": f"S03{code}S03", "site": "calf"})
    at = f"{API}/subjects/{quote(f'S03{code}S03', safe='')}"
    shown = client.get(at)
    assert (shown.status_code, shown.json()["subject"]["sessions"]) == (200, 1)
    assert client.put(f"{at}/name", json={"name": NAME}, headers={"If-Match": "*"}).status_code == 200
    assert client.get(f"{at}/export").headers["content-type"] == "application/zip"
    done = client.delete(at, params={"confirm": client.delete(at).json()["confirm"]})
    assert done.json()["done"] and not (lab / "third").exists() and (lab / "second").exists()


@pytest.mark.parametrize("address", ["subjects/S01", "sessions/first"])
def test_what_is_being_computed_with_is_not_erased(
    client: TestClient, service: Service, lab: Path, address: str
) -> None:
    ending = threading.Event()

    def work() -> None:
        ending.wait(30.0)

    job = service.jobs.new(KINDS["verify"], VerifyParams(session="first"), "Ann", "first", Operation("verify"))
    service.jobs.start_computing(job, work)
    refused = client.delete(f"{API}/{address}")
    assert (refused.status_code, refused.json()["code"]) == (409, "busy") and (lab / "first").exists()
    ending.set()
    until(lambda: not service.jobs.active, 30.0, "an end of the work")
    assert client.delete(f"{API}/{address}").status_code == 202


def test_an_erasure_in_one_step_would_be_seen(client: TestClient, lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The plant: whatever is planned counts as confirmed."""
    real = subjects.erase_subject
    monkeypatch.setattr(
        "api.http.routes.catalogue.erase_subject",
        lambda lists, subject, _, **__: real(lists, subject, real(lists, subject).confirm),
    )
    with pytest.raises(AssertionError):
        test_a_subject_is_erased_in_two_steps(client, lab)


def test_sessions_removed_under_the_service_are_gone_from_every_list(client: TestClient, lab: Path) -> None:
    assert client.get(f"{API}/models").json()["items"]
    shutil.rmtree(lab / "first")
    assert client.get(f"{API}/models").json()["items"] == []
    shutil.rmtree(lab)
    for path in ("/subjects", "/trials", "/sites", "/operations"):
        assert client.get(f"{API}{path}").status_code == 200
    assert client.get(f"{API}/subjects/S01").json()["subject"]["sessions"] == 0


def test_a_damaged_catalogue_is_a_problem_with_its_next_step_and_is_rebuilt(client: TestClient, lab: Path) -> None:
    default_file(lab).write_bytes(b"damaged" * 1000)
    answer = client.get(f"{API}/models")
    assert (answer.status_code, answer.json()["code"]) == (503, "catalogue")
    assert "`rig catalogue rebuild`" in answer.json()["detail"]
    assert client.post(f"{API}/catalogue/rebuild").json()["sessions"] == 2
    assert client.get(f"{API}/models").status_code == 200


@pytest.mark.parametrize(
    "query", ["limit=0", "limit=501", "limit=x", "cursor=x", "since=soon", "until=1e9", "subject=" + "x" * 501]
)
def test_a_wrong_question_is_422(client: TestClient, query: str) -> None:
    answer = client.get(f"{API}/trials?{query}")
    assert answer.status_code == 422, answer.text
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("code", ["%00", "%FF", "..%2F..%2Fetc%2Fpasswd", "%20", "😀", "'%3B--", "x" * 3000])
def test_a_code_that_nobody_has_is_not_found_or_refused(client: TestClient, code: str) -> None:
    assert client.get(f"{API}/subjects/{code}").status_code in (404, 422)
