"""What the service says that it can do is what it can do: held against the routes and lists that do it."""

from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from api.http import capabilities
from api.http.access.scopes import Scope
from api.http.service import Service
from mock_devices.testing.access import bearer, client_of
from rig.config.products.bota_sensone import BotaWiring
from rig.config.wiring import Wiring

API = "/api/v1"


@pytest.fixture
def client(tmp_path: Path) -> TestClient:
    """Without a credential; no bench is connected, and there is one protocol."""
    (tmp_path / "unmistakable.toml").write_text('kind = "indentation"\n')
    return client_of(Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), tmp_path, tmp_path), scope=None)


def said(client: TestClient) -> dict[str, Any]:
    found: dict[str, Any] = client.get(f"{API}/info").json()["capabilities"]
    return found


def asked(client: TestClient, path: str) -> Any:
    return client.get(f"{API}{path}", headers=bearer(Scope.READ)).json()


def untrue(client: TestClient, told: dict[str, Any]) -> list[str]:
    """What is told and is not so, or is so and not told."""
    assert isinstance(client.app, FastAPI)
    schema = client.app.openapi()
    products = {(one["role"], one["product"]) for one in asked(client, "/devices")["products"]}
    form = next(
        one for one in schema["paths"][f"{API}/sessions/{{session}}/export/{{form}}"]["get"]["parameters"]
        if one["name"] == "form"
    )  # fmt: skip
    kinds = schema["paths"][f"{API}/jobs"]["post"]["requestBody"]["content"]["application/json"]["schema"]
    places = {getattr(route, "path", "") for route in client.app.routes}
    judged = {
        "products": {(role, name) for role, names in told["products"].items() for name in names} == products,
        "streams": told["streams"] == {one["name"]: one["unit"] for one in asked(client, "/streams")["items"]},
        "jobs": set(told["jobs"]) == kinds["discriminator"]["mapping"].keys(),
        "export_formats": told["export_formats"] == form["schema"]["enum"],
        "transports": {told["transports"]["websocket"], told["transports"]["server-sent events"]} <= places,
        "protocols": all(place.startswith(f"/api/{told['protocols'][0]}") for place in told["transports"].values()),
    }
    return [name for name, true in judged.items() if not true]


def test_all_that_is_told_is_so_and_nothing_is_left_out(client: TestClient) -> None:
    told = said(client)
    assert untrue(client, told) == []
    assert (told["streams"]["force"], told["streams"]["position"]) == ("N", "mm")
    assert "bota-sensone" in told["products"]["force"] and "capture" in told["jobs"]


@pytest.mark.parametrize("name", ["products", "streams", "jobs", "export_formats", "transports", "protocols"])
def test_what_is_told_wrongly_is_found(client: TestClient, name: str) -> None:
    told = said(client)
    planted = {
        "products": told["products"] | {"force": told["products"]["force"][1:]},
        "streams": told["streams"] | {"force": "mN"},
        "jobs": [*told["jobs"], "dance"],
        "export_formats": told["export_formats"][:-1],
        "transports": told["transports"] | {"websocket": f"{API}/nothing"},
        "protocols": ["v2", "rig.v1"],
    }
    assert untrue(client, told | {name: planted[name]}) == [name]


def test_the_limits_are_those_that_are_held(client: TestClient) -> None:
    limits = said(client)["limits"]
    headers = bearer()
    sent = [client.post(f"{API}/auth/login", content=b" " * (limits["body_bytes"] + more)) for more in (0, 1)]
    assert [answer.status_code for answer in sent] == [422, 413]
    for path, name in (("/trials", "page_entries"), ("/streams/force/latest", "latest_samples")):
        most = limits[name]
        answers = [client.get(f"{API}{path}?limit={limit}", headers=headers) for limit in (most, most + 1)]
        assert [answer.status_code for answer in answers] == [200, 422], path
    stated = headers | {"Content-Length": str(limits["upload_bytes"] + 1), "Content-Type": "multipart/form-data"}
    assert client.post(f"{API}/uploads", headers=stated).status_code == 413


def test_a_stranger_is_told_of_nothing_that_is_the_laboratory_s_own(client: TestClient, tmp_path: Path) -> None:
    assert "unmistakable" in str(asked(client, "/protocols"))
    assert "unmistakable" not in client.get(f"{API}/info").text
    assert client.get(f"{API}/info").json()["sessions_folder"] == ""
    assert asked(client, "/info")["sessions_folder"] == str(tmp_path)


def test_an_extra_is_there_where_all_that_it_needs_is() -> None:
    requirements = [
        "numpy>=1", "pytest>=8; extra == 'whole'", 'hypothesis[cli]>=6; extra == "whole"',
        "pytest; extra == 'half'", "no-such-distribution>=2; extra == 'half'",
        "no-such-distribution; extra == 'absent'", "pytest; extra == 'dev'",
    ]  # fmt: skip
    assert capabilities.installed(requirements) == ["whole"]


def test_without_a_bench_every_stream_is_lost_and_says_why(client: TestClient) -> None:
    for name in said(client)["streams"]:
        found = asked(client, f"/streams/{name}/latest")
        assert (found["state"], found["samples"], found["last_seen"]) == ("lost", [], None), name
        assert "not connected yet" in found["reason"], name
