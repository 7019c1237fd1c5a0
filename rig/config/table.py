"""Strict TOML tables: an unknown key is an error that names the nearest valid one, a bad value says where and why."""

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails, to_json

from rig.errors import UsageError
from rig.plugins import hint
from rig.registry import nearest

TomlTable = dict[str, Any]
"""A file as it was read, before a model says what its keys mean."""


class Table(BaseModel):
    """A TOML table: frozen, no unknown keys, no NaN or infinity; what is read is never turned from text into number."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True)


AnyTable = TypeVar("AnyTable", bound=Table)


def read_toml(path: Path) -> TomlTable:
    """The file's table; a missing or malformed file is one sentence."""
    try:
        return tomllib.loads(path.read_text())
    except FileNotFoundError as error:
        raise UsageError(f"{path}: no such file; give the path of a TOML file") from error
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise UsageError(f"{path}: cannot be read as TOML: {error}") from error
    except RecursionError as error:
        raise UsageError(f"{path}: nests its values too deeply for a TOML file of this program; flatten it") from error


def parse(kind: type[AnyTable], values: Mapping[str, Any], where: str) -> AnyTable:
    """``values`` as a ``kind``; raises UsageError naming ``where``, the key, the bound and the nearest valid key.

    A whole number serves as a number and a list as a tuple, as in JSON; "5" is no number and 5 no text.
    """
    try:
        return kind.model_validate_json(to_json(values), strict=True)
    except ValidationError as error:
        raise UsageError(f"{where}: " + "; ".join(_sentence(kind, detail) for detail in error.errors())) from error


def refuse_newer(values: object, known: int, where: str) -> None:
    """Raises UsageError where ``values``, read from a file, state a version of its format above the one ``known``."""
    version = values.get("version") if isinstance(values, dict) else None
    if isinstance(version, int) and version > known:
        raise UsageError(
            f"{where}: format version {version} is newer than {known}, which this program reads; update tissue-rig"
        )


def load(kind: type[AnyTable], path: Path, overrides: Iterable[str] = ()) -> AnyTable:
    """The table in ``path`` with ``section.key=value`` overrides on top."""
    return parse(kind, merged(read_toml(path), overrides), str(path))


def merged(values: TomlTable, overrides: Iterable[str]) -> TomlTable:
    """``values`` with each ``section.key=value`` set; the value is TOML, or text where it is not."""
    for override in overrides:
        name, separator, text = override.partition("=")
        if not separator or not name:
            raise UsageError(f"--set {override}: write section.key=value, for example --set force.port=/dev/ttyUSB0")
        *sections, key = name.strip().split(".")
        table = values
        for section in sections:
            table = table.setdefault(section, {})
            if not isinstance(table, dict):
                raise UsageError(f"--set {override}: {section} is a value, not a section; write its own name = value")
        table[key] = _value(text.strip())
    return values


def _value(text: str) -> object:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _sentence(kind: type[BaseModel], detail: ErrorDetails) -> str:
    location, table = _located(kind, [str(part) for part in detail["loc"]])
    place = ".".join(location)
    if detail["type"] == "extra_forbidden":
        return f"unknown key {place}; nearest valid key: {nearest(location[-1], sorted(table.model_fields))}"
    if detail["type"] == "union_tag_invalid":
        tag, known = str(detail["ctx"]["tag"]), re.findall("'(.*?)'", detail["ctx"]["expected_tags"])
        return (
            f"{place}.product: unknown product {tag!r}; nearest: {nearest(tag, known)}; all: {', '.join(known)}{hint()}"
        )
    got = "" if isinstance(detail["input"], dict | BaseModel) else f" (got {detail['input']!r})"
    return f"{place and f'{place}: '}{detail['msg'].removeprefix('Value error, ')}{got}"


def _located(kind: type[BaseModel], location: list[str]) -> tuple[list[str], type[BaseModel]]:
    """The way to a key as it stands in the file, which says nothing of products, and the table that has the key."""
    place, choices = list[str](), [kind]
    for part in location:
        chosen = [table for table in choices if part == _product(table)]
        if not chosen:
            place.append(part)
            field = choices[0].model_fields.get(part)
            chosen = list(_tables(field.annotation)) if field else []
        choices = chosen or choices
    return place, choices[0]


def _product(table: type[BaseModel]) -> object:
    return table.model_fields["product"].default if "product" in table.model_fields else None


def _tables(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _tables(inner)
