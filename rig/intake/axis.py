"""A drive axis as its makers recorded it: motion, set-point and effort, in the units that the mapping names."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from fnmatch import fnmatchcase
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.intake.clocks import on_one_clock
from rig.intake.folder import FoundTable, labels_of, natural
from rig.intake.mapping import AxisFacts, DataMapping, Quantity
from rig.intake.rows import Piece, way_of
from rig.intake.session import grouped
from rig.intake.stating import StatedFacts, stated_of
from rig.intake.times import agreed_unit
from rig.intake.units import factor_of

Array = NDArray[np.float64]
# What a column is in whose scale is stated, without a lever and with one.
SCALED = {"position": ("mm", "rad"), "force": ("N", "N m"), "current": ("A", "A")}


class AxisUnits(NamedTuple):
    """What positions and efforts are counted in."""

    position: str
    effort: str


@dataclass(frozen=True)
class AxisRecording:
    """One recording at the times of its motion; arrays of shape (n,), NaN where nothing was measured.

    Positions are in one unit, ``effort`` in that of the drive, ``excitation`` in that of the control signal it is added
    to. ``one_clock`` is False where the effort has time stamps of another device; ``remarks`` say how they were found.
    ``stated`` is in mm, of which one of position is ``one_mm``.
    """

    name: str
    time_s: Array
    position: Array
    effort: Array
    setpoint: Array | None = None
    excitation: Array | None = None
    load_position: Array | None = None
    one_clock: bool = True
    remarks: tuple[str, ...] = ()
    stated: StatedFacts | None = None
    one_mm: float = 1.0


class AxisData(NamedTuple):
    """The recordings of a folder in the order of their names, and their units."""

    recordings: tuple[AxisRecording, ...]
    units: AxisUnits


class _Table(NamedTuple):
    """Rows of one recording in one table, in the project's units."""

    source: FoundTable
    time_s: Array
    values: Mapping[str, Array]
    remarks: tuple[str, ...]
    stated: StatedFacts


def read_axis(folder: Path, mapping: DataMapping, only: str = "") -> AxisData:
    """Every recording that matches ``only`` but copies; raises DataError where one lacks motion, effort or units."""
    facts = mapping.axis or AxisFacts()
    found = {name: tables for name, tables in _collected(folder, mapping).items() if fnmatchcase(name, only or "*")}
    if not found:
        raise DataError(f"{folder}: no recording's name is of the pattern {only!r}")
    read = [_recording(folder, name, found[name], facts) for name in sorted(found, key=natural)]
    units = {unit for _, unit in read}
    if len(units) > 1:
        said = "; ".join(f"{unit.position} and {unit.effort}" for unit in sorted(units))
        raise DataError(f"{folder}: recordings of one axis are in different units ({said}); state one `unit` for all")
    return AxisData(tuple(_distinct([recording for recording, _ in read])), units.pop())


def _distinct(recordings: Sequence[AxisRecording]) -> Iterator[AxisRecording]:
    seen = set[bytes]()
    for recording in recordings:
        digest = b"".join(getattr(recording, name).tobytes() for name in ("time_s", "position", "effort"))
        if digest not in seen:
            yield recording
        seen.add(digest)


def _collected(folder: Path, mapping: DataMapping) -> dict[str, list[_Table]]:
    found: dict[str, list[_Table]] = {}
    for part in (part for tables in grouped(folder, mapping) for part in on_one_clock(tables)):
        rows: dict[tuple[str, str], list[tuple[FoundTable, Piece]]] = {}
        for table, piece in part.pieces():
            name = labels_of(table, piece.labels, mapping)["recording"] + part.suffix
            rows.setdefault((name, table.sheet.where), []).append((table, piece))
        for (name, _), read in rows.items():
            (table, piece), facts = read[0], mapping.facts_of(name)
            stated = stated_of(facts, labels_of(table, piece.labels, mapping), table.sheet.where)
            found.setdefault(name, []).append(_joined(read, part.remarks(name), stated))
    return found


def _joined(read: Sequence[tuple[FoundTable, Piece]], remarks: Sequence[str], stated: StatedFacts) -> _Table:
    batches = [piece for _, piece in read]
    values = {key: np.concatenate([piece.values[key] for piece in batches]) for key in batches[0].values}
    time_s = np.concatenate([piece.at_ns for piece in batches]) * 1e-9
    return _Table(read[0][0], time_s, values, tuple(remarks), stated)


def _recording(folder: Path, name: str, tables: Sequence[_Table], facts: AxisFacts) -> tuple[AxisRecording, AxisUnits]:
    motion = _holding(folder, name, tables, ("position", "velocity"))
    drive = _holding(folder, name, tables, (facts.effort,))
    (position_unit, way), (effort_unit, effort) = _own("position", motion.source), _own(facts.effort, drive.source)
    gone = motion.values.get("position")
    if gone is None:
        gone = way_of(motion.time_s, motion.values["velocity"])
    further = {
        key: _at(motion.time_s, table, key) / (1.0 if key == "excitation" else way)
        for key in (field.name for field in fields(AxisRecording))
        for table in tables
        if key in ("setpoint", "excitation", "load_position") and key in table.values
    }
    values = _at(motion.time_s, drive, facts.effort) / effort
    recording = AxisRecording(
        name, motion.time_s, gone / way, values, **further, one_clock=motion is drive, remarks=motion.remarks,
        stated=motion.stated, one_mm=way,
    )  # fmt: skip
    return recording, AxisUnits(position_unit, facts.effort_unit or effort_unit)


def _holding(folder: Path, name: str, tables: Sequence[_Table], names: Sequence[str]) -> _Table:
    for table in tables:
        if any(key in table.values for key in names):
            return table
    raise DataError(f"{folder}: recording {name} holds no {names[0]}; name its column in the mapping")


def _own(quantity: Quantity, table: FoundTable) -> tuple[str, float]:
    """The unit its makers count the quantity in, and how many of the project's unit it is."""
    form, sheet = table.form, table.sheet
    column = form.columns.get(quantity)
    if column is None or column.scale is not None:
        unit = SCALED[quantity][form.lever_mm is not None]
    else:
        unit = agreed_unit(column.unit, sheet, sheet.number(column.column), quantity, SCALED[quantity][0])
    return unit, factor_of(quantity, unit, form.lever_mm)


def _at(time_s: Array, table: _Table, key: str) -> Array:
    """The quantity at other times, NaN before its first and after its last sample."""
    if table.time_s is time_s:
        return table.values[key]
    return np.interp(time_s, table.time_s, table.values[key], left=np.nan, right=np.nan)
