"""The reference of the HTTP interface, from the description that the service itself gives (`/api/v1/openapi.json`)."""

from typing import Any

from rig.config.words import Schema, value_words

HEADER = "| key | value | |\n|---|---|---|"
SUCCESS = "Successful Response"


def routes(described: Schema) -> str:
    """Markdown of every route of the OpenAPI document ``described``, then of every table they name."""
    parts = [
        _route(f"{method.upper()} {path}", operation, described)
        for path, operations in described["paths"].items()
        for method, operation in operations.items()
    ]
    schemas = described["components"]["schemas"]
    return "\n".join([*parts, *(_table(name, schemas[name], schemas) for name in sorted(schemas))])


def _route(name: str, operation: Schema, described: Schema) -> str:
    schemas = described["components"]["schemas"]
    lines = [f"## {name}", "", f"{operation['summary']}.", "", f"- asks for: {_right(operation['security'])}"]
    lines += [f"- `{one['name']}` ({one['in']}): {value_words(one['schema'], schemas)}" for one in _given(operation)]
    lines += [f"- body: {_content(operation['requestBody'], schemas)}"] if "requestBody" in operation else []
    lines += [f"- {code}: {_answer(answer, schemas)}" for code, answer in sorted(operation["responses"].items())]
    return "\n".join([*lines, ""])


def _right(security: list[dict[str, list[str]]]) -> str:
    """In words, where every scheme takes the same scope."""
    scopes = {scope for either in security for each in either.values() for scope in each}
    words = "".join(f"the scope `{scope}`" for scope in scopes) or "nothing"
    return f"{words}; on the bench's own computer nothing" if {} in security else words


def _given(operation: Schema) -> list[dict[str, Any]]:
    given: list[dict[str, Any]] = operation.get("parameters", [])
    return given


def _answer(answer: Schema, schemas: Schema) -> str:
    said = answer["description"]
    return _content(answer, schemas) if said == SUCCESS else said


def _content(body: Schema, schemas: Schema) -> str:
    kinds = [
        value_words(content["schema"], schemas) if content.get("schema") else f"`{kind}`"
        for kind, content in body.get("content", {}).items()
    ]
    return " or ".join(kinds) or "empty"


def _table(name: str, schema: Schema, schemas: Schema) -> str:
    rows = [
        f"| `{key}` | {value_words(said, schemas)} | {said.get('description', '')} |".replace("  ", " ")
        for key, said in schema.get("properties", {}).items()
    ]
    said = " ".join(schema.get("description", "").replace("``", "`").split())
    return "\n".join([f"## `{name}`", "", said, "", HEADER, *rows, ""])
