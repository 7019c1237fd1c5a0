"""The control lease: one holder at a time, until it runs out; what moves needs it, looking and stopping do not."""

import re
import time
from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from api.http.access.scopes import Scope
from api.http.lease import LeaseRegistry
from api.http.problems import RequestRefused
from api.http.service import Service
from mock_devices.testing.access import bearer, client_of
from mock_devices.testing.clock import Clock
from rig.config.products.bota_sensone import BotaWiring
from rig.config.wiring import Wiring

HEADER = "X-Control-Lease"
CAPTURE = {"kind": "capture", "params": {"protocol": "indentation", "session": "a"}}


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Service, TestClient]]:
    folder = tmp_path_factory.mktemp("service")
    service = Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), folder, folder)
    with client_of(service) as client:
        yield service, client


@pytest.fixture
def client(served: tuple[Service, TestClient], clock: Clock) -> TestClient:
    service, client = served
    service.control = LeaseRegistry(clock.seconds)
    return client


def taken(client: TestClient, holder: str = "Ann", ttl_s: float = 5.0) -> dict[str, str]:
    answer = client.post("/api/v1/control/lease", json={"holder": holder, "ttl_s": ttl_s})
    assert answer.status_code == 200, answer.text
    return {HEADER: answer.json()["lease_id"]}


def as_told(client: TestClient, own: str) -> str:
    return f"{client.get('/api/v1/auth/me').json()['name']} ({own})"


def test_nobody_is_in_control_in_anothers_name(client: TestClient) -> None:
    ann, eve = (
        client.get("/api/v1/auth/me", headers=bearer(one)).json()["name"] for one in (Scope.ADMIN, Scope.OPERATE)
    )
    first = client.post("/api/v1/control/lease", json={"holder": ann}, headers=bearer(Scope.OPERATE)).json()
    assert first["holder"] == f"{eve} ({ann})" == client.get("/api/v1/rig").json()["control"]["holder"]
    taking = {"holder": eve, "reason": "not hers"}
    assert client.post("/api/v1/control/take", json=taking).json()["holder"] == f"{ann} ({eve})"
    assert client.post("/api/v1/control/take", json=taking, headers=bearer(Scope.OPERATE)).json()["holder"] == eve


def test_a_second_user_is_refused_and_told_who_is_in_control(client: TestClient) -> None:
    taken(client, "Ann")
    second = client.post("/api/v1/control/lease", json={"holder": "Ben"})
    assert (second.status_code, second.json()["code"]) == (423, "lease-held")
    assert f"{as_told(client, 'Ann')} has been in control since" in second.json()["detail"]
    assert second.json()["holder"] == as_told(client, "Ann")
    assert client.get("/api/v1/rig").json()["control"]["holder"] == as_told(client, "Ann")
    assert client.get("/api/v1/control/lease").json()["left_s"] == pytest.approx(5.0)


def test_a_lease_that_is_not_renewed_runs_out_and_the_next_user_may_have_it(client: TestClient, clock: Clock) -> None:
    first = taken(client, "Ann")
    clock.advance(4.9)
    assert client.put("/api/v1/control/lease", headers=first).json()["left_s"] == pytest.approx(5.0)
    clock.advance(5.0)
    late = client.put("/api/v1/control/lease", headers=first)
    assert (late.status_code, late.json()["code"]) == (423, "no-lease")
    assert "that lease is not in force; nobody is in control" in late.json()["detail"]
    taken(client, "Ben")
    assert (
        f"{as_told(client, 'Ben')} is in control" in client.put("/api/v1/control/lease", headers=first).json()["detail"]
    )


def test_a_lease_that_is_given_back_is_free_at_once(client: TestClient) -> None:
    assert client.delete("/api/v1/control/lease", headers=taken(client, "Ann")).json()["holder"] == ""
    taken(client, "Ben")


@pytest.mark.parametrize(("path", "body"), [("/jobs", CAPTURE), ("/estop/reset", None), ("/rig/connect", None)])
def test_what_moves_or_arms_needs_the_lease(client: TestClient, path: str, body: object) -> None:
    without = client.post(f"/api/v1{path}", json=body)
    assert (without.status_code, without.json()["code"]) == (423, "no-lease")
    assert "no X-Control-Lease header was sent" in without.json()["detail"]
    assert client.post(f"/api/v1{path}", json=body, headers=taken(client)).json().get("code") != "no-lease"


