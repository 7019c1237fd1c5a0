"""The service's description of itself: each request and answer by an example, each problem of a route by its type."""

import json
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from fastapi import FastAPI

from api.http.access.rights import Right, RightsTable
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


def install(app: FastAPI, cookie: str) -> None:
    """``app`` describes what its routes state, with examples, problems and right of each; ``cookie``: of a login."""
    original = app.openapi

    def described() -> Described:
        if app.openapi_schema is None:
            _complete(original(), RightsTable(app))
            original()["components"]["securitySchemes"] = credentials(cookie)
        return original()

    app.openapi = described  # type: ignore[method-assign]


def credentials(cookie: str) -> Described:
    """By what a request says who asks."""
    token = {"type": "http", "scheme": "bearer", "description": "a token of `rig token create NAME --scope SCOPE`"}
    login = {"type": "apiKey", "in": "cookie", "name": cookie, "description": "of a browser that is logged in"}
    return {"token": token, "login": login}


def asked_of(right: Right) -> list[dict[str, list[str]]]:
    """Either credential, of the scope that is named; a stop on the bench's own computer asks for none."""
    if right.scope is None:
        return []
    either: list[dict[str, list[str]]] = [{name: [right.scope.word]} for name in ("token", "login")]
    return [{}, *either] if right.stop else either


def _complete(schema: Described, rights: RightsTable) -> None:
    schemas = schema["components"]["schemas"]
    schemas["Problem"] = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
    for unused in ("HTTPValidationError", "ValidationError"):
        schemas.pop(unused, None)
    for path, operations in schema["paths"].items():
        for method, operation in operations.items():
            name = f"{method.upper()} {path.removeprefix(PREFIX)}"
            rule = rights.find(method.upper(), path)
            if rule and rule.right:
                operation["security"] = asked_of(rule.right)
            words = (*ANYWHERE, *_stated(operation))
            problems = {str(status): problem for status, problem in responses(*words).items()}
            operation["responses"] = {**operation["responses"], **problems}
            if method == "head":  # has no body
                for response in operation["responses"].values():
                    response.pop("content", None)
            _exemplify(operation, examples()["routes"].get(name, {}))


def _stated(operation: Described) -> Iterator[str]:
    """Status and code of each problem that the route itself tells of, or its parameters do."""
    for status, response in operation["responses"].items():
        yield from (f"{status} {code}" for code in response.get("content", {}).get(MEDIA_TYPE, {}).get("examples", ()))
    if "422" in operation["responses"]:
        yield "422 invalid-request"
    named = {one["name"] for one in operation.get("parameters", ())}
    yield from KEYED if "Idempotency-Key" in named else ()
    yield from ("423 no-lease",) if "X-Control-Lease" in named else ()
    yield from ("422 refused",) if "cursor" in named else ()


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
