"""Every list goes page by page in one way: no entry twice, none left out, and a wrong cursor is one clear problem."""

import base64
import json
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from api.catalogue.catalogue import Catalogue
from api.catalogue.database import Database
from api.catalogue.pages import Page, Place
from api.http.access.models import AccountView
from api.http.access.rights import READ
from api.http.access.scopes import Scope
from api.http.listing import Listing, listing
from api.http.routes.common import PageQuery
from api.http.service import Service
from mock_devices.testing.access import bearer, client_of
from rig.config.products.bota_sensone import BotaWiring
from rig.config.wiring import Wiring
from tests.api.catalogue.made import make_session, trial

API = "/api/v1"
PAGED = {
    "/recordings", "/subjects", "/sites", "/sessions", "/trials", "/models", "/diagnoses", "/causes", "/operations",
    "/jobs", "/audit", "/accounts", "/tokens", "/protocols", "/streams", "/calibrations", "/uploads",
}  # fmt: skip


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """Of a service over seven sessions of four subjects, three of them recorded at the same moment."""
    root = tmp_path_factory.mktemp("lab")
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("RIG_CATALOGUE", raising=False)
        for number, (code, site) in enumerate([("S02", "calf"), ("S01", "calf"), ("S01", "thigh"), ("ä", "calf")], 1):
            make_session(root, f"of {number}", {"id": code, "site": site}, f"2026-11-0{number}T10:00:00Z")
        make_session(root, "twin b", {"id": "S10", "site": "calf"}, "2026-11-02T10:00:00Z")
        make_session(root, "twin a", {"id": "S02", "site": "calf"}, "2026-11-02T10:00:00Z")
        make_session(root, "bad", {"id": "S01", "site": "calf"}, "2026-11-09T10:00:00Z", (trial(1, "bad"),))
        Catalogue(root).rename("S05", "Named, and never measured")
        yield client_of(Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), root, root))


def walked(client: TestClient, path: str, limit: int = 2, query: str = "") -> list[Any]:
    """All entries, page by page; ends where a cursor leads back."""
    found, cursors, cursor = [], set[str](), ""
    while cursor is not None and cursor not in cursors:
        cursors.add(cursor)
        page = client.get(f"{API}{path}?limit={limit}&cursor={cursor}{query}").json()
        assert len(page["items"]) <= limit
        found += page["items"]
        cursor = page["next"]
    return found


ORDER = {
    "/recordings": ("name", ["bad", "of 4", "of 3", "of 2", "twin a", "twin b", "of 1"]),
    "/sessions": ("session", ["bad", "of 4", "of 3", "of 2", "twin a", "twin b", "of 1"]),
    "/subjects": ("subject", ["S01", "S02", "S05", "S10", "ä"]),
    "/sites": ("subject", ["S01", "S01", "S02", "S10", "ä"]),
}


@pytest.mark.parametrize("limit", [1, 2, 7, 500])
@pytest.mark.parametrize("path", ORDER)
def test_pages_hold_every_entry_once_and_in_order(client: TestClient, path: str, limit: int) -> None:
    name, order = ORDER[path]
    assert [entry[name] for entry in walked(client, path, limit)] == order


@pytest.mark.parametrize("path", ORDER)
@pytest.mark.parametrize(
    ("where", "planted"),
    [
        ("after", lambda *_: None),  # the cursor says nothing
        ("first", lambda page, _of, found, _: (tuple(found[: page.limit]), None)),  # what follows is not told of
    ],
)
def test_a_page_that_comes_again_or_is_left_out_would_be_seen(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, path: str, where: str, planted: Any
) -> None:
    monkeypatch.setattr(Page, where, planted)
    monkeypatch.setattr(Database, "looks", None)  # a page is not answered as it was found before
    with pytest.raises(AssertionError):
        test_pages_hold_every_entry_once_and_in_order(client, path, 2)


def test_an_entry_that_goes_meanwhile_takes_no_other_with_it(client: TestClient) -> None:
    first = client.get(f"{API}/subjects?limit=2").json()
    assert [one["subject"] for one in first["items"]] == ["S01", "S02"]
    assert client.put(f"{API}/subjects/S05/name", json={"name": ""}, headers={"If-Match": "*"}).status_code == 200
    rest = client.get(f"{API}/subjects?limit=2&cursor={first['next']}").json()
    client.put(f"{API}/subjects/S05/name", json={"name": "Named, and never measured"})
    assert [one["subject"] for one in rest["items"]] == ["S10", "ä"] and rest["next"] is None


@pytest.mark.parametrize(
    ("path", "found"),
    [
        ("/recordings?subject=S02", ["twin a", "of 1"]),
        ("/recordings?site=thigh", ["of 3"]),
        ("/recordings?quality=bad", ["bad"]),
        ("/recordings?since=2026-11-03&until=2026-11-04", ["of 4", "of 3"]),
        ("/recordings?session=twin%20b", ["twin b"]),
        ("/recordings?kind=track", []),
        ("/subjects?site=thigh", ["S01"]),
        ("/subjects?subject=S10", ["S10"]),
        ("/subjects?subject=S05", ["S05"]),
        ("/subjects?until=2026-11-01", ["S02"]),
        ("/subjects?since=2026-11-04", ["S01", "ä"]),
        ("/subjects?quality=bad&site=calf", ["S01"]),
        ("/subjects?site=arm", []),
        ("/sites?site=thigh", ["S01"]),
    ],
)
def test_a_list_is_asked_by_query(client: TestClient, path: str, found: list[str]) -> None:
    name, _ = ORDER[path.partition("?")[0]]
    answer = client.get(f"{API}{path}")
    assert [entry[name] for entry in answer.json()["items"]] == found, answer.text


