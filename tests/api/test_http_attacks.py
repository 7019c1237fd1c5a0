"""What a careless or malicious program sends, and what happens to folders meanwhile: refused in a sentence."""

import os
import shutil
import threading
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from api.http import app
from api.http.access.access import Access
from api.http.routes import recordings
from api.http.service import Service
from api.operations import motion
from mock_devices.testing.access import ADDRESS, client_of
from rig.config.wiring import Wiring
from rig.results.bench import RetractResult
from tests.api.catalogue.made import MODEL, make_session
from tests.api.jobs import conftest, test_verbs
from tests.api.jobs.asked import begun, ended
from tests.api.jobs.test_computing import planted

service, first, client, bench = conftest.service, conftest.first, conftest.client, test_verbs.bench
# Twice as many as the pool of the service has turns for at once would only wait.
AT_ONCE = 8
RETRACT = {"kind": "retract", "params": {}}


def starts(client: TestClient, keys: list[str]) -> list[tuple[int, str]]:
    """Status and code of as many starts at once as there are keys."""
    found, ready = list[tuple[int, str]](), threading.Barrier(len(keys))

    def start(key: str) -> None:
        ready.wait()
        answer = client.post("/api/v1/jobs", json=RETRACT, headers={"Idempotency-Key": key})
        found.append((answer.status_code, answer.json().get("code", answer.json().get("id"))))

    threads = [threading.Thread(target=start, args=(key,)) for key in keys]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


@pytest.fixture
def moves(bench: object, monkeypatch: pytest.MonkeyPatch) -> Any:
    """How often the bench was moved; each move lasts until ``over`` is set."""
    made = type("Moves", (), {"count": 0, "over": threading.Event()})()

    def retract(*_: object) -> RetractResult:
        made.count += 1
        assert made.over.wait(20.0)
        return RetractResult(outcome="complete")

    monkeypatch.setattr(motion, "retract", retract)
    return made


def test_of_many_starts_at_once_one_moves(client: TestClient, moves: Any) -> None:
    found = Counter(starts(client, [f"key-{number}" for number in range(AT_ONCE)]))
    assert found[409, "busy"] == AT_ONCE - 1 and sum(status == 202 for status, _ in found) == 1
    moves.over.set()
    (job,) = (code for status, code in found if status == 202)
    assert ended(client, job)["state"] == "succeeded" and moves.count == 1


def test_of_the_same_start_sent_many_times_at_once_one_moves(client: TestClient, moves: Any) -> None:
    found = Counter(starts(client, ["one"] * AT_ONCE))
    assert {code for status, code in found if status != 202} <= {"in-progress"}
    (job,) = (code for status, code in found if status == 202)
    changed = {"kind": "doctor", "params": {}}
    refused = client.post("/api/v1/jobs", json=changed, headers={"Idempotency-Key": "one"})
    assert (refused.status_code, refused.json()["code"]) == (422, "idempotency-key-reused")
    moves.over.set()
    ended(client, job)
    again = client.post("/api/v1/jobs", json=RETRACT, headers={"Idempotency-Key": "one"})
    assert (again.json()["id"], again.headers["idempotent-replayed"], moves.count) == (job, "true", 1)


LONG = "x" * 300
WIDE = "\N{GRINNING FACE}" * 100  # 100 letters, 400 bytes


@pytest.mark.parametrize("name", [LONG, WIDE, "%00", "%2e%2e", "..%2f..", ".hidden", "%ff", "a%0d%0ab", "%5c..%5c.."])
@pytest.mark.parametrize("path", ["/sessions/{}", "/sessions/{}/curves", "/recordings/{}/a.mcap", "/uploads/{}"])
def test_a_name_that_can_be_no_folder_is_one_that_is_not_there(client: TestClient, path: str, name: str) -> None:
    answer = client.get("/api/v1" + path.format(name))
    assert answer.status_code == 404, answer.text
    assert answer.json()["code"] in {"no-such-session", "no-such-upload", "no-such-route"}


@pytest.mark.parametrize("file", [LONG, f"fit/{WIDE}", "%00", "fit/%2e%2e/%2e%2e/secret", "a" + "/b" * 2000])
def test_a_file_that_no_file_system_has_is_one_that_is_not_there(client: TestClient, first: Path, file: str) -> None:
    answer = client.get(f"/api/v1/recordings/{first.name}/{file}")
    assert (answer.status_code, answer.json()["code"]) == (404, "no-such-recording")


def test_a_session_of_a_long_name_is_no_job_s(client: TestClient) -> None:
    for name in (WIDE, "a/b", "..", "\x00"):
        refused = client.post("/api/v1/jobs", json={"kind": "verify", "params": {"session": name}})
        assert (refused.status_code, refused.json()["code"]) == (404, "no-such-session")


def test_names_that_are_no_text_hide_no_others(client: TestClient, first: Path) -> None:
    (first / os.fsdecode(b"bad\xff.json")).write_text("{}")
    shutil.copytree(first, first.with_name(os.fsdecode(b"bad\xfe")))
    (listed,) = client.get("/api/v1/recordings").json()["items"]
    shown = client.get(f"/api/v1/sessions/{first.name}").json()
    for found in (listed, shown):
        files = [each["file"] for each in found["recordings"]]
        assert "session.json" in files and all(name.isprintable() for name in files)
    assert "session.json" in [each["name"] for each in shown["files"]]


def test_a_name_of_any_letters_comes_back_as_it_is_and_adds_no_header(client: TestClient, first: Path) -> None:
    name = "a\"b\r\nX-Planted: 1 ü;'"
    first.rename(first.with_name(name))
    (listed,) = client.get("/api/v1/recordings").json()["items"]
    assert listed["name"] == name
    answer = client.get(listed["recordings"][0]["href"])
    assert answer.status_code == 200 and "x-planted" not in answer.headers


