"""The same request twice is one; another one under the same key is refused; a stop stops each time."""

import errno
import os
import threading
import time
from base64 import b64decode
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from fastapi import Response
from fastapi.testclient import TestClient

from api.http.access.rights import OPERATE
from api.http.answers import ANSWERS, forget, read_answers
from api.http.app import build
from api.http.idempotency import KEPT_S, AnswerStore, idempotent
from api.http.problems import RequestRefused
from api.http.service import Service
from mock_devices.testing.access import ADDRESS, bearer, client_of, in_control
from mock_devices.testing.clock import Clock
from mock_devices.testing.made.synthetic import Bench, write_made_session
from rig.config.products.bota_sensone import BotaWiring
from rig.config.wiring import Wiring
from rig.errors import DeviceError, DiskFull, SafetyStop, UsageError

BODY = {"kind": "verify", "params": {"session": "first"}}


@pytest.fixture
def service(tmp_path: Path) -> Service:
    write_made_session(tmp_path / "sessions" / "first", Bench().cycles(trials=1, speeds_mm_s=(10.0,)))
    return Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), tmp_path / "sessions", tmp_path)


def sent(client: TestClient, key: str, body: object = BODY) -> Any:
    return client.post("/api/v1/jobs", json=body, headers={"Idempotency-Key": key})


def started(client: TestClient) -> int:
    return len(client.get("/api/v1/jobs").json()["items"])


def test_a_request_that_is_repeated_gets_the_first_answer_and_does_nothing(service: Service) -> None:
    client = client_of(service)
    first, again, other = sent(client, "a"), sent(client, "a"), sent(client, "b")
    assert (again.status_code, again.json()["id"]) == (202, first.json()["id"])
    assert again.headers["location"] == first.headers["location"]
    assert (again.headers["idempotent-replayed"], "idempotent-replayed" in first.headers) == ("true", False)
    assert other.json()["id"] != first.json()["id"] and started(client) == 2


def test_the_same_key_with_another_body_is_refused(service: Service) -> None:
    client = client_of(service)
    sent(client, "a")
    refused = sent(client, "a", {"kind": "report", "params": {"session": "first"}})
    assert (refused.status_code, refused.json()["code"]) == (422, "idempotency-key-reused")
    assert started(client) == 1


@pytest.mark.parametrize("path", ["/api/v1/jobs", "/api/v1/uploads", "/api/v1/control/lease"])
@pytest.mark.parametrize("key", ["a" * 101, "two words"])
def test_a_key_that_cannot_be_kept_is_refused_wherever_one_is_heeded(service: Service, path: str, key: str) -> None:
    refused = client_of(service).post(path, json={"holder": "Ann"}, headers={"Idempotency-Key": key})
    assert (refused.status_code, refused.json()["code"]) == (422, "invalid-request")
    assert "Idempotency-Key" in refused.json()["detail"]


def test_a_key_is_its_senders_own(service: Service) -> None:
    one, two = client_of(service), client_of(service)
    token = two.post("/api/v1/tokens", json={"name": "other", "scope": "operate"}).json()["token"]
    two.headers["Authorization"] = f"Bearer {token}"
    assert sent(one, "a").json()["id"] != sent(two, "a").json()["id"]


def test_what_was_refused_did_nothing_and_may_be_tried_again(service: Service) -> None:
    client = client_of(service)
    body = {"kind": "verify", "params": {"session": "second"}}
    assert sent(client, "a", body).status_code == 404
    (service.sessions / "first").rename(service.sessions / "second")
    assert sent(client, "a", body).status_code == 202
    assert sent(client, "", body).status_code == 202
    assert sent(client, "x" * 101, body).status_code == 422


def test_answers_outlast_the_service(service: Service) -> None:
    first = sent(client_of(service), "a").json()["id"]
    later = Service(service.wiring, service.sessions, service.protocols)
    assert sent(client_of(later), "a").json()["id"] == first


def test_no_other_account_reads_the_lease_of_who_is_in_control(service: Service) -> None:
    client = client_of(service)
    lease = client.post("/api/v1/control/lease", json={"holder": "Ann"}).json()["lease_id"]
    file = service.jobs.folder / ANSWERS
    (kept,) = read_answers(file).values()
    assert lease.encode() in b64decode(kept.body) and oct(file.stat().st_mode & 0o777) == "0o600"
    file.chmod(0o644)  # as an earlier program wrote it
    sent(client_of(Service(service.wiring, service.sessions, service.protocols)), "a")
    assert oct(file.stat().st_mode & 0o777) == "0o600"


