"""The control lease: one holder at a time, until it runs out; what moves needs it, looking and stopping do not."""

from collections.abc import Iterator

import pytest
from fastapi.testclient import TestClient

from api.http.app import build
from api.http.lease import LeaseRegistry
from api.http.problems import RequestRefused
from api.http.service import Service
from mock_devices.testing.clock import Clock
from rig.config.products.bota_sensone import BotaWiring
from rig.config.wiring import Wiring

HEADER = "X-Control-Lease"
CAPTURE = {"kind": "capture", "protocol": "indentation", "session": "a"}


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Service, TestClient]]:
    folder = tmp_path_factory.mktemp("service")
    service = Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), folder, folder)
    with TestClient(build(service), base_url="http://127.0.0.1:8000") as client:
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


def test_a_second_user_is_refused_and_told_who_is_in_control(client: TestClient) -> None:
    taken(client, "Ann")
    second = client.post("/api/v1/control/lease", json={"holder": "Ben"})
    assert (second.status_code, second.json()["code"]) == (409, "lease-held")
    assert "Ann has been in control since" in second.json()["detail"]
    assert client.get("/api/v1/rig").json()["control"]["holder"] == "Ann"
    assert client.get("/api/v1/control/lease").json()["left_s"] == pytest.approx(5.0)


def test_a_lease_that_is_not_renewed_runs_out_and_the_next_user_may_have_it(client: TestClient, clock: Clock) -> None:
    first = taken(client, "Ann")
    clock.advance(4.9)
    assert client.put("/api/v1/control/lease", headers=first).json()["left_s"] == pytest.approx(5.0)
    clock.advance(5.0)
    late = client.put("/api/v1/control/lease", headers=first)
    assert (late.status_code, late.json()["code"]) == (409, "no-lease")
    assert "that lease is not in force; nobody is in control" in late.json()["detail"]
    taken(client, "Ben")
    assert "Ben is in control" in client.put("/api/v1/control/lease", headers=first).json()["detail"]


def test_a_lease_that_is_given_back_is_free_at_once(client: TestClient) -> None:
    assert client.delete("/api/v1/control/lease", headers=taken(client, "Ann")).json()["holder"] == ""
    taken(client, "Ben")


@pytest.mark.parametrize(("path", "body"), [("/jobs", CAPTURE), ("/estop/reset", None), ("/rig/connect", None)])
def test_what_moves_or_arms_needs_the_lease(client: TestClient, path: str, body: object) -> None:
    without = client.post(f"/api/v1{path}", json=body)
    assert (without.status_code, without.json()["code"]) == (409, "no-lease")
    assert "no X-Control-Lease header was sent" in without.json()["detail"]
    assert client.post(f"/api/v1{path}", json=body, headers=taken(client)).json().get("code") != "no-lease"


@pytest.mark.parametrize("path", ["/estop", "/pain", "/jobs/none/stop"])
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
