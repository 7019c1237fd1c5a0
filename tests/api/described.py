"""The service's description of itself, as tests hold answers against it."""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jsonschema_rs

from api.http.access.rights import RightsTable, Rule
from api.http.app import build
from api.http.service import Service
from rig.config.wiring import Wiring

PROBLEM = "application/problem+json"
# Its bytes are no text, and an example of them would tell nobody anything.
BINARY = {"type": "string", "format": "binary"}


class Shown(NamedTuple):
    """A body of one operation: of its request, or of an answer by status."""

    where: str
    content: dict[str, Any]

    @property
    def examples(self) -> list[Any]:
        """All that are given."""
        several = [one["value"] for one in self.content.get("examples", {}).values()]
        return [*several, self.content["example"]] if "example" in self.content else several


def description() -> dict[str, Any]:
    """Of the routes as they are."""
    return build(Service(Wiring(), Path("sessions"), Path("protocols"), "http://127.0.0.1:8123")).openapi()


def rules() -> Sequence[Rule]:
    """Of all routes as they are, described or not."""
    return RightsTable(build(Service(Wiring(), Path("sessions"), Path("protocols")))).rules


def operations(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each with its method and path."""
    for path, methods in schema["paths"].items():
        yield from ((f"{method.upper()} {path}", operation) for method, operation in methods.items())


def bodies(schema: dict[str, Any]) -> Iterator[Shown]:
    """All that is sent or answered and is not the bytes of a file."""
    for name, operation in operations(schema):
        for part, body in {"request": operation.get("requestBody", {}), **operation["responses"]}.items():
            for kind, content in body.get("content", {}).items():
                if content.get("schema") != BINARY:
                    yield Shown(f"{name} {part} {kind}", content)


def without_example(schema: dict[str, Any]) -> list[str]:
    """Bodies and parameters of addresses that nothing shows."""
    parameters = [
        f"{name} {one['name']}"
        for name, operation in operations(schema)
        for one in operation.get("parameters", ())
        if one["in"] == "path" and "example" not in one
    ]
    return [shown.where for shown in bodies(schema) if not shown.examples] + parameters


def wrong_examples(schema: dict[str, Any]) -> list[str]:
    """Examples that their own schema refuses, and why."""
    found = []
    for shown in bodies(schema):
        judge = jsonschema_rs.validator_for({**shown.content["schema"], "components": schema["components"]})
        found += [f"{shown.where}: {error.message}" for one in shown.examples for error in judge.iter_errors(one)]
    return found


def problems(operation: dict[str, Any]) -> set[str]:
    """Status and code of each problem that an operation is said to answer with."""
    return {
        f"{status} {code}"
        for status, response in operation["responses"].items()
        for code in response.get("content", {}).get(PROBLEM, {}).get("examples", ())
    }


def undescribed(schema: dict[str, Any], method: str, path: str, problem: str) -> bool:
    """Whether a route of the description answered with a problem that it does not tell of."""
    for name, operation in operations(schema):
        stated, _, pattern = name.partition(" ")
        steps = re.sub(r"{(path|file|subject)}", ".*", pattern)
        if stated == method and re.fullmatch(re.sub(r"{[^}]*}", "[^/]*", steps), path):
            return problem not in problems(operation)
    return False
