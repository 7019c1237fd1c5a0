"""Every route of the application itself: without a credential, with too small a scope, from elsewhere."""

import re
from pathlib import Path

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from api.http.access.limits import KNOWN
from api.http.access.rights import OPERATE, READ, WEBSOCKET, RightsTable, Rule
from api.http.access.scopes import Scope
from api.http.app import build
from api.http.service import Service
from mock_devices.testing.access import ADDRESS, bearer, client_of
from rig.config.products.bota_sensone import BotaWiring
from rig.config.wiring import Wiring

# Whoever opens a route to all has to say so here too.
OPEN = {
    "/", "/page", "/api/v1/info", "/api/v1/auth/login", "/api/v1/auth/ticket", "/api/v1/problems/{code}",
}  # fmt: skip
STOPS = {"/api/v1/estop", "/api/v1/pain", "/api/v1/jobs/{identifier}/cancel"}
ENDLESS = {"/api/v1/events"}
REFUSED = {"no-credential", "scope", "no-right", "origin", "host"}


def a_service(folder: Path) -> Service:
    return Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), folder, folder)


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> TestClient:
    """Without a credential; no bench is connected."""
    return client_of(a_service(tmp_path_factory.mktemp("service")), scope=None)


def application(client: TestClient) -> FastAPI:
    assert isinstance(client.app, FastAPI)
    return client.app


def rules(app: FastAPI) -> list[Rule]:
    return list(RightsTable(app).rules)


def undeclared(app: FastAPI) -> list[str]:
    return [rule.path for rule in rules(app) if rule.right is None]


def asked(client: TestClient, rule: Rule, headers: dict[str, str]) -> str:
    """The code of the refusal of each of a rule's methods; empty where it came to the route."""
    path = re.sub(r"{[^}]*}", "x", rule.path) + ("" if rule.methods else "/x")
    if WEBSOCKET in rule.methods:
        try:
            with client.websocket_connect(path, headers=headers):
                return ""
        except WebSocketDisconnect as closed:
            return "no-credential" if closed.code == 1008 else ""
    codes = set()
    for method in rule.methods or {"GET"}:
        if method == "HEAD":  # has no body that a code could stand in
            status = client.head(path, headers=headers).status_code
            codes.add({401: "no-credential", 403: "scope"}.get(status, ""))
            continue
        answer = client.request(method, path, headers=headers)
        is_problem = answer.headers.get("content-type") == "application/problem+json"
        codes.add(str(answer.json()["code"]) if is_problem else "")
    (code,) = codes
    return code


def test_every_route_declares_a_right_and_few_are_open_to_all(client: TestClient) -> None:
    app = application(client)
    assert undeclared(app) == []
    assert {rule.path for rule in rules(app) if rule.right and rule.right.scope is None} <= OPEN
    assert {rule.path for rule in rules(app) if rule.right and rule.right.stop} == STOPS


def test_a_route_that_declares_no_right_is_found_and_serves_nobody(tmp_path: Path) -> None:
    app = build(a_service(tmp_path))
    app.get("/api/v1/planted")(lambda: "secret")
    app.get("/api/v1/declared", dependencies=[READ])(lambda: "shown")
    assert undeclared(app) == ["/api/v1/planted"]
    client = TestClient(app, base_url=ADDRESS)
    refused = client.get("/api/v1/planted", headers=bearer(Scope.ADMIN))
    assert (refused.status_code, refused.json()["code"]) == (403, "no-right")
    assert client.get("/api/v1/declared", headers=bearer(Scope.READ)).json() == "shown"


def test_a_route_checks_its_right_itself_where_nothing_stands_before_it() -> None:
    app = FastAPI()
    app.get("/planted", dependencies=[READ])(lambda: "secret")
    with pytest.raises(Exception, match="did not pass the check of rights"):
        TestClient(app).get("/planted")


