"""The audit log: who, what, when, outcome; added to only, and what was changed or taken shows. And rates."""

import contextlib
import json
from concurrent.futures import CancelledError
from datetime import UTC, datetime
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from api.catalogue.pages import Page
from api.http.access import limits
from api.http.access.audit import TAIL_BYTES, AuditLog
from api.http.access.limits import Rate, RateLimits
from api.http.access.rights import OPERATE
from api.http.access.scopes import Caller, Scope
from api.http.app import build
from api.http.service import Service
from mock_devices.testing.access import ADDRESS, bearer, client_of
from mock_devices.testing.clock import Clock
from rig.config.wiring import Wiring

ANN = Caller("Ann", Scope.OPERATE, "12ab", "token")


@pytest.fixture
def log(tmp_path: Path) -> AuditLog:
    return AuditLog(tmp_path / "access" / "audit.jsonl", lambda: datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC))


@pytest.fixture
def service(tmp_path: Path) -> Service:
    found = Service(Wiring(), tmp_path, tmp_path)
    found.access.audit = AuditLog(tmp_path / "audit.jsonl")
    return found


def said(service: Service) -> list[tuple[str, str, str]]:
    service.access.audit.settle()
    return [(line.who.partition("-")[0], line.what, line.outcome) for line in service.access.audit.entries()]


def test_a_line_says_who_what_when_and_how_it_ended(log: AuditLog) -> None:
    log.add(ANN, "POST /api/v1/jobs", "202").result()
    (line,) = log.entries()
    assert (line.seq, line.who, line.credential, line.what, line.outcome) == (
        1, "Ann", "token 12ab", "POST /api/v1/jobs", "202"
    )  # fmt: skip
    assert line.time == "2026-01-02T03:04:05.000+00:00"
    assert oct(log.path.stat().st_mode & 0o777) == "0o600"


def test_lines_follow_each_other_also_of_two_services_and_after_a_restart(log: AuditLog) -> None:
    for who in (log, AuditLog(log.path), log):
        who.add(ANN, "x" * 1000, "200").result()
    assert [line.seq for line in log.entries()] == [1, 2, 3]
    assert log.broken() == []


@pytest.mark.parametrize(("spoil", "found"), [("change", [3]), ("remove", [2]), ("swap", [2, 3, 4]), ("cut", [4])])
def test_a_line_that_was_changed_taken_or_moved_shows(log: AuditLog, spoil: str, found: list[int]) -> None:
    for number in range(4):
        log.add(ANN, f"what {number}", "200").result()
    lines = log.path.read_text().splitlines()
    if spoil == "change":
        lines[1] = lines[1].replace("Ann", "Ben")
    elif spoil == "remove":
        del lines[1]
    elif spoil == "swap":
        lines[1], lines[2] = lines[2], lines[1]
    else:
        lines[3] = lines[3][:40]
    log.path.write_text("\n".join(lines) + "\n")
    assert log.broken() == found


@pytest.mark.parametrize("end", ["", "\n"])
def test_after_a_line_that_a_power_failure_cut_it_goes_on(log: AuditLog, end: str) -> None:
    log.add(ANN, "a", "200").result()
    with log.path.open("a") as file:
        file.write(f'{{"seq": 2, "ti{end}')
    for what in "bc":
        log.add(ANN, what, "200").result()
    assert [(line.seq, line.what) for line in log.entries()] == [(1, "a"), (3, "b"), (4, "c")]
    assert log.broken() == [2]


def test_after_a_cut_line_a_log_longer_than_what_is_looked_at_counts_on(log: AuditLog) -> None:
    for _ in range(250):
        log.add(ANN, "x" * 300, "200")
    log.settle()
    assert log.path.stat().st_size > TAIL_BYTES
    with log.path.open("a") as file:
        file.write('{"seq": 251, "ti')
    log.add(ANN, "b", "200").result()
    assert list(log.entries())[-1].seq == 252
    assert log.broken() == [251]