def test_a_stop_with_a_key_stops_each_time_and_a_secret_is_not_kept(service: Service) -> None:
    client = client_of(service)
    calls: list[str] = []

    async def stop(kind: Any) -> Any:
        calls.append(kind.name)
        return type("Answer", (), {"text": "braked", "id": len(calls)})()

    service.stop = stop  # type: ignore[method-assign]
    for _ in range(2):
        client.post("/api/v1/estop", headers={"Idempotency-Key": "a"})
    assert len(calls) == 2
    answer = client.post("/api/v1/tokens", json={"name": "n", "scope": "read"}, headers={"Idempotency-Key": "a"})
    assert answer.status_code == 201
    sent(client, "b")
    assert answer.json()["token"] not in (service.jobs.folder / "answers.jsonl").read_text()


@pytest.fixture
def store(tmp_path: Path) -> AnswerStore:
    return AnswerStore(tmp_path / "answers.jsonl", Clock().seconds)


def test_while_an_answer_is_made_the_second_request_waits_for_it(store: AnswerStore) -> None:
    assert store.begin("p", b"x") is None
    with pytest.raises(RequestRefused, match="still being answered") as refused:
        store.begin("p", b"x")
    assert refused.value.status == 409


def test_a_service_that_died_in_the_middle_says_that_it_does_not_know(tmp_path: Path, store: AnswerStore) -> None:
    store.begin("p", b"x")
    with pytest.raises(RequestRefused, match="look whether it took effect") as refused:
        AnswerStore(tmp_path / "answers.jsonl", Clock().seconds).begin("p", b"x")
    assert refused.value.code == "outcome-unknown"


def failing_twice(service: Service, store: AnswerStore, error: Exception) -> tuple[list[str], int]:
    """Codes of two requests under one key to what raises ``error``, and how often that was begun."""
    begun = list[bool]()

    def fail() -> None:
        begun.append(True)
        raise error

    app = build(service)
    route = idempotent(store)
    app.router.add_api_route("/planted", fail, methods=["POST"], dependencies=[OPERATE], route_class_override=route)
    client = TestClient(app, ADDRESS, raise_server_exceptions=False, headers=bearer() | {"Idempotency-Key": "a"})
    answers = [client.post("/planted") for _ in range(2)]
    return [each.json()["code"] for each in answers], len(begun)


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (ZeroDivisionError("planted"), "error"),
        (BrokenPipeError(errno.EPIPE, "broken pipe"), "error"),
        (OSError(errno.EIO, "input/output error", "job.json"), "storage"),
        (OSError(errno.ENOSPC, "no space left"), "disk-full"),
        (DiskFull("planted"), "disk-full"),
        (DeviceError("planted"), "device"),
        (SafetyStop("planted"), "safety-stop"),
    ],
)
def test_what_failed_perhaps_after_a_command_went_out_is_not_done_again_under_its_key(
    service: Service, store: AnswerStore, error: Exception, code: str
) -> None:
    assert failing_twice(service, store, error) == ([code, "outcome-unknown"], 1)


@pytest.mark.parametrize("error", [UsageError("planted"), RequestRefused(422, "refused", "planted")])
def test_what_was_refused_is_looked_at_again_under_its_key(
    service: Service, store: AnswerStore, error: Exception
) -> None:
    assert failing_twice(service, store, error) == (["refused", "refused"], 2)


def test_a_recovery_that_failed_half_way_is_not_begun_again_under_its_key(service: Service) -> None:
    begun = list[object]()

    def recover(consent: object) -> None:
        begun.append(consent)
        raise DeviceError("homing did not end")

    client = in_control(client_of(service))
    service.bench = SimpleNamespace(alive=True, recover=recover)  # type: ignore[assignment]
    asked = {"json": {"clear": True, "home": True}, "headers": {"Idempotency-Key": "a"}}
    answers = [client.post("/api/v1/recover", **asked).json()["code"] for _ in range(2)]  # type: ignore[arg-type]
    assert (answers, len(begun)) == (["not-recovered", "outcome-unknown"], 1)


def test_what_a_full_disk_kept_from_beginning_may_be_tried_again(
    store: AnswerStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "no space left")

    store.begin("other", b"x")
    with monkeypatch.context() as planted, pytest.raises(OSError, match="no space"):
        planted.setattr(os, "fdopen", full)
        store.begin("p", b"x")
    assert store.begin("p", b"x") is None


def test_an_answer_is_kept_for_a_day(tmp_path: Path) -> None:
    clock = Clock()
    store = AnswerStore(tmp_path / "answers.jsonl", clock.seconds)
    store.begin("p", b"x")
    clock.advance(KEPT_S - 1)
    with pytest.raises(RequestRefused):
        store.begin("p", b"y")
    clock.advance(2)
    assert store.begin("p", b"y") is None


