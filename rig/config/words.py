"""A JSON schema in words: what a value may be."""

import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

Schema = Mapping[str, Any]

WORDS = {"string": "text", "integer": "whole number", "number": "number", "boolean": "true or false", "null": "absent"}
FORMATS = {"path": "path", "date-time": "date and time"}
BOUNDS = {
    "minimum": "≥ {}",
    "exclusiveMinimum": "> {}",
    "maximum": "≤ {}",
    "exclusiveMaximum": "< {}",
    "minItems": "at least {}",
    "maxItems": "at most {}",
    "minLength": "not shorter than {}",
}


def value_words(said: Schema, definitions: Schema) -> str:
    """What ``said`` allows, with ``definitions`` for what it refers to."""
    if "$ref" in said:
        return value_words(definitions[said["$ref"].rpartition("/")[2]], definitions)
    for choice in ("anyOf", "oneOf"):
        if choice in said:
            return " or ".join(dict.fromkeys(value_words(one, definitions) for one in said[choice]))
    if "enum" in said or "const" in said:
        return ", ".join(f"`{toml(one)}`" for one in said.get("enum", [said.get("const")]))
    return _kind(said, definitions)


def _kind(said: Schema, definitions: Schema) -> str:
    match said:
        case {"type": "array", "prefixItems": [first, *rest]}:
            return f"{1 + len(rest)} of: {value_words(first, definitions)}"
        case {"type": "array", "items": items}:
            return f"list of: {value_words(items, definitions)}{_bounds(said)}"
        case {"type": "object", "additionalProperties": dict(value)}:
            return f"table of: {value_words(value, definitions)}"
        case {"type": "object", "title": title}:
            return f"table `{title}`"
        case {"format": form}:
            return FORMATS.get(form, str(form))
        case _:
            kind = said.get("type", "anything")
            return f"{WORDS.get(kind, kind)}{_bounds(said)}"


def _bounds(said: Schema) -> str:
    found = [words.format(said[name]) for name, words in BOUNDS.items() if name in said]
    return f", {', '.join(found)}" if found else ""


def toml(value: object) -> str:
    """``value`` as a TOML file writes it."""
    if isinstance(value, BaseModel):
        keys = value.model_dump(mode="json", exclude_none=True).items()
        return f"{{{', '.join(f'{name} = {toml(one)}' for name, one in keys)}}}"
    return json.dumps(value, default=str, ensure_ascii=False)
