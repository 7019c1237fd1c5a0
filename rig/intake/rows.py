"""From columns as they stand in a file to rows of the project's streams."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.channels import AXIS, BY_NAME, MARKER, Stream
from rig.errors import DataError
from rig.intake.mapping import RESTART, FileForm, ValueColumn
from rig.intake.sheet import Batch, Column, Sheet
from rig.intake.survey import with_sign
from rig.intake.times import Times, agreed_unit, is_text, period_ns, times_ns, unwrapped
from rig.intake.units import factor_of

Numbers = NDArray[np.float64]
# Which field of which stream a quantity of the mapping fills; a stream is there where its first quantity is.
FIELDS = {
    "force": {"force": "fz_N", "temperature": "temperature_C"},
    "axis": {"position": "position_mm", "velocity": "velocity_mm_s", "current": "current_A"},
    "marker": {"x": "x_mm", "y": "y_mm", "z": "z_mm", "tool": "tool"},
}
# A number of a tool, and a signal that only tells how two clocks lie.
UNITLESS = ("tool", "sync")
EXAMPLES = {"force": "N", "velocity": "mm/s", "current": "A", "temperature": "C", "arrival": "ns"}
# A lost or swapped row is a step back; what falls back to the first tenth of the way begins anew.
ANEW_SHARE, ANEW_ROWS = 0.1, 10
# Before the name of a label, and of the quantity whose sign it is, among the columns that are read.
LABEL, SIGN = "label ", "sign of "


class Piece(NamedTuple):
    """Rows of one recording: its labels, their times, and the numbers of each quantity in the project's units."""

    labels: Mapping[str, str]
    at_ns: Times
    values: dict[str, Numbers]
    saturated: int
    dropped: int


def pieces(sheet: Sheet, form: FileForm) -> Iterator[Piece]:
    """The rows of a sheet in pieces of the same labels; raises DataError with the place of what is wrong."""
    wanted = _wanted(sheet, form)
    clocks = dict[tuple[tuple[str, ...], float], int]()
    last_ns, restart = None, 1
    for first, batch in _said(sheet.read(dict(wanted.values()))):
        count = len(batch[0])
        found = dict(zip(wanted, batch, strict=True))
        at_ns = times_ns([found.get(name) for name in ("time", "finer")], first, count, form.time, sheet)
        at_ns = unwrapped(at_ns, last_ns, period_ns(form.time, sheet))
        told = {name: found[LABEL + name] for name in form.label_columns}
        if form.disorder == RESTART:
            told[RESTART] = restart + np.cumsum(np.diff(at_ns, prepend=at_ns[0] if last_ns is None else last_ns) < 0)
            restart = int(told[RESTART][-1])
        last_ns = int(at_ns[-1])
        values, saturated = _values(found, sheet, form, first)
        for labels, rows in _runs([told[name] for name in form.row_labels], count):
            part = {name: column[rows] for name, column in values.items()}
            keep = _in_order(at_ns[rows], part.get("tool"), clocks, labels, form, sheet, first + rows.start)
            kept = {name: column[keep] for name, column in part.items()}
            named = dict(zip(form.row_labels, labels, strict=True))
            yield Piece(named, at_ns[rows][keep], kept, int(saturated[rows].sum()), int((~keep).sum()))


def _said(batches: Iterator[Batch]) -> Iterator[tuple[int, list[Column]]]:
    """Runs of rows that say anything, each with the number of its first: empty ones stand between cycles, and below."""
    first = 0
    for batch in batches:
        said = np.any([_says(column) for column in batch], axis=0)
        for start, end in np.flatnonzero(np.diff(said, prepend=False, append=False)).reshape(-1, 2).tolist():
            yield first + start, [column[start:end] for column in batch]
        first += len(batch[0])


def _says(column: Column) -> NDArray[np.bool_]:
    if isinstance(column, list):
        return np.array([bool(text) for text in column])
    return ~np.isnan(column) if column.dtype.kind == "f" else np.ones(column.size, bool)