@pytest.mark.parametrize("path", ["/estop", "/pain", "/jobs/none/cancel"])
def test_a_stop_never_asks_who_is_in_control(client: TestClient, path: str) -> None:
    assert client.post(f"/api/v1{path}").json()["code"] in {"disconnected", "no-such-job"}


@pytest.mark.parametrize("ttl_s", [0.1, 31, "5", False])
def test_a_lease_lasts_half_a_second_to_half_a_minute(client: TestClient, ttl_s: object) -> None:
    answer = client.post("/api/v1/control/lease", json={"holder": "Ann", "ttl_s": ttl_s})
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid-request")


def test_a_lease_known_by_name_only_is_worth_nothing() -> None:
    control = LeaseRegistry()
    control.take("Ann", 5.0)
    with pytest.raises(RequestRefused, match="that lease is not in force; Ann is in control"):
        control.check("Ann")


def test_each_lease_has_a_greater_epoch_and_its_purpose_is_told(client: TestClient, clock: Clock) -> None:
    body = {"holder": "Ann", "ttl_s": 5.0, "purpose": "calibrate"}
    first = client.post("/api/v1/control/lease", json=body).json()
    refused = client.post("/api/v1/control/lease", json={"holder": "Ben"}).json()
    assert (refused["purpose"], refused["since"]) == ("calibrate", first["since"])
    assert refused["holder"] == as_told(client, "Ann")
    assert client.get("/api/v1/control/lease").json()["purpose"] == "calibrate"
    clock.advance(6.0)
    second = client.post("/api/v1/control/lease", json={"holder": "Ben"}).json()
    assert second["epoch"] == first["epoch"] + 1


def test_control_is_taken_over_with_a_reason_and_who_had_it_is_told(client: TestClient) -> None:
    first = taken(client, "Ann")
    body = {"holder": "Ben", "ttl_s": 5.0, "reason": "Ann has left"}
    second = client.post("/api/v1/control/take", json=body)
    assert second.status_code == 200
    told = client.put("/api/v1/control/lease", headers=first)
    ben = as_told(client, "Ben")
    assert (told.status_code, told.json()["holder"]) == (423, ben)
    said = rf"{re.escape(ben)} took control over at \S+: Ann has left; {re.escape(ben)} is in control"
    assert re.match(said, told.json()["detail"])
    assert (told.json()["taken_by"], told.json()["reason"]) == (ben, "Ann has left")
    assert client.put("/api/v1/control/lease", headers={HEADER: second.json()["lease_id"]}).status_code == 200
    assert client.post("/api/v1/control/take", json={"holder": "Ben", "reason": ""}).status_code == 422


@pytest.mark.parametrize(("moving", "may_stop", "given"), [(0, 0, 1), (0, 1, 1), (1, 0, 0), (1, 1, 1)])
def test_while_something_moves_only_who_may_stop_others_takes_over(moving: bool, may_stop: bool, given: bool) -> None:
    control = LeaseRegistry()
    first = control.take("Ann", 5.0)
    if given:
        assert control.take_over("Ben", 5.0, "", "why", moving, may_stop).epoch > first.epoch
    else:
        with pytest.raises(RequestRefused, match="Ann moves the bench; wait for its end, or stop it"):
            control.take_over("Ben", 5.0, "", "why", moving, may_stop)
    assert control.holds(first.id) is not given


def test_no_clock_that_somebody_sets_keeps_a_lease_alive(monkeypatch: pytest.MonkeyPatch) -> None:
    control, real = LeaseRegistry(), time.clock_gettime
    lease = control.take("Ann", 5.0)
    for name, value in (("time", 0.0), ("time_ns", 0)):
        monkeypatch.setattr(time, name, lambda value=value: value)  # set back to 1970
    assert control.holds(lease.id)
    # The computer sleeps for six seconds: only this clock goes on meanwhile.
    monkeypatch.setattr(time, "clock_gettime", lambda clock: real(clock) + 6.0 * (clock == time.CLOCK_BOOTTIME))
    assert not control.holds(lease.id)
