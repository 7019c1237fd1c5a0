"""The object dictionary of one kind of drive as a table, read from CSV, with what no electronic data sheet says."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

from drivers.epos4.objects import HOMING_METHODS, I8, I16, I32, OBJECTS, TEXT, U8, U16, U32, Access, Entry

Key = tuple[int, int]
KINDS = {
    "bool": "?", "i8": I8, "i16": I16, "i32": I32, "u8": U8, "u16": U16, "u32": U32, "u64": "Q", "text": TEXT,
    "octets": TEXT,
}  # fmt: skip
ACCESS = {("rww", "1"): "rw+", ("ro", "1"): "ro+"}


@dataclass(frozen=True)
class ObjectTable:
    """``delivered`` are values that differ from the defaults in a drive that was set up for its motor.

    ``status_mask`` has the statusword's bits that this kind of drive uses.
    """

    objects: Mapping[Key, Entry]
    delivered: Mapping[Key, int] = field(default_factory=dict)
    texts: Mapping[Key, str] = field(default_factory=dict)
    homing_methods: tuple[int, ...] = HOMING_METHODS
    status_mask: int = 0xFFFF


def read_objects(path: Path) -> dict[Key, Entry]:
    """The objects in the file; names, and bounds that it leaves open, are those of the driver's own table."""
    with path.open(newline="") as lines:
        return {(entry.index, entry.sub): entry for entry in map(_entry, csv.DictReader(lines))}


def _entry(row: dict[str, str]) -> Entry:
    index, sub = int(row["index"], 16), int(row["sub"], 16)
    known = OBJECTS.get((index, sub))
    low, high = _number(row["low"]), _number(row["high"])
    if known and low is None and high is None:
        low, high = known.low, known.high
    return Entry(
        index,
        sub,
        known.name if known else "object",
        KINDS[row["type"]],
        cast(Access, ACCESS.get((row["access"], row["mappable"]), row["access"])),
        _number(row["default"].removeprefix("node+")) or 0,
        low,
        high,
        row["default"].startswith("node+"),
    )


def _number(text: str) -> int | None:
    return int(text, 0) if text else None