def _wanted(sheet: Sheet, form: FileForm) -> dict[str, tuple[int, bool]]:
    """Number of each column that is read, and whether it is text."""
    wanted: dict[str, tuple[int, bool]] = {}
    if form.time.column is not None:
        wanted["time"] = (sheet.number(form.time.column), is_text(form.time))
    if form.time.finer is not None:
        wanted["finer"] = (sheet.number(form.time.finer), False)
    wanted |= {LABEL + name: (sheet.number(place), True) for name, place in form.label_columns.items()}
    taken = {number for number, _ in wanted.values()}
    places = {quantity: column.column for quantity, column in form.columns.items()}
    signs = {SIGN + quantity: column.sign for quantity, column in form.columns.items() if column.sign is not None}
    for name, place in (*places.items(), *signs.items()):
        number = sheet.number(place)
        if number in taken:
            raise DataError(f"{sheet.where}: column {place!r} is named twice in the mapping; one is wrong")
        taken.add(number)
        wanted[name] = (number, name in signs)
    return wanted


def _runs(labels: Sequence[Column], count: int) -> Iterator[tuple[tuple[str, ...], slice]]:
    """Rows that follow each other under the same labels."""
    names = [np.asarray(column) for column in labels]
    changes = np.zeros(max(count - 1, 0), bool)
    for column in names:
        changes |= column[1:] != column[:-1]
    starts = [0, *(np.flatnonzero(changes) + 1).tolist(), count] if count else []
    yield from ((tuple(str(column[start]) for column in names), slice(start, end)) for start, end in pairwise(starts))


def _in_order(
    at_ns: Times, tool: Numbers | None, clocks: dict[tuple[tuple[str, ...], float], int], labels: tuple[str, ...],
    form: FileForm, sheet: Sheet, first: int,
) -> NDArray[np.bool_]:  # fmt: skip
    """Rows whose time is after that of all before them, of one tool; ``clocks`` keeps the latest of each piece."""
    latest = np.empty_like(at_ns)
    for one in np.unique(tool) if tool is not None else [0.0]:
        rows = np.flatnonzero(tool == one) if tool is not None else np.arange(at_ns.size)
        before = [clocks.get((labels, one), at_ns[rows[0]] - 1)] if rows.size else []
        reached = np.maximum.accumulate(np.concatenate([np.array(before, np.int64), at_ns[rows]]))
        latest[rows] = reached[:-1]
        clocks.update({(labels, one): int(reached[-1])} if rows.size else {})
    late = np.flatnonzero(at_ns <= latest)
    if late.size and form.disorder == "refuse":
        _refuse_order(at_ns, latest, int(late[0]), sheet.place(first + int(late[0])))
    return at_ns > latest


def _refuse_order(at_ns: Times, latest: Times, row: int, place: str) -> None:
    said = f"{place}: time {at_ns[row] * 1e-9:.9g} s follows {latest[row] * 1e-9:.9g} s"
    if row >= ANEW_ROWS and at_ns[row] - at_ns[0] <= ANEW_SHARE * (latest[row] - at_ns[0]):
        anew = "another recording or specimen begins here under the same name: name what parts them in `label`"
        raise DataError(f"{said}; {anew}, or say disorder = 'restart'")
    raise DataError(
        f"{said}; time must increase from row to row. Mend the file, or leave such rows out: disorder = 'drop'"
    )


def _values(
    found: Mapping[str, Column], sheet: Sheet, form: FileForm, first: int
) -> tuple[dict[str, Numbers], NDArray[np.bool_]]:
    """Every quantity in the project's unit; a number at the end of its range is NaN, and counted."""
    values, saturated = dict[str, Numbers](), np.zeros(len(next(iter(found.values()))), bool)
    for quantity, column in form.columns.items():
        raw = np.asarray(found[quantity], np.float64)
        raw = np.where(np.isin(raw, form.missing_numbers), math.nan, raw) if form.missing_numbers else raw
        low, high = column.saturates or (math.nan, math.nan)
        full = (raw <= low) | (raw >= high)
        if column.sign is not None:
            raw = raw * _signs(found[SIGN + quantity], np.isfinite(raw), column.signs, sheet, first)
        values[quantity] = np.where(full, math.nan, _converted(raw, quantity, column, sheet, form.lever_mm))
        saturated |= full
    return values, saturated


