"""Time as files have it, in nanoseconds: numbers with a unit, ISO texts, spreadsheet days, counters."""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rig.errors import DataError, UsageError
from rig.intake.mapping import TimeColumn
from rig.intake.sheet import Column, Sheet
from rig.intake.units import TIME_NS
from rig.intake.workbook import DAY_S, EPOCH

Times = NDArray[np.int64]
NS = 1_000_000_000
EPOCH_NS = int((EPOCH - EPOCH.replace(year=1970, month=1, day=1)).total_seconds()) * NS
# Beyond this, nanoseconds do not fit 64 bits: the column is not in the unit that was said.
LIMIT_NS = 9e18


def is_text(form: TimeColumn) -> bool:
    """Whether the column of times is read as text."""
    return form.form == "iso"


def times_ns(found: Column | None, first: int, count: int, form: TimeColumn, sheet: Sheet) -> Times:
    """Times of ``count`` rows from row ``first`` on, in the column ``found``; raises DataError with the place."""
    if found is None:
        return _rounded(np.arange(first, first + count, dtype=np.float64) * (NS / (form.rate_Hz or 1.0)))
    if isinstance(found, list):
        return _iso_ns(found, first, sheet)
    number = sheet.number(form.column or 1)
    bad = np.flatnonzero(~np.isfinite(found))
    if bad.size:
        raise DataError(
            f"{sheet.place(first + int(bad[0]))}, column {sheet.header[number]}: no time where one is needed"
        )
    factor = _factor(form, sheet, number)
    if found.dtype.kind in "iu" and factor == int(factor):
        return found.astype(np.int64) * int(factor)
    scaled = found.astype(np.float64) * factor + (EPOCH_NS if form.form == "spreadsheet" else 0)
    far = np.flatnonzero(np.abs(scaled) >= LIMIT_NS)
    if far.size:
        said = f"{found[far[0]]:g} is beyond {LIMIT_NS / NS:g} s; correct the unit of time"
        raise DataError(f"{sheet.place(first + int(far[0]))}, column {sheet.header[number]}: {said}")
    return _rounded(scaled)


def _rounded(at_ns: NDArray[np.float64]) -> Times:
    return np.round(at_ns).astype(np.int64)


def _factor(form: TimeColumn, sheet: Sheet, number: int) -> float:
    if form.form == "counter":
        return NS / (form.rate_Hz or 1.0)
    if form.form == "spreadsheet":
        return DAY_S * NS
    unit = agreed_unit(form.unit, sheet, number, "time", "s")
    if unit not in TIME_NS:
        raise UsageError(f"{sheet.where}: {unit!r} is no unit of time; known are {', '.join(TIME_NS)}")
    return TIME_NS[unit]


def agreed_unit(stated: str, sheet: Sheet, number: int, quantity: str, example: str) -> str:
    """The unit the mapping states, or else the file; raises where they differ, or neither says one."""
    there, name = sheet.units[number], sheet.header[number]
    if stated and there and stated != there:
        raise DataError(
            f"{sheet.where}: column {name!r} is in {there} by its header, the mapping says {stated}; correct it"
        )
    if not (stated or there):
        raise UsageError(f"{sheet.where}: nothing says the unit of {name!r}; add to its {quantity}: unit = '{example}'")
    return stated or there


def _iso_ns(texts: Sequence[str], first: int, sheet: Sheet) -> Times:
    try:
        return _parsed_ns(texts)
    except pa.ArrowInvalid:
        bad = next((row for row, text in enumerate(texts) if not _is_iso(text)), 0)
        raise DataError(
            f"{sheet.place(first + bad)}: {texts[bad]!r} is no ISO time such as 2025-11-12T10:03:29.555Z"
        ) from None


def _is_iso(text: str) -> bool:
    try:
        _parsed_ns([text])
    except pa.ArrowInvalid:
        return False
    return True


def _parsed_ns(texts: Sequence[str]) -> Times:
    zoned = texts[0].endswith("Z") or "+" in texts[0][10:] or "-" in texts[0][10:] if texts else False
    kind = pa.timestamp("ns", tz="UTC" if zoned else None)
    return np.asarray(pa.array(texts, pa.string()).cast(kind).cast(pa.int64()).to_numpy())
