"""Each kind of job has parameters, an example that is valid, a typed result and a place in the description."""

from typing import Any, get_args

import pytest
from fastapi.testclient import TestClient

from api.cli.app import COMMANDS
from api.http.jobs.examples import EXAMPLES
from api.http.jobs.kinds import KINDS, AnyJob, AnyResult
from api.http.jobs.worker import function_at


def described(client: TestClient) -> dict[str, Any]:
    found: dict[str, Any] = client.get("/api/v1/openapi.json").json()
    return found


def test_every_kind_can_be_asked_for_and_its_result_shown() -> None:
    union, _ = get_args(AnyJob)
    assert {kind.body for kind in KINDS.values()} == set(get_args(union))
    assert {kind.result for kind in KINDS.values()} == set(get_args(AnyResult))
    assert {kind.command.split()[0] for kind in KINDS.values()} <= set(COMMANDS)


@pytest.mark.parametrize("name", KINDS)
def test_the_example_of_a_kind_is_valid_and_what_does_it_is_there(name: str) -> None:
    kind = KINDS[name]
    asked = kind.body.model_validate(EXAMPLES[name]["value"])
    assert asked.model_dump(mode="json")["kind"] == name
    assert kind.work or kind.moves
    if kind.work:
        assert callable(function_at(kind.work))


def test_the_description_shows_each_kind_with_its_example(client: TestClient) -> None:
    schema = described(client)
    content = schema["paths"]["/api/v1/jobs"]["post"]["requestBody"]["content"]["application/json"]
    assert set(content["examples"]) == set(KINDS)
    mapping = content["schema"]["discriminator"]["mapping"]
    assert set(mapping) == set(KINDS)
    for reference in mapping.values():
        assert schema["components"]["schemas"][reference.rpartition("/")[2]]["description"]