@pytest.mark.parametrize("name", ["a\nb.json", "a\r\nX-Planted: 1.json", "\u2028ü;'.json"])
def test_a_file_of_any_letters_is_downloaded_where_its_list_says(client: TestClient, first: Path, name: str) -> None:
    (first / name).write_text("{}")
    listed = {each["name"]: each["href"] for each in client.get(f"/api/v1/sessions/{first.name}").json()["files"]}
    answer = client.get(listed[name])
    assert (answer.status_code, answer.content) == (200, b"{}") and "x-planted" not in answer.headers


def test_no_look_at_a_session_follows_a_link_out_of_it(client: TestClient, first: Path, tmp_path: Path) -> None:
    (tmp_path / "protocols" / "p.toml").write_text('kind = "indentation"\ndepth_mm = 8\n')
    other = tmp_path / "elsewhere"
    other.mkdir()
    (recorded,) = first.glob("*.mcap")
    recorded.rename(other / recorded.name)
    recorded.symlink_to(other / recorded.name)
    shutil.copy(MODEL, other / "model.json")
    (first / "fit").symlink_to(other)
    for path in ("sessions/first/curves", "protocols/p/foresight?session=first"):
        answer = client.get(f"/api/v1/{path}")
        assert (answer.status_code, answer.json()["code"]) == (409, "link"), path


def test_a_session_that_is_removed_under_the_service_is_told_and_hides_no_other(
    client: TestClient, service: Service, first: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone = make_session(service.sessions, "gone")
    shutil.rmtree(gone)
    with monkeypatch.context() as patch:
        patch.setattr(service, "session", lambda _: gone)  # looked for before, and removed since
        for path in ("/sessions/gone", "/sessions/gone/export/mcap"):
            answer = client.get(f"/api/v1{path}")
            assert answer.status_code == 404 and answer.json()["code"] in {"gone", "no-such-session"}, path
        assert client.get("/api/v1/sessions/gone/curves").json()["code"] == "no-recording"
        patch.setattr(recordings, "regular_file", lambda *_: gone / "trial_001.mcap")
        answer = client.get("/api/v1/recordings/gone/trial_001.mcap")
        assert (answer.status_code, answer.json()["code"]) == (404, "gone")
        assert "trial_001.mcap was removed meanwhile" in answer.json()["detail"]
    assert client.get(f"/api/v1/sessions/{first.name}").status_code == 200


def test_a_session_that_is_removed_while_it_is_worked_on_fails_that_job_in_a_sentence(
    client: TestClient, service: Service, first: Path
) -> None:
    planted(service, "removing")
    done = ended(client, begun(client, "verify", session=first.name))
    assert (done["state"], done["problem"]["code"]) == ("failed", "data")
    assert done["message"].endswith("session.json: No such file or directory")


def test_what_is_told_of_subjects_stays_on_no_disk_and_the_page_is_asked_for_again(
    first: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """RFC 9111, 5.2.2.5: what is not to be stored says so; OWASP ASVS asks for it wherever data are sensitive."""
    (tmp_path / "index.html").write_text("a page")
    monkeypatch.setattr(app, "BUILT", tmp_path)
    served = client_of(Service(Wiring(), first.parent, tmp_path))
    for path in ("subjects", "rig", f"recordings/{first.name}/session.json", "none"):
        assert served.get(f"/api/v1/{path}").headers["cache-control"] == "no-store", path
    for path in ("/", "/page/index.html"):
        again = served.get(path)
        assert (again.text, again.headers["cache-control"]) == ("a page", "no-cache")
    known = served.get("/page/index.html", headers={"If-None-Match": again.headers["etag"]})
    assert (known.status_code, known.headers["cache-control"]) == (304, "no-cache")


def refusing(*_: object) -> Any:
    raise OSError(5, "Input/output error", "/srv/sessions/first")


def test_a_disk_that_refuses_is_a_problem_with_a_sentence(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service, "session", refusing)
    answer = client.get("/api/v1/sessions/first")
    assert (answer.status_code, answer.json()["code"]) == (503, "storage")
    assert answer.json()["detail"] == "/srv/sessions/first: Input/output error; see to that, then try again"


def test_a_stop_on_this_computer_passes_where_credentials_cannot_be_read(
    client: TestClient, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service.access, "caller", refusing)
    assert client.get("/api/v1/rig").json()["code"] == "access"
    assert client.post("/api/v1/estop").json()["code"] == "disconnected"
    elsewhere = TestClient(client.app, base_url=ADDRESS, client=("192.0.2.7", 50_000))
    assert elsewhere.post("/api/v1/estop").json()["code"] == "access"


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"[" * 60_000, 400),
        (b'{"kind": "fit", "kind": "retract"', 422),
        (b"\xff\xfe", 422),
        (b"null", 422),
        (b"1e999", 422),
    ],
)
def test_a_body_that_is_no_request_is_refused(client: TestClient, body: bytes, status: int) -> None:
    answer = client.post("/api/v1/jobs", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == status and answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize(("passed_s", "good"), [(-3600.0, True), (299.0, True), (301.0, False)])
def test_a_ticket_counts_on_a_clock_that_nobody_sets(
    service: Service, tmp_path: Path, passed_s: float, good: bool
) -> None:
    now_s = [10_000.0]
    service.access = Access(now_s=lambda: now_s[0])
    ticket = service.access.logins.ticket("Ann")
    now_s[0] += passed_s
    answer = client_of(service, scope=None).post("/api/v1/auth/ticket", json={"ticket": ticket})
    assert (answer.status_code == 200) is good