def test_a_full_disk_is_told_and_keeps_nobody(
    log: AuditLog, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(_fd: int, _data: bytes) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("os.write", full)
        log.add(ANN, "POST /estop", "200").result()
    assert "not in the audit log: POST /estop: No space left on device" in capsys.readouterr().err


def test_what_acts_is_recorded_with_its_outcome_and_looking_is_not(service: Service) -> None:
    client = client_of(service)
    lease = client.post("/api/v1/control/lease", json={"holder": "Ann"}).json()["lease_id"]
    client.get("/api/v1/rig")
    client.put("/api/v1/control/lease", headers={"X-Control-Lease": lease})
    client.put("/api/v1/control/lease", headers={"X-Control-Lease": "stale"})
    client.post("/api/v1/tokens", json={}, headers=bearer(Scope.READ))
    client.post("/api/v1/estop")
    assert said(service) == [
        ("test", "POST /api/v1/control/lease", "200"),
        ("test", "PUT /api/v1/control/lease", "423 no-lease"),
        ("test", "POST /api/v1/tokens", "403 scope"),
        ("test", "POST /api/v1/estop", "503 disconnected"),
    ]


def test_who_logged_in_is_recorded_and_by_which_way(service: Service) -> None:
    password = "a few words are a password"
    service.access.accounts.set("Ben", Scope.READ, password)
    for path, sent in (
        ("ticket", {"ticket": service.access.logins.ticket("Ann")}),
        ("login", {"name": "Ben", "password": password + "!"}),
        ("login", {"name": "Ben", "password": password}),
    ):
        client_of(service, scope=None).post(f"/api/v1/auth/{path}", json=sent)
    service.access.accounts.remove("Ben")
    assert said(service) == [
        ("Ann", "POST /api/v1/auth/ticket", "200"),
        ("", "POST /api/v1/auth/login", "401 password"),
        ("Ben", "POST /api/v1/auth/login", "200"),
    ]
    assert [line.credential.partition(" ")[0] for line in service.access.audit.entries()] == ["link", "", "login"]


def test_what_ended_in_an_error_of_our_own_is_recorded_too(service: Service) -> None:
    def fail() -> None:
        raise ZeroDivisionError("planted")

    app = build(service)
    app.post("/api/v1/planted", dependencies=[OPERATE])(fail)
    client = TestClient(app, ADDRESS, raise_server_exceptions=False, client=("127.0.0.1", 50_000))
    assert client.post("/api/v1/planted", headers=bearer(Scope.OPERATE)).json()["code"] == "error"
    assert said(service) == [("test", "POST /api/v1/planted", "500 error")]


def test_secrets_are_in_no_line(service: Service) -> None:
    client = client_of(service)
    secret = client.post("/api/v1/tokens", json={"name": "planted", "scope": "read"}).json()["token"]
    client.delete("/api/v1/tokens/planted", headers={"Authorization": f"Bearer {secret}"})
    client.delete("/api/v1/tokens/planted")
    assert ("test", "DELETE /api/v1/tokens/planted", "200") in said(service)
    assert secret not in service.access.audit.path.read_text()


def test_somebody_without_a_credential_fills_no_disk(service: Service) -> None:
    client = client_of(service, scope=None)
    for _ in range(40):
        client.get("/api/v1/rig")
    assert said(service) == [("", "GET /api/v1/rig", "401 no-credential")] * 5


def test_an_admin_reads_the_log(service: Service) -> None:
    client = client_of(service)
    client.post("/api/v1/estop")
    shown = client.get("/api/v1/audit").json()
    assert [line["what"] for line in shown["items"]] == ["POST /api/v1/estop"]
    assert shown["broken"] == []
    line = json.loads(service.access.audit.path.read_text())
    assert set(line) == {"seq", "time", "who", "credential", "what", "outcome", "before"}


def test_the_whole_log_is_read_page_by_page_also_where_a_line_is_broken(service: Service) -> None:
    client = client_of(service)
    for _ in range(5):
        client.post("/api/v1/estop")
    service.access.audit.settle()
    path = service.access.audit.path
    path.write_text(path.read_text().replace('"seq":3', '"seq":"3'))
    pages = list[list[int]]()
    cursor: str | None = ""
    while cursor is not None:
        page = client.get("/api/v1/audit", params={"limit": 2, "cursor": cursor}).json()
        pages.append([line["seq"] for line in page["items"]])
        cursor = page["next"]
    assert pages == [[5, 4], [2, 1]]


def test_the_log_is_read_once_for_a_page_and_for_what_is_broken(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = list[AuditLog]()

    def lines(log: AuditLog) -> list[bytes]:
        read.append(log)
        return []

    monkeypatch.setattr(AuditLog, "lines", lines)
    assert client_of(service).get("/api/v1/audit").status_code == 200
    assert len(read) == 1


def test_a_cursor_of_another_list_is_refused(service: Service) -> None:
    foreign = Page(1).first("jobs", ["a", "b"], lambda one: (one, ""))[1]
    refused = client_of(service).get("/api/v1/audit", params={"cursor": foreign})
    assert (refused.status_code, "is none that was given by this list" in refused.text) == (422, True)


def test_a_bucket_fills_steadily_up_to_its_rim() -> None:
    clock = Clock()
    tried = RateLimits(clock.seconds)
    rate = Rate(3, 0.5)
    assert [tried.wait_s("a", rate) for _ in range(3)] == [0, 0, 0]
    assert tried.wait_s("a", rate) == pytest.approx(2.0)
    assert tried.wait_s("b", rate) == 0
    clock.advance(1.0)
    assert tried.wait_s("a", rate) == pytest.approx(1.0)
    clock.advance(1000.0)
    assert [tried.wait_s("a", rate) for _ in range(4)] == [0, 0, 0, pytest.approx(2.0)]


def test_of_many_callers_the_oldest_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "CALLERS", 2)
    tried = RateLimits(Clock().seconds)
    for who in ("a", "b", "c"):
        tried.wait_s(who, Rate(1, 1))
    assert len(tried._buckets) == 2
    assert tried.wait_s("c", Rate(1, 1)) > 0
    assert tried.wait_s("a", Rate(1, 1)) == 0


def limited(client: TestClient, path: str, count: int) -> list[int]:
    return [client.get(path).status_code for _ in range(count)]


def test_who_asks_too_often_is_told_when_to_come_again_and_may_stop_meanwhile(service: Service) -> None:
    clock = Clock()
    service.access.limits = RateLimits(clock.seconds)
    stranger = client_of(service, scope=None)
    assert limited(stranger, "/api/v1/info", 61) == [200] * 60 + [429]
    refused = stranger.get("/api/v1/info")
    assert (refused.json()["code"], refused.headers["retry-after"]) == ("too-many", "1")
    assert {stranger.post("/api/v1/estop").json()["code"] for _ in range(100)} == {"disconnected"}
    assert client_of(service).get("/api/v1/rig").status_code == 200, "another caller"
    clock.advance(1.0)
    assert limited(stranger, "/api/v1/info", 21) == [200] * 20 + [429]


def test_a_script_of_one_token_that_asks_two_hundred_times_a_second_is_served() -> None:
    clock = Clock()
    tried = RateLimits(clock.seconds)
    for _ in range(2000):
        clock.advance(1 / 200)
        assert tried.wait_s("script", limits.KNOWN) == 0


def refused(client: TestClient, path: str, headers: dict[str, str]) -> int:
    """The code that a WebSocket is closed with before it is accepted."""
    with pytest.raises(WebSocketDisconnect) as closed, client.websocket_connect(path, ["rig.v1"], headers=headers):
        pass
    return closed.value.code


def test_a_websocket_that_is_refused_is_recorded_and_one_that_looks_on_is_not(service: Service) -> None:
    app = build(service)
    app.websocket("/api/v1/planted", dependencies=[OPERATE])(lambda _: None)
    client = TestClient(app, base_url=ADDRESS, client=("127.0.0.1", 50_000))
    # The client cancels a route that may just have ended by itself.
    with (
        contextlib.suppress(CancelledError),
        client.websocket_connect("/api/v1/stream", ["rig.v1"], headers=bearer(Scope.READ)) as socket,
    ):
        assert socket.receive_json()["type"] == "hello"
    for path, headers in (
        ("/api/v1/stream", {}),
        ("/api/v1/stream", {"Authorization": "Bearer wrong"}),
        ("/api/v1/stream", bearer(Scope.READ) | {"Origin": "http://elsewhere.example"}),
        ("/api/v1/stream", bearer(Scope.READ) | {"Host": "elsewhere.example"}),
        ("/api/v1/planted", bearer(Scope.READ)),
    ):
        assert refused(client, path, headers) == 1008
    stream = "WEBSOCKET /api/v1/stream"
    assert said(service) == [
        ("", stream, "401 no-credential"), ("", stream, "401 no-credential"), ("", stream, "403 origin"),
        ("", stream, "403 host"), ("test", "WEBSOCKET /api/v1/planted", "403 scope"),
    ]  # fmt: skip
    for _ in range(20):
        refused(client, "/api/v1/stream", {})
    assert len(said(service)) == 6  # five of whoever has no credential, and none that could fill the disk
