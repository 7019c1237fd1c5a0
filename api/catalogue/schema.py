"""The tables. All but ``rig_person`` and ``rig_catalogue`` are read from the folders and can be dropped at any time.

A column is a field of the entry it holds: text, numbers, and JSON for the rest. Text sorts by code point in every
database, so that the same question has the same answer.
"""

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from pydantic.fields import FieldInfo
from sqlalchemy import JSON, BigInteger, Column, Double, MetaData, RowMapping, String, Table
from sqlalchemy.types import TypeEngine

from rig.results.catalogue import (
    CatalogueEntry,
    CauseEntry,
    DiagnosisEntry,
    ModelEntry,
    SessionEntry,
    ThresholdEntry,
    TrialEntry,
    WorkEntry,
)

# Grows with every change of these tables, and of what is read into them: then they are read anew.
VERSION = 1
Kind = TypeVar("Kind", bound=CatalogueEntry)
BY_CODE_POINT = (
    String().with_variant(String(collation="C"), "postgresql").with_variant(String(collation="BINARY"), "sqlite")
)
KEPT: Mapping[object, TypeEngine[Any]] = {str: BY_CODE_POINT, int: BigInteger(), float: Double()}
KINDS: Mapping[str, type[CatalogueEntry]] = {
    "rig_session": SessionEntry,
    "rig_trial": TrialEntry,
    "rig_model": ModelEntry,
    "rig_diagnosis": DiagnosisEntry,
    "rig_cause": CauseEntry,
    "rig_threshold": ThresholdEntry,
    "rig_work": WorkEntry,
}

# Known of the database itself: which version of these tables, and which folder they tell of.
OWN = MetaData()
CATALOGUE = Table(
    "rig_catalogue",
    OWN,
    Column("version", BigInteger, primary_key=True, autoincrement=False),
    Column("root", BY_CODE_POINT, nullable=False),
)
# Only here, and in nobody's recording.
PERSON = Table(
    "rig_person",
    OWN,
    Column("subject", BY_CODE_POINT, primary_key=True),
    Column("name", BY_CODE_POINT, nullable=False),
    Column("entered", BY_CODE_POINT, nullable=False),
)
DERIVED = MetaData()
INDEXED = ("session", "at", "subject")


def _column(name: str, field: FieldInfo) -> Column[object]:
    of_number = field.annotation == float | None
    kept = KEPT.get(float if of_number else field.annotation, JSON())
    return Column(name, kept, primary_key=name == "key", nullable=of_number, index=name in INDEXED)


def _table(name: str, kind: type[CatalogueEntry]) -> Table:
    return Table(name, DERIVED, *(_column(*item) for item in kind.model_fields.items()))


TABLES: Mapping[type[CatalogueEntry], Table] = {kind: _table(name, kind) for name, kind in KINDS.items()}
# What a session's folder looked like when it was read.
STAMP = Table("rig_stamp", DERIVED, Column("session", BY_CODE_POINT, primary_key=True), Column("stamp", BY_CODE_POINT))


def rows(entries: Sequence[CatalogueEntry]) -> list[dict[str, object]]:
    """Entries of one kind as rows of its table."""
    return [entry.model_dump(mode="json") for entry in entries]


def entry(kind: type[Kind], row: RowMapping) -> Kind:
    """The entry in a row."""
    return kind.model_validate(dict(row))