def _signs(texts: Column, known: NDArray[np.bool_], signs: Mapping[str, int], sheet: Sheet, first: int) -> Numbers:
    found = np.array([signs.get(str(text), math.nan) for text in texts])
    unknown = np.flatnonzero(known & np.isnan(found))
    if unknown.size:
        said = f"{sheet.place(first + int(unknown[0]))}: {str(texts[unknown[0]])!r} is none of the signs"
        raise DataError(f"{said} {', '.join(map(repr, signs))}; add it to `signs`, as 1 or -1")
    return found


def _converted(raw: Numbers, quantity: str, column: ValueColumn, sheet: Sheet, lever_mm: float | None) -> Numbers:
    raw = with_sign(raw, column.sign_bit, column.bits)
    if quantity in UNITLESS:
        return raw
    scale = _scale(quantity, column, sheet, lever_mm) if column.scale is None else column.scale
    if scale == 1.0 and column.offset == 0.0:
        return raw * column.positive
    return column.positive * (scale * raw + column.offset)


def _scale(quantity: str, column: ValueColumn, sheet: Sheet, lever_mm: float | None) -> float:
    number = sheet.number(column.column)
    unit = agreed_unit(column.unit, sheet, number, quantity, EXAMPLES.get(quantity, "mm"))
    try:
        return factor_of(quantity, unit, lever_mm)
    except DataError as error:
        raise DataError(f"{sheet.where}: column {sheet.header[number]!r}: {error}; or state a scale") from error


def stream_rows(piece: Piece, before: Mapping[str, NDArray[np.void]]) -> dict[str, NDArray[np.void]]:
    """Rows of every stream the piece holds, their numbers going on from the last rows ``before``.

    What was not measured is NaN, or 0 where the field is an integer; velocity is the slope of the position where no
    column has it, and position the integral of the velocity.
    """
    values, at_s = dict(piece.values), piece.at_ns.astype(np.float64) * 1e-9
    if "position" not in values and "velocity" in values:
        values["position"] = _integral(at_s, values["velocity"], before.get(AXIS.name))
    if "position" in values and "velocity" not in values:
        values["velocity"] = np.gradient(values["position"], at_s) if at_s.size > 1 else np.full(at_s.shape, math.nan)
    return {
        stream: _filled(BY_NAME[stream], piece.at_ns, values, fields, before.get(stream))
        for stream, fields in FIELDS.items()
        if next(iter(fields)) in values
    }


def _integral(at_s: Numbers, velocity: Numbers, before: NDArray[np.void] | None) -> Numbers:
    """The way gone at the ``velocity`` from where the axis was ``before``, 0 at the first row."""
    start = before[-1] if before is not None else None
    at_s = np.concatenate([[at_s[0] if start is None else start["capture_ns"] * 1e-9], at_s])
    velocity = np.concatenate([[velocity[0] if start is None else start["velocity_mm_s"]], velocity])
    return way_of(at_s, velocity)[1:] + (0.0 if start is None else start["position_mm"])


def way_of(at_s: Numbers, velocity: Numbers) -> Numbers:
    """What a speed adds up to from the first of its times on, by trapezia."""
    return np.concatenate([[0.0], np.cumsum(np.diff(at_s) * (velocity[1:] + velocity[:-1]) / 2)])


def _filled(
    stream: Stream, at_ns: Times, values: Mapping[str, Numbers], fields: Mapping[str, str],
    before: NDArray[np.void] | None,
) -> NDArray[np.void]:  # fmt: skip
    unmeasured = np.zeros((), stream.dtype)
    for name, kind in stream.kinds.items():
        if kind is float:
            unmeasured[name] = math.nan
    # Record by record: `np.full` goes field by field, which takes six times as long.
    rows = np.repeat(unmeasured, at_ns.size)
    rows["seq"] = np.arange(at_ns.size) + (0 if before is None else before[-1]["seq"] + 1)
    rows["capture_ns"] = rows["arrival_ns"] = at_ns
    if "arrival" in values:
        rows["arrival_ns"] = np.round(values["arrival"]).astype(np.int64)
    for quantity in fields.keys() & values.keys():
        rows[fields[quantity]] = values[quantity]
    if stream is MARKER:
        rows["frame"] = rows["seq"]
    needed = ("x", "y", "z") if stream is MARKER else (next(iter(fields)),)
    rows["valid"] = np.all([np.isfinite(values[quantity]) for quantity in needed], axis=0)
    return rows