def test_every_operation_of_the_description_is_one_whose_right_is_checked(client: TestClient) -> None:
    paths = client.get("/api/v1/openapi.json", headers=bearer()).json()["paths"]
    described = [(method.upper(), path) for path, operations in paths.items() for method in operations]
    assert len(described) > 40
    table = RightsTable(application(client))
    for method, path in described:
        rule = table.find(method, re.sub(r"{[^}]*}", "x", path))
        assert rule and rule.path.replace(":path", "") == path and rule.right, (method, path)
        told = paths[path][method.lower()]["responses"]
        assert {"401", "403"} <= told.keys(), (method, path)
        asked = [sorted(one) for one in paths[path][method.lower()]["security"]]
        either = [["token"], ["login"]]
        assert asked == ([] if rule.path in OPEN else [[], *either] if rule.path in STOPS else either), (method, path)


def test_without_a_credential_only_what_is_open_answers(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("api.http.guard.UNKNOWN", KNOWN)  # more routes at once than a stranger may ask for
    for rule in rules(application(client)):
        assert rule.right
        if rule.right.scope is not None and not rule.right.stop:
            assert asked(client, rule, {}) == "no-credential", rule.path
        else:
            assert asked(client, rule, {}) not in REFUSED, rule.path


def test_a_scope_below_the_one_asked_for_is_refused_and_named(client: TestClient) -> None:
    tried = 0
    for rule in rules(application(client)):
        assert rule.right
        scope = rule.right.scope
        if scope is not None and scope > Scope.READ:
            below = Scope(scope - 1)
            assert asked(client, rule, bearer(below)) == "scope", rule.path
            tried += 1
    assert tried > 5
    refused = client.post("/api/v1/tokens", json={}, headers=bearer(Scope.OPERATE))
    assert refused.status_code == 403
    assert refused.json()["detail"].endswith("may operate here, and this asks for the scope admin")


def test_with_its_scope_every_route_is_reached(client: TestClient) -> None:
    for rule in rules(application(client)):
        assert rule.right
        if rule.right.scope is not None and rule.path not in ENDLESS and "GET" in rule.methods:
            assert asked(client, rule, bearer(rule.right.scope)) not in REFUSED, rule.path


@pytest.mark.parametrize("path", sorted(STOPS))
def test_a_stop_needs_nothing_on_this_computer_and_any_scope_from_elsewhere(client: TestClient, path: str) -> None:
    path = path.replace("{identifier}", "x")
    here = client.post(path)
    assert here.json()["code"] in {"disconnected", "no-such-job"}
    app = application(client)
    elsewhere = TestClient(app, base_url=ADDRESS, client=("192.0.2.7", 50_000))
    for remote, headers in (
        (elsewhere, {}),
        (client, {"X-Forwarded-For": "192.0.2.7"}),
        (client, {"Forwarded": "for=x"}),
    ):
        refused = remote.post(path, headers=headers)
        assert (refused.status_code, refused.json()["code"]) == (401, "no-credential")
    assert elsewhere.post(path, headers=bearer(Scope.READ)).json()["code"] in {"disconnected", "no-such-job"}


@pytest.mark.parametrize("sent", ["Bearer nonsense", "Bearer ", "Basic dXNlcjpwYXNz", "rig_abc"])
def test_what_is_no_token_of_this_service_is_no_credential(client: TestClient, sent: str) -> None:
    refused = client.get("/api/v1/rig", headers={"Authorization": sent})
    assert (refused.status_code, refused.headers["www-authenticate"]) == (401, "Bearer")
    assert "rig token create NAME --scope read" in refused.json()["detail"]


def test_an_address_that_no_route_serves_is_told_to_those_with_a_credential_alone(client: TestClient) -> None:
    assert client.get("/api/v1/nothing").status_code == 401
    assert client.get("/api/v1/nothing", headers=bearer(Scope.READ)).status_code == 404
    wrong = client.delete("/api/v1/rig", headers=bearer(Scope.READ))
    assert (wrong.status_code, wrong.headers["allow"]) == (405, "GET")


def test_a_body_is_not_read_before_the_credential(client: TestClient) -> None:
    refused = client.post("/api/v1/jobs", content=b"{" * 60_000, headers={"Content-Type": "application/json"})
    assert refused.status_code == 401


# What each route that takes the lease is sent, so that nothing else is wrong with it.
BODIES: dict[str, object] = {
    "/api/v1/jobs": {"kind": "retract", "params": {}},
    "/api/v1/recover": {},
    "/api/v1/subject": {"id": "S01", "site": "calf", "pain_threshold_N": 10.0},
}


def test_every_route_that_takes_the_lease_refuses_one_that_is_stale_and_names_the_holder(client: TestClient) -> None:
    paths = client.get("/api/v1/openapi.json", headers=bearer()).json()["paths"]
    taking = [
        (method, path)
        for path, operations in paths.items()
        for method, operation in operations.items()
        if any(one["name"] == "X-Control-Lease" for one in operation.get("parameters", []))
    ]
    assert len(taking) >= 6
    assert ("post", "/api/v1/jobs") in taking
    held = client.post("/api/v1/control/lease", json={"holder": "Ann", "ttl_s": 30.0}, headers=bearer()).json()
    for method, path in taking:
        stale = bearer() | {"X-Control-Lease": "stale"}
        refused = client.request(method, path.replace("{identifier}", "x"), json=BODIES.get(path), headers=stale)
        if refused.json()["code"] != "no-such-job":
            assert (refused.status_code, refused.json()["code"]) == (423, "no-lease"), path
            assert refused.json()["holder"] == held["holder"], path
    client.delete("/api/v1/control/lease", headers=bearer() | {"X-Control-Lease": held["lease_id"]})


# What acts without moving the bench: the lease itself, credentials, files and lists. Everything else takes the lease.
WITHOUT_LEASE = {
    "POST /api/v1/control/lease", "POST /api/v1/control/take", "POST /api/v1/auth/links", "POST /api/v1/tokens",
    "DELETE /api/v1/tokens/{name}", "POST /api/v1/uploads", "DELETE /api/v1/uploads/{identifier}",
    "PUT /api/v1/subjects/{subject:path}/name", "DELETE /api/v1/subjects/{subject:path}",
    "DELETE /api/v1/sessions/{session}", "POST /api/v1/catalogue/rebuild",
}  # fmt: skip


def acting(app: FastAPI) -> list[tuple[str, str]]:
    """Method and path of each route that changes something and is no stop."""
    return [
        (method, rule.path)
        for rule in rules(app)
        if rule.right and rule.right.scope is not None and rule.right.scope > Scope.READ and not rule.right.stop
        for method in sorted(rule.methods - {"GET", "HEAD"})
    ]


def unfenced(client: TestClient, old: str, bob: str) -> list[str]:
    """Routes that act without the lease, or under the ``old`` one after it was taken over by Bob."""
    found = []
    for method, path in acting(application(client)):
        name = f"{method} {path}"
        if name in WITHOUT_LEASE:
            continue
        body = BODIES.get(path, {} if method == "POST" else None)
        headers = bearer() | {"X-Control-Lease": old, "If-Match": "*"}
        answer = client.request(method, re.sub(r"{[^}]*}", "x", path), json=body, headers=headers)
        said = answer.json()
        if (answer.status_code, said.get("code")) != (423, "no-lease"):
            found.append(name)
        elif (said["holder"], said["taken_by"], said["reason"]) != (bob, bob, "Ann went home"):
            found.append(f"{name} does not name Bob")
    return found


def test_whoever_was_relieved_of_control_cannot_act_under_the_lease_of_before(client: TestClient) -> None:
    app = application(client)
    names = {f"{method} {path}" for method, path in acting(app)}
    assert names >= WITHOUT_LEASE and len(names - WITHOUT_LEASE) >= 8
    first = client.post("/api/v1/control/lease", json={"holder": "Ann", "ttl_s": 30.0}, headers=bearer()).json()
    taking = {"holder": "Bob", "ttl_s": 30.0, "reason": "Ann went home"}
    second = client.post("/api/v1/control/take", json=taking, headers=bearer()).json()
    assert second["epoch"] == first["epoch"] + 1
    assert unfenced(client, first["lease_id"], second["holder"]) == []
    held = bearer() | {"X-Control-Lease": second["lease_id"]}
    assert client.put("/api/v1/control/lease", headers=held).status_code == 200
    app.post("/api/v1/planted", dependencies=[OPERATE])(lambda: {})
    assert unfenced(client, first["lease_id"], second["holder"]) == ["POST /api/v1/planted"]
    app.router.routes.pop()
    client.delete("/api/v1/control/lease", headers=held)
