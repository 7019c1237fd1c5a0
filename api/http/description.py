"""The service's description of itself: each request and answer by an example, each problem of a route by its type."""

import json
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from fastapi import FastAPI

from api.http.access.rights import RightsTable
from api.http.idempotency import holds_secret
from api.http.problems import MEDIA_TYPE, Problem, responses
from api.http.routes.common import PREFIX

Described = dict[str, Any]
# What any request may be refused with before its route sees it.
ANYWHERE = (
    "400 content-length", "400 http", "401 no-credential", "403 host", "403 origin", "403 scope", "404 gone",
    "408 slow-body", "413 too-large", "429 too-many", "503 access", "503 storage",
)  # fmt: skip
KEYED = ("409 in-progress", "409 outcome-unknown", "422 idempotency-key-reused")
# An example of its bytes would tell nobody anything.
BINARY = {"schema": {"type": "string", "format": "binary"}}
# Files of a session, each by its own schema.
ANY_JSON = {"schema": {}, "example": {"version": 1}}


@cache
def examples() -> Mapping[str, Described]:
    """``routes`` by method and path below the prefix, each with ``request`` and answers by status; ``parameters``."""
    found: Described = json.loads(Path(__file__).with_name("examples.json").read_text(encoding="utf-8"))
    return found


def install(app: FastAPI) -> None:
    """``app`` describes what its routes state, with examples and the problems of each."""
    original = app.openapi

    def described() -> Described:
        if app.openapi_schema is None:
            _complete(original(), RightsTable(app))
        return original()

    app.openapi = described  # type: ignore[method-assign]


def _complete(schema: Described, rights: RightsTable) -> None:
    schemas = schema["components"]["schemas"]
    schemas["Problem"] = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    for path, operations in schema["paths"].items():
        for method, operation in operations.items():
            name = f"{method.upper()} {path.removeprefix(PREFIX)}"
            rule = rights.find(method.upper(), path)
            keyed = method == "post" and not holds_secret(path) and not (rule and rule.right and rule.right.stop)
            words = (*ANYWHERE, *(KEYED if keyed else ()), *_stated(operation))
            problems = {str(status): problem for status, problem in responses(*words).items()}
            operation["responses"] = {**operation["responses"], **problems}
            _exemplify(operation, examples()["routes"].get(name, {}))


def _stated(operation: Described) -> Iterator[str]:
    """Status and code of each problem that the route itself tells of, or its parameters do."""
    for status, response in operation["responses"].items():
        yield from (f"{status} {code}" for code in response.get("content", {}).get(MEDIA_TYPE, {}).get("examples", ()))
    if "422" in operation["responses"]:
        yield "422 invalid-request"
    if any(one["name"] == "X-Control-Lease" for one in operation.get("parameters", ())):
        yield "423 no-lease"


def _exemplify(operation: Described, given: Mapping[str, object]) -> None:
    for one in operation.get("parameters", ()):
        if one["name"] in examples()["parameters"]:
            one["example"] = examples()["parameters"][one["name"]]
    for name, body in {"request": operation.get("requestBody", {}), **operation["responses"]}.items():
        for kind, content in body.get("content", {}).items():
            if not content:
                content.update(ANY_JSON if kind == "application/json" else BINARY)
            elif name in given:
                content["example"] = given[name]
