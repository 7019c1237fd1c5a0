"""Links that log a browser in once, and the cookie that it gets."""

import time
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from api.http.access.access import Access, cookie_name, cookies
from api.http.access.logins import LOGIN_S, LOGINS, TICKET_S, Logins, Passes
from api.http.access.scopes import Caller, Scope
from api.http.access.secrets import awake_s
from api.http.service import Service
from mock_devices.testing.access import ADDRESS, client_of
from mock_devices.testing.clock import Clock
from rig.config.wiring import Wiring

ANN = Caller("Ann", Scope.OPERATE, "1", "login")


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def service(tmp_path: Path, clock: Clock) -> Service:
    found = Service(Wiring(), tmp_path, tmp_path)
    found.access = Access(tmp_path / "access", clock.seconds)
    return found


@pytest.fixture
def browser(service: Service) -> TestClient:
    """Not logged in."""
    return client_of(service, scope=None)


def enter(service: Service, browser: TestClient, scope: Scope = Scope.ADMIN) -> None:
    ticket = service.access.logins.ticket("Ann", scope)
    answer = browser.post("/api/v1/auth/ticket", json={"ticket": ticket}, headers={"Origin": ADDRESS})
    assert answer.status_code == 200, answer.text


def test_a_ticket_logs_in_once(service: Service, browser: TestClient) -> None:
    ticket = service.access.logins.ticket("Ann")
    first = browser.post("/api/v1/auth/ticket", json={"ticket": ticket})
    assert first.json() == {"name": "Ann", "scopes": ["read", "operate", "admin"]}
    assert browser.get("/api/v1/auth/me").json()["name"] == "Ann"
    again = browser.post("/api/v1/auth/ticket", json={"ticket": ticket})
    assert (again.status_code, again.json()["code"]) == (401, "ticket")
    assert "`rig token link` prints another" in again.json()["detail"]


def test_a_ticket_is_good_for_five_minutes(service: Service, browser: TestClient, clock: Clock) -> None:
    tickets = service.access.logins
    early = tickets.ticket("Ann")
    clock.advance(1.0)
    late = tickets.ticket("Ann")
    clock.advance(299.5)
    assert browser.post("/api/v1/auth/ticket", json={"ticket": early}).status_code == 401
    assert browser.post("/api/v1/auth/ticket", json={"ticket": late}).status_code == 200
    assert TICKET_S == 300


def test_no_clock_that_somebody_sets_keeps_a_ticket_alive(monkeypatch: pytest.MonkeyPatch) -> None:
    logins = Logins()
    ticket = logins.ticket("Ann")
    monkeypatch.setattr(time, "time", lambda: 0.0)
    monkeypatch.setattr(time, "time_ns", lambda: 0)
    before_s = awake_s()
    assert before_s > 0
    real = time.clock_gettime
    monkeypatch.setattr(time, "clock_gettime", lambda clock: real(clock) + TICKET_S * (clock == time.CLOCK_BOOTTIME))
    assert logins.tickets.take(ticket) is None


def test_the_cookie_is_for_this_service_alone_and_no_script_sees_it(service: Service, browser: TestClient) -> None:
    ticket = service.access.logins.ticket("Ann")
    stated = browser.post("/api/v1/auth/ticket", json={"ticket": ticket}).headers["set-cookie"]
    name, *attributes = stated.split("; ")
    assert name.startswith("rig_login_8000=")
    assert {"HttpOnly", "Path=/", "SameSite=strict"} == set(attributes)
    secure = client_of(service, scope=None, base="https://127.0.0.1:8000")
    answer = secure.post("/api/v1/auth/ticket", json={"ticket": service.access.logins.ticket("Ann")})
    assert "Secure" in answer.headers["set-cookie"].split("; ")


def test_with_the_cookie_what_acts_must_come_from_the_services_own_page(service: Service, browser: TestClient) -> None:
    enter(service, browser)
    lease = {"holder": "Ann"}
    assert browser.get("/api/v1/rig").status_code == 200
    nameless = browser.post("/api/v1/control/lease", json=lease)
    assert (nameless.status_code, nameless.json()["code"]) == (403, "origin")
    for origin in ("http://127.0.0.1:9000", "http://evil.example", "null", "http://["):
        refused = browser.post("/api/v1/control/lease", json=lease, headers={"Origin": origin})
        assert (refused.status_code, refused.json()["code"]) == (403, "origin"), origin
    assert browser.post("/api/v1/control/lease", json=lease, headers={"Origin": ADDRESS}).status_code == 200


def test_a_login_has_the_scope_of_its_ticket_and_ends_with_log_out(service: Service, browser: TestClient) -> None:
    enter(service, browser, Scope.READ)
    assert browser.get("/api/v1/auth/me").json() == {"name": "Ann", "scopes": ["read"]}
    refused = browser.post("/api/v1/control/lease", json={"holder": "Ann"}, headers={"Origin": ADDRESS})
    assert refused.json()["code"] == "scope"
    (secret,) = (cookie.value for cookie in browser.cookies.jar)
    assert secret
    assert browser.post("/api/v1/auth/logout", headers={"Origin": ADDRESS}).json()["name"] == "Ann"
    browser.cookies.clear()
    browser.cookies.set(cookie_name(8000), secret)
    assert browser.get("/api/v1/auth/me").status_code == 401


def test_a_login_ends_after_a_day_of_work(service: Service, browser: TestClient, clock: Clock) -> None:
    enter(service, browser)
    clock.advance(LOGIN_S - 1)
    assert browser.get("/api/v1/auth/me").status_code == 200
    clock.advance(2)
    assert browser.get("/api/v1/auth/me").status_code == 401


def test_a_wrong_token_is_not_made_up_for_by_a_cookie(service: Service, browser: TestClient) -> None:
    enter(service, browser)
    assert browser.get("/api/v1/auth/me", headers={"Authorization": "Bearer wrong"}).status_code == 401


def test_of_more_logins_than_there_is_room_for_the_oldest_ends(clock: Clock) -> None:
    passes = Passes(10.0, LOGINS, clock.seconds)
    secrets = [passes.add(ANN) for _ in range(LOGINS + 1)]
    assert [passes.caller(secret) for secret in secrets[:2]] == [None, ANN]
    assert len(passes.held) == LOGINS
    passes.drop(lambda caller: caller.name == "Ann")
    assert passes.caller(secrets[-1]) is None


@pytest.mark.parametrize("header", ["", "a", "a=1; b", "rig_login_8000=", "=;=;", '"', "rig_login_8000=\x00"])
def test_a_cookie_header_of_any_kind_is_no_login(browser: TestClient, header: str) -> None:
    assert isinstance(cookies({"cookie": header}), dict)
    assert browser.get("/api/v1/auth/me", headers={"Cookie": header}).status_code == 401


def test_an_admin_gives_others_links_of_their_own_scope(service: Service, browser: TestClient) -> None:
    wanted, known = {"name": "Ben", "scope": "read"}, service.access.tokens.create("admin", Scope.ADMIN).secret
    made = browser.post("/api/v1/auth/links", json=wanted, headers={"Authorization": f"Bearer {known}"}).json()
    assert made["lasts_s"] == 300
    entered = browser.post("/api/v1/auth/ticket", json={"ticket": made["ticket"]})
    assert entered.json() == {"name": "Ben", "scopes": ["read"]}
