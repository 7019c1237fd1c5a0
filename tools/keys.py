"""The reference of keys: every table of a configuration file with its keys, written from the models that read it."""

import inspect
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from rig.config.words import Schema, toml, value_words

HEADER = "| key | value | default | meaning |\n|---|---|---|---|"


def tables(root: type[BaseModel], largest: Mapping[str, str]) -> str:
    """Markdown of ``root`` and all tables in it; ``largest`` says of a dotted key what it may never exceed, and why."""
    places = _places(root)
    shared = Counter(places.values())
    return "\n".join(
        _table(model, place, _variant(model) if shared[place] > 1 else "", largest) for model, place in places.items()
    )


def _places(root: type[BaseModel]) -> dict[type[BaseModel], str]:
    """Each table once: under its path in the file, or under its own name where several paths lead to it."""
    nested = list(_nested(root, ""))
    counted = Counter(model for _, model in nested)
    return {root: ""} | {model: path if counted[model] == 1 else model.__name__ for path, model in nested}


def _variant(model: type[BaseModel]) -> str:
    """What tells this table from others in the same place: its one key that has one value only."""
    said = model.model_json_schema()["properties"]
    return next(f": {name} = `{toml(one['const'])}`" for name, one in said.items() if "const" in one)


def _nested(model: type[BaseModel], path: str) -> Iterator[tuple[str, type[BaseModel]]]:
    for name, field in model.model_fields.items():
        for inner in _models(field.annotation):
            here = f"{path}.{name}" if path else name
            yield here, inner
            yield from _nested(inner, here)


def _models(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for argument in get_args(annotation) for model in _models(argument)]


def _table(model: type[BaseModel], place: str, variant: str, largest: Mapping[str, str]) -> str:
    schema = model.model_json_schema()
    rows = [
        _row(name, field, schema, largest.get(f"{place}.{name}", ""))
        for name, field in model.model_fields.items()
        if place or not _is_section(field)
    ]
    head = [f"## `{place}`{variant}", ""] if place else []
    return "\n".join([*head, inspect.getdoc(model) or "", "", *([HEADER, *rows, ""] if rows else [])]).replace(
        "``", "`"
    )


def _is_section(field: FieldInfo) -> bool:
    return bool(_models(field.annotation))


def _row(name: str, field: FieldInfo, schema: Schema, largest: str) -> str:
    value = value_words(schema["properties"][name], schema.get("$defs", {}))
    meaning = "; ".join(part for part in (field.description or "", largest) if part)
    return f"| `{name}` | {value} | {_default(field)} | {meaning} |".replace("  ", " ")


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    default = field.get_default(call_default_factory=True)
    if default is None:
        return "absent"
    return f"`{toml(default)}`"