def test_pages_of_a_query_are_of_that_query(client: TestClient) -> None:
    assert [one["name"] for one in walked(client, "/recordings", 1, "&subject=S01")] == ["bad", "of 3", "of 2"]
    assert [one["subject"] for one in walked(client, "/subjects", 1, "&site=calf")] == ["S01", "S02", "S10", "ä"]


def test_recordings_come_with_their_files_and_a_reader_sees_no_name(client: TestClient) -> None:
    (one,) = client.get(f"{API}/recordings?session=bad").json()["items"]
    assert {file["file"] for file in one["recordings"]} >= {"session.json", "trial_001.mcap"}
    read = client.get(f"{API}/subjects", headers=bearer(Scope.READ)).text
    assert "never measured" not in read and "S05" not in read


def cursor_of(*facts: object) -> str:
    return base64.urlsafe_b64encode(json.dumps(facts).encode()).decode().rstrip("=")


OTHERS = {"/recordings": "/subjects", "/subjects": "/sites", "/sites": "/sessions", "/sessions": "/subjects"}
WRONG = [
    "x", "W10", "bnVsbA", "é", cursor_of("2026", "of 1"), cursor_of("session", 1, 2), cursor_of("jobs", "a"),
    cursor_of("subjects", None, ""), base64.urlsafe_b64encode(b"[" * 1400).decode(),
]  # fmt: skip


@pytest.mark.parametrize("path", sorted(PAGED))
@pytest.mark.parametrize("cursor", WRONG)
def test_a_wrong_cursor_is_one_problem_that_says_what_to_do(client: TestClient, path: str, cursor: str) -> None:
    answer = client.get(f"{API}{path}", params={"cursor": cursor})
    assert (answer.status_code, answer.json()["code"]) == (422, "refused"), answer.text
    said = answer.json()["detail"]
    assert said.startswith(f"cursor {cursor[:40]}: is none that was given by ")
    assert said.endswith("; leave it out to begin anew")


@pytest.mark.parametrize("path", OTHERS)
def test_a_cursor_of_another_list_is_refused(client: TestClient, path: str) -> None:
    given = client.get(f"{API}{OTHERS[path]}?limit=1").json()["next"]
    answer = client.get(f"{API}{path}?cursor={given}")
    assert answer.status_code == 422 and answer.json()["code"] == "refused"


def test_a_cursor_of_another_list_that_passes_would_be_seen(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The plant: whose it is is not asked."""

    def of_any(page: Page, _: str) -> Place | None:
        _, first, second = json.loads(base64.urlsafe_b64decode(page.cursor + "==")) if page.cursor else ("", "", "")
        return (first, second) if page.cursor else None

    monkeypatch.setattr(Page, "after", of_any)
    with pytest.raises(AssertionError):
        test_a_cursor_of_another_list_is_refused(client, "/sites")


@pytest.mark.parametrize("path", sorted(PAGED))
@pytest.mark.parametrize("limit", ["0", "501", "-1", "many"])
def test_a_page_has_bounds(client: TestClient, path: str, limit: str) -> None:
    assert client.get(f"{API}{path}?limit={limit}").status_code == 422


def lists(app: FastAPI) -> Iterator[tuple[str, bool]]:
    """Path of each list below the prefix, and whether it goes by limit, cursor and query and says what is next."""
    schema = app.openapi()
    for path, methods in schema["paths"].items():
        answer = (
            methods.get("get", {}).get("responses", {}).get("200", {}).get("content", {}).get("application/json", {})
        )
        shape = answer.get("schema", {})
        fields = schema["components"]["schemas"].get(shape.get("$ref", "").rpartition("/")[2], {}).get("properties", {})
        if shape.get("type") == "array" or "items" in fields:
            named = {one["name"] for one in methods["get"].get("parameters", ())}
            yield path.removeprefix(API), "next" in fields and {"limit", "cursor"} < named


def test_every_list_has_a_cursor_and_a_query(client: TestClient) -> None:
    app = client.app
    assert isinstance(app, FastAPI)
    assert dict(lists(app)) == dict.fromkeys(PAGED, True)


def test_a_list_without_a_cursor_or_a_query_is_found(client: TestClient) -> None:
    app = client.app
    assert isinstance(app, FastAPI)

    def whole() -> list[str]:
        return []

    def unasked(page: PageQuery) -> Listing[AccountView]:
        return listing("planted", [], page, lambda one: (one.name, ""))

    for name, planted in (("whole", whole), ("unasked", unasked)):
        app.get(f"{API}/{name}", dependencies=[READ], summary="Planted")(planted)
    app.openapi_schema = None
    found = dict(lists(app))
    assert (found["/whole"], found["/unasked"]) == (False, False)
