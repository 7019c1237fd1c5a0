"""The description shows each request and answer by an example that is valid, and names every problem of a route."""

import copy
import re
from pathlib import Path
from typing import Any

import pytest

from api.http.explained import EXPLAINED
from tests.api import described

STOP = "/api/v1/estop"
HTTP_PAGE = Path(__file__).parents[2] / "docs" / "reference" / "http.md"


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    return described.description()


def test_every_request_answer_and_address_has_an_example(schema: dict[str, Any]) -> None:
    assert len(list(described.operations(schema))) > 60
    assert described.without_example(schema) == []


def test_every_example_is_valid(schema: dict[str, Any]) -> None:
    assert described.wrong_examples(schema) == []


def test_every_route_has_a_summary_and_names_each_problem_by_a_type_that_has_a_page(schema: dict[str, Any]) -> None:
    for name, operation in described.operations(schema):
        assert operation["summary"], name
        if name.startswith("HEAD "):  # told of by its GET
            continue
        told = described.problems(operation)
        assert {word.partition(" ")[2] for word in told} <= EXPLAINED.keys(), name
        assert {"401 no-credential", "403 scope", "429 too-many"} <= told, name
        for status, response in operation["responses"].items():
            if int(status) >= 400:
                assert any(word.startswith(status) for word in told), (name, status)
                assert response["content"].keys() == {described.PROBLEM}, (name, status)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("POST /api/v1/jobs", "409 stopped"),
        ("POST /api/v1/jobs", "422 idempotency-key-reused"),
        ("PUT /api/v1/subject", "423 no-lease"),
        ("PUT /api/v1/subject", "412 stale"),
        ("POST /api/v1/control/lease", "423 lease-held"),
        ("GET /api/v1/sessions/{session}", "404 no-such-session"),
        ("POST /api/v1/estop", "504 not-confirmed"),
    ],
)
def test_the_problems_of_a_route_are_among_them(schema: dict[str, Any], name: str, told: str) -> None:
    assert told in described.problems(dict(described.operations(schema))[name])


SENDING_FILES = {
    "/api/v1/recordings/{session}/{file}", "/api/v1/jobs/{identifier}/files/{path}",
    "/api/v1/sessions/{session}/export/{form}",
}  # fmt: skip


def test_head_is_described_where_it_is_served_and_answers_as_get_does_without_a_body(schema: dict[str, Any]) -> None:
    served = {rule.path.replace(":path", "") for rule in described.rules() if "HEAD" in rule.methods}
    found = {name.removeprefix("HEAD "): one for name, one in described.operations(schema) if name.startswith("HEAD ")}
    assert found.keys() == SENDING_FILES == served & schema["paths"].keys()
    for path, head in found.items():
        get = schema["paths"][path]["get"]
        assert {key: head[key] for key in ("summary", "parameters", "security")} == {
            key: get[key] for key in ("summary", "parameters", "security")
        }
        assert {status: said["description"] for status, said in head["responses"].items()} == {
            status: said["description"] for status, said in get["responses"].items()
        }
        assert not any("content" in said for said in head["responses"].values())
    names = [one["operationId"] for _, one in described.operations(schema)]
    assert len(names) == len(set(names))


def test_a_list_that_goes_by_cursor_tells_of_one_that_is_wrong(schema: dict[str, Any]) -> None:
    by_cursor = [
        one for _, one in described.operations(schema)
        if "cursor" in {each["name"] for each in one.get("parameters", ())}
    ]  # fmt: skip
    assert len(by_cursor) == 17 and all("422 refused" in described.problems(one) for one in by_cursor)


def headers_of(operation: dict[str, Any]) -> set[str]:
    return {one["name"] for one in operation.get("parameters", ()) if one["in"] == "header"}


@pytest.mark.parametrize(
    ("name", "headers"),
    [
        ("POST /api/v1/jobs", {"X-Control-Lease", "Idempotency-Key"}),
        ("POST /api/v1/control/lease", {"Idempotency-Key"}),
        ("POST /api/v1/uploads", {"Idempotency-Key"}),
        ("PUT /api/v1/subject", {"X-Control-Lease", "If-Match"}),
        ("GET /api/v1/recordings/{session}/{file}", {"Range", "If-Range"}),
        ("GET /api/v1/jobs/{identifier}/files/{path}", {"Range", "If-Range"}),
        ("GET /api/v1/sessions/{session}/export/{form}", {"Range", "If-Range"}),
        ("PUT /api/v1/subjects/{subject}/name", {"If-Match"}),
        ("GET /api/v1/events", {"Last-Event-ID"}),
        ("POST /api/v1/estop", set()),
        ("POST /api/v1/tokens", set()),
    ],
)
def test_the_headers_that_a_route_reads_are_declared(schema: dict[str, Any], name: str, headers: set[str]) -> None:
    assert headers_of(dict(described.operations(schema))[name]) == headers


