"""Workbooks (xls, xlsx, xlsb, ods): every sheet a table with rows above it."""

import datetime
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import python_calamine as calamine

from rig.errors import DataError
from rig.intake.mapping import FileForm
from rig.intake.sheet import Batch, Column, Sheet, facts_in
from rig.intake.units import unit_in, unit_of

# Day 0 of spreadsheets, in the calendar of 1900 with its leap day that never was (ECMA-376 part 1, 18.17.4.1).
EPOCH = datetime.datetime(1899, 12, 30)
DAY_S = 86_400.0


def sheet_names(path: Path) -> list[str]:
    """The sheets of the workbook; raises DataError where it is damaged or encrypted."""
    return list(_opened(path).sheet_names)


def open_sheet(path: Path, name: str, form: FileForm) -> Sheet:
    """The table in sheet ``name``; raises DataError where it ends above its table."""
    cells = _opened(path).get_sheet_by_name(name).to_python(skip_empty_area=False)
    start = max(form.header_row, form.unit_row)
    if len(cells) <= start:
        raise DataError(f"{path}, {name}: ends above row {start + 1}, where its table should begin; correct header_row")
    above = [[shown(cell) for cell in row] for row in cells[:start]]
    header = above[form.header_row - 1] if form.header_row else [""] * len(cells[start])
    names = tuple(name.strip() or str(number + 1) for number, name in enumerate(header))
    stated = above[form.unit_row - 1] if form.unit_row else [""] * len(names)
    units = tuple(unit_in(unit) or unit_of(item) for unit, item in zip(stated, names, strict=True))
    rows = _filled(cells[start:])

    def read(columns: Mapping[int, bool]) -> Iterator[Batch]:
        yield [_column(f"{path}, {name}", rows, number, text, start, form) for number, text in columns.items()]

    return Sheet(path, name, names, units, read, facts_in(above[: max(form.header_row - 1, 0)]), start + 1)


def shown_rows(path: Path, name: str, count: int) -> list[list[str]]:
    """The first ``count`` rows of a sheet, as text."""
    rows = _opened(path).get_sheet_by_name(name).to_python(skip_empty_area=False, nrows=count)
    return [[shown(cell).strip() for cell in row] for row in rows]


def shown(cell: object) -> str:
    """A cell as text: dates as ISO, whole numbers without a point."""
    if isinstance(cell, datetime.date | datetime.time):
        return cell.isoformat()
    return f"{cell:.15g}" if isinstance(cell, float) else str(cell)


def _opened(path: Path) -> calamine.CalamineWorkbook:
    try:
        return calamine.CalamineWorkbook.from_path(str(path))
    except FileNotFoundError as error:
        raise DataError(f"{path}: no such file") from error
    except calamine.PasswordError as error:
        raise DataError(f"{path}: encrypted; save it without a password") from error
    except (calamine.CalamineError, OSError, ValueError) as error:
        raise DataError(
            f"{path}: not readable as a workbook ({error}); open it and save it as xlsx, or copy it again"
        ) from error


def _filled(rows: list[list[Any]]) -> list[list[Any]]:
    """Without the empty rows at the end."""
    last = max((number for number, row in enumerate(rows) if any(cell != "" for cell in row)), default=-1)
    return rows[: last + 1]


def _column(where: str, rows: list[list[Any]], number: int, text: bool, start: int, form: FileForm) -> Column:
    if text:
        return [shown(row[number]).strip() for row in rows]
    values = np.empty(len(rows))
    for at, row in enumerate(rows):
        try:
            values[at] = _number(row[number], form)
        except ValueError as error:
            raise DataError(
                f"{where} row {start + 1 + at}, column {number + 1}: {row[number]!r} is not a number"
            ) from error
    return values


def _number(cell: object, form: FileForm) -> float:
    for kind, convert in _NUMBERS.items():
        if isinstance(cell, kind):
            return convert(cell)
    text = str(cell).strip()
    return (
        math.nan if text in form.missing else float(text.replace(form.thousands or "\0", "").replace(form.decimal, "."))
    )


_NUMBERS: dict[type, Callable[[Any], float]] = {
    float: float,
    int: float,
    datetime.datetime: lambda cell: (cell - EPOCH).total_seconds() / DAY_S,
    datetime.date: lambda cell: float((cell - EPOCH.date()).days),
    datetime.time: lambda cell: (cell.hour * 3600 + cell.minute * 60 + cell.second + cell.microsecond * 1e-6) / DAY_S,
    datetime.timedelta: lambda cell: cell.total_seconds() / DAY_S,
}
