"""Time as files have it, in nanoseconds: numbers with a unit, ISO texts, spreadsheet days, counters."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from rig.errors import DataError, UsageError
from rig.intake.mapping import TimeColumn
from rig.intake.sheet import Column, Sheet
from rig.intake.units import TIME_NS, unit_in
from rig.intake.workbook import EPOCH

Times = NDArray[np.int64]
Numbers = NDArray[np.generic]
NS = 1_000_000_000
DAY_NS = 86_400 * NS
UNIX = datetime(1970, 1, 1)
DATENUM = 719_529  # what MATLAB calls the first day of 1970, in days of which the first of year 0 is the first
NO_DATE = datetime(1900, 1, 1)  # the day `strptime` takes where a pattern names none
# Beyond this, nanoseconds do not fit 64 bits: the column is not in the unit that was said.
LIMIT_NS = 9e18


def is_text(form: TimeColumn) -> bool:
    """Whether the column of times is read as text."""
    return form.form in ("iso", "spreadsheet") or "%" in form.form


def times_ns(columns: Sequence[Column | None], first: int, count: int, form: TimeColumn, sheet: Sheet) -> Times:
    """Times of ``count`` rows from row ``first`` on, in a column and a finer one; raises DataError with the place."""
    found, finer = columns
    at_ns = _column_ns(found, first, count, form, sheet)
    if finer is None or isinstance(finer, list):
        return at_ns
    return at_ns + _numbers_ns(finer, first, TIME_NS[form.finer_unit], sheet, sheet.number(form.finer or 1))


def _column_ns(found: Column | None, first: int, count: int, form: TimeColumn, sheet: Sheet) -> Times:
    if found is None:
        return _rounded(np.arange(first, first + count, dtype=np.float64) * (NS / (form.rate_Hz or 1.0)))
    if isinstance(found, list):
        return _iso_ns(found, first, sheet) if form.form == "iso" else _written_ns(found, first, form.form, sheet)
    number = sheet.number(form.column or 1)
    if form.form == "datenum":
        return _numbers_ns(found.astype(np.float64) - DATENUM, first, DAY_NS, sheet, number)
    return _numbers_ns(found, first, _factor(form, sheet, number), sheet, number)


def _numbers_ns(found: Numbers, first: int, factor: float, sheet: Sheet, number: int) -> Times:
    bad = np.flatnonzero(~np.isfinite(found))
    if bad.size:
        place = f"{sheet.place(first + int(bad[0]))}, column {sheet.header[number]}"
        raise DataError(f"{place}: no time where one is needed; write it, or take the row out")
    if found.dtype.kind in "iu" and factor == int(factor):
        return found.astype(np.int64) * int(factor)
    scaled = found.astype(np.float64) * factor
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
    unit = agreed_unit(form.unit, sheet, number, "time", "s")
    if unit not in TIME_NS:
        raise UsageError(f"{sheet.where}: {unit!r} is no unit of time; known are {', '.join(TIME_NS)}")
    return TIME_NS[unit]


def agreed_unit(stated: str, sheet: Sheet, number: int, quantity: str, example: str) -> str:
    """The unit the mapping states, or else the file; raises where they differ, or neither says one."""
    there, name, stated = sheet.units[number], sheet.header[number], unit_in(stated) or stated
    if stated and there and stated.lower() != there.lower():
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
        bad = next((row for row, text in enumerate(texts) if not is_iso(text)), 0)
        said = f"{sheet.place(first + bad)}: {texts[bad]!r}"
        raise DataError(f"{said} is no ISO time such as 2025-11-12T10:03:29.555Z") from None


def _written_ns(texts: Sequence[str], first: int, form: str, sheet: Sheet) -> Times:
    """Times as ``form`` has them, since 1970; by a pattern without a date since midnight."""
    at_ns = np.empty(len(texts), np.int64)
    for row, text in enumerate(texts):
        try:
            since = _since_day_0(text) if form == "spreadsheet" else datetime.strptime(text, form)
            since = since.astimezone(UTC).replace(tzinfo=None) if since.tzinfo else since
            gone = since - (NO_DATE if "%" in form and "%d" not in form else UNIX)
            at_ns[row] = gone.days * DAY_NS + gone.seconds * NS + gone.microseconds * 1000
        except OverflowError as error:
            said = f"{text!r} as {form} is beyond {LIMIT_NS / NS:g} s; correct the form of time"
            raise DataError(f"{sheet.place(first + row)}: {said}") from error
        except ValueError as error:
            raise DataError(f"{sheet.place(first + row)}: {text!r} is not written as {form}") from error
    return at_ns


def _since_day_0(text: str) -> datetime:
    """A date, a time of day or both, or the number by which a spreadsheet counts them."""
    if ":" in text or text.count("-") > 1:
        return datetime.fromisoformat(text if "-" in text else f"{EPOCH.date()}T{text}").replace(tzinfo=None)
    return EPOCH + timedelta(days=float(text.replace(",", ".")))


def period_ns(form: TimeColumn, sheet: Sheet) -> int:
    """After how long times begin anew: those of day at midnight, those of a counter at its end; 0 of others."""
    if "%" in form.form:
        return 0 if "%d" in form.form else DAY_NS
    return round(form.wraps_at * _factor(form, sheet, sheet.number(form.column or 1))) if form.wraps_at else 0


def unwrapped(at_ns: Times, before_ns: int | None, period_ns: int) -> Times:
    """Times that go on where they begin anew after each period, if any; ``before_ns`` is the last before them."""
    if not (period_ns and at_ns.size):
        return at_ns
    periods, last_ns = divmod(int(at_ns[0]) if before_ns is None else before_ns, period_ns)
    anew = np.diff(at_ns, prepend=last_ns) < -period_ns // 2
    return at_ns + (periods + np.cumsum(anew)) * period_ns


def is_iso(text: str) -> bool:
    """Whether the text is a time of ISO 8601."""
    try:
        _parsed_ns([text])
    except pa.ArrowInvalid:
        return False
    return True


def _parsed_ns(texts: Sequence[str]) -> Times:
    zoned = texts[0].endswith("Z") or "+" in texts[0][10:] or "-" in texts[0][10:] if texts else False
    kind = pa.timestamp("ns", tz="UTC" if zoned else None)
    return np.asarray(pa.array(texts, pa.string()).cast(kind).cast(pa.int64()).to_numpy())