def test_every_credential_is_a_scheme_and_each_route_names_the_scope_it_asks_for(schema: dict[str, Any]) -> None:
    schemes = schema["components"]["securitySchemes"]
    assert (schemes["token"]["type"], schemes["token"]["scheme"]) == ("http", "bearer")
    assert (schemes["login"]["type"], schemes["login"]["in"], schemes["login"]["name"]) == (
        "apiKey", "cookie", "rig_login_8123"
    )  # fmt: skip
    asked = {name: operation["security"] for name, operation in described.operations(schema)}
    assert asked["GET /api/v1/rig"] == [{"token": ["read"]}, {"login": ["read"]}]
    assert asked["POST /api/v1/tokens"] == [{"token": ["admin"]}, {"login": ["admin"]}]
    assert asked["GET /api/v1/info"] == []
    stops = {name for name, either in asked.items() if {} in either}
    assert stops == {f"POST {STOP}", "POST /api/v1/pain", "POST /api/v1/jobs/{identifier}/cancel"}


def differences() -> list[tuple[str, str]]:
    """Words of the design and those of the service, as the reference has them."""
    lines = HTTP_PAGE.read_text(encoding="utf-8").split("## Where it differs")[1].split("## Routes")[0].splitlines()
    rows = [line.split(" | ") for line in lines if line.startswith("| ")][1:]
    return [(row[0], row[1]) for row in rows]


def test_the_reference_names_what_the_service_has_in_the_place_of_words_of_its_design(schema: dict[str, Any]) -> None:
    names = {name.replace(" /api/v1", " ") for name, _ in described.operations(schema)}
    here = {address for _, words in differences() for address in re.findall(r"`([A-Z]+ /[^`]*)`", words)}
    assert len(here) > 5 and here <= names
    fields = set(schema["components"]["schemas"]["Info"]["properties"])
    fields |= set(schema["components"]["schemas"]["LeaseView"]["properties"])
    assert {"service_id", "left_s", "lease_id", "epoch"} <= fields
    assert not {"session_id", "expires"} & fields
    assert set(schema["components"]["schemas"]["RigView"]["properties"]["state"]["enum"]) == {
        "disconnected", "not ready", "idle", "running", "stopped"
    }  # fmt: skip


def test_a_stop_and_what_answers_with_a_secret_heed_no_key(schema: dict[str, Any]) -> None:
    found = dict(described.operations(schema))
    keyed = {name for name in found if "409 in-progress" in described.problems(found[name])}
    assert {"POST /api/v1/jobs", "POST /api/v1/recover", "POST /api/v1/rig/connect"} <= keyed
    assert not {f"POST {STOP}", "POST /api/v1/jobs/{identifier}/cancel", "POST /api/v1/tokens"} & keyed


def test_an_example_that_lacks_or_is_wrong_is_found(schema: dict[str, Any]) -> None:
    planted = copy.deepcopy(schema)
    answer = planted["paths"][STOP]["post"]["responses"]["200"]["content"]["application/json"]
    answer["example"]["done"] = "yes"
    assert [wrong.partition(":")[0] for wrong in described.wrong_examples(planted)] == [
        f"POST {STOP} 200 application/json"
    ]
    del answer["example"], planted["paths"]["/api/v1/tokens/{name}"]["delete"]["parameters"][0]["example"]
    assert described.without_example(planted) == [
        f"POST {STOP} 200 application/json", "DELETE /api/v1/tokens/{name} name"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("method", "path", "problem", "found"),
    [
        ("GET", "/api/v1/jobs/x", "404 no-such-job", False),
        ("GET", "/api/v1/jobs/x", "404 no-such-session", True),
        ("GET", "/api/v1/recordings/a/fit/model.json", "409 busy", True),
        ("GET", "/api/v1/nothing", "404 no-such-route", False),
    ],
)
def test_a_problem_that_its_route_does_not_tell_of_is_found(
    schema: dict[str, Any], method: str, path: str, problem: str, found: bool
) -> None:
    assert described.undescribed(schema, method, path, problem) is found