@pytest.mark.parametrize("jump_s", [2 * KEPT_S, -2 * KEPT_S])
def test_whoever_sets_the_date_makes_no_key_be_forgotten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, jump_s: float
) -> None:
    file, real_s, set_by_s = tmp_path / "answers.jsonl", time.time, [0.0]
    monkeypatch.setattr(time, "time", lambda: real_s() + set_by_s[0])
    store = AnswerStore(file)
    assert store.begin("p", b"x") is None
    store.end("p", Response(b"{}", 202))
    set_by_s[0] = jump_s
    again = store.begin("p", b"x")
    assert again and again.status == 202
    # A store that asks for the date each time forgets it when that is set forward.
    dated = AnswerStore(file, time.time)
    assert (dated.begin("p", b"x") is None) is (jump_s > 0)


@pytest.mark.parametrize(
    ("name", "body", "told"),
    [
        ("first", '{"session":"first"}', True),
        ("first", '{"session":"first-2","of":"the.first"}', False),
        ('a "b" ä', '{"session":"a \\"b\\" ä"}', True),
        ("a/b ä", '{"href":"/api/v1/sessions/a/b%20%C3%A4"}', True),
        ("a.c", '{"session":"abc"}', False),
    ],
)
def test_what_is_erased_is_taken_out_of_answers_that_name_it_however_they_write_it(
    tmp_path: Path, store: AnswerStore, name: str, body: str, told: bool
) -> None:
    file = tmp_path / "answers.jsonl"
    for place in ("p", "other"):
        assert store.begin(place, b"x") is None
    store.end("p", Response(body.encode(), 202, {"location": "/api/v1/jobs/1"}))
    store.end("other", Response(b"{}", 202))
    forget(file, [name])
    assert [each.status for each in read_answers(file).values()] == [404 if told else 202, 202]
    if told:
        with pytest.raises(RequestRefused, match="has been erased since; it is not done again"):
            store.begin("p", b"x")
    else:
        assert store.begin("p", b"x")
    other = store.begin("other", b"x")
    assert other and other.status == 202


def test_answers_of_which_the_file_was_removed_are_known_until_the_end(tmp_path: Path, store: AnswerStore) -> None:
    store.begin("p", b"x")
    store.end("p", Response(b"{}", 202))
    (tmp_path / "answers.jsonl").unlink()
    assert store.begin("p", b"x")


@pytest.mark.parametrize("end_of_line", ["\x85", "\u2028", "\u2029", "\r\n"])
def test_an_answer_to_a_name_with_an_end_of_a_line_in_it_outlasts_the_service(
    tmp_path: Path, store: AnswerStore, end_of_line: str
) -> None:
    place = f"Ann{end_of_line}of the lab /api/v1/jobs key"
    store.begin(place, b"x")
    store.end(place, Response(b"{}", 202))
    found = AnswerStore(tmp_path / "answers.jsonl", Clock().seconds).begin(place, b"x")
    assert found and (found.place, found.status) == (place, 202)


def test_a_line_that_was_cut_is_no_answer(tmp_path: Path, store: AnswerStore) -> None:
    store.begin("p", b"x")
    file = tmp_path / "answers.jsonl"
    file.write_text(file.read_text() + '{"place": "q", "asked"')
    later = AnswerStore(file, Clock().seconds)
    assert later.begin("q", b"x") is None
    with pytest.raises(RequestRefused):
        later.begin("p", b"x")


@pytest.mark.parametrize("cut", [b'{"place": "q", "asked"', "{'place': 'ä".encode()[:-1]])
def test_what_is_kept_after_a_line_that_was_cut_outlasts_the_service(
    tmp_path: Path, store: AnswerStore, cut: bytes, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "answers.jsonl"
    store.begin("p", b"x")
    with file.open("ab") as planted:  # as a full disk leaves it to a service that goes on
        planted.write(cut)
    assert store.begin("r", b"x") is None
    store.end("r", Response(b"{}", 202))
    assert f"answers.jsonl: left out, not understood: a full disk may have cut it: {cut!r}\n" in capsys.readouterr().err
    assert {each.place: each.status for each in read_answers(file).values()} == {"p": 0, "r": 202}
    again = AnswerStore(file, Clock().seconds).begin("r", b"x")
    assert again and again.status == 202
    assert cut not in file.read_bytes()


def test_an_answer_of_which_only_the_end_of_its_line_was_cut_is_one(tmp_path: Path, store: AnswerStore) -> None:
    file = tmp_path / "answers.jsonl"
    store.begin("p", b"x")
    file.write_bytes(file.read_bytes().removesuffix(b"\n"))
    store.begin("q", b"x")
    assert set(read_answers(file)) == {"p", "q"}


def test_two_at_once_are_one(service: Service) -> None:
    client = client_of(service)
    answers: list[Any] = []
    threads = [threading.Thread(target=lambda: answers.append(sent(client, "a"))) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
    assert {answer.status_code for answer in answers} <= {202, 409}
    assert len({answer.json()["id"] for answer in answers if answer.status_code == 202}) == started(client) == 1
