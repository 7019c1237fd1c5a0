"""Workbooks (xls, xlsx, xlsb, ods): every sheet as the text it would be saved as, with all digits."""

import csv
import datetime
import faulthandler
import io
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path

import python_calamine as calamine

from rig.errors import DataError
from rig.intake.sheet import DAMAGE, refuse_large, unreadable

# Day 0 of spreadsheets, in the calendar of 1900 with its leap day that never was (ECMA-376 part 1, 18.17.4.1).
EPOCH = datetime.datetime(1899, 12, 30)
DAY_S = 86_400.0
# Cells of a sheet are held in memory, ten times as large as they are packed.
LARGEST_B = 0.15e9
# Of a compound file, as which the old form is stored ([MS-CFB] 2.2).
COMPOUND = bytes.fromhex("d0cf11e0a1b11ae1")
ENDS_IT = "what is damaged in it ends the program that reads it"


def sheet_names(path: Path) -> list[str]:
    """The sheets of the workbook; raises DataError where it is damaged or encrypted."""
    with _readable(path):
        return list(calamine.CalamineWorkbook.from_path(str(path)).sheet_names)


def hidden_sheets(path: Path) -> set[str]:
    """The sheets that the workbook's maker does not show; raises DataError where it cannot be read."""
    with _readable(path):
        found = calamine.CalamineWorkbook.from_path(str(path)).sheets_metadata
    return {sheet.name for sheet in found if sheet.visible != calamine.SheetVisibleEnum.Visible}


def sheet_text(path: Path, name: str, decimal: str) -> bytes:
    """The rows of sheet ``name`` as lines with commas between their cells; raises DataError as above."""
    with _readable(path):
        return _text(path, name, decimal, path.stat().st_mtime_ns)


@lru_cache(maxsize=64)  # a sheet is read once for its head and once for its rows, those of all files after one another
def _text(path: Path, name: str, decimal: str, _changed_ns: int) -> bytes:
    sheet, text = calamine.CalamineWorkbook.from_path(str(path)).get_sheet_by_name(name), io.StringIO()
    rows = sheet.to_python(skip_empty_area=False)
    csv.writer(text, lineterminator="\n").writerows([[_written(cell, decimal) for cell in row] for row in rows])
    return text.getvalue().encode()


def _written(cell: object, decimal: str) -> str:
    """A cell as text in one line: dates and times as ISO, a number with all its digits, a whole one without a point."""
    if isinstance(cell, float):
        return repr(cell).removesuffix(".0").replace(".", decimal)
    if isinstance(cell, datetime.timedelta):
        days = cell.total_seconds() / DAY_S
        cell = (datetime.datetime.min + cell).time() if days < 1 else days
    return cell.isoformat() if isinstance(cell, datetime.date | datetime.time) else " ".join(str(cell).split())


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    try:
        with path.open("rb") as file:  # says why it cannot, which the library does not
            old = file.read(len(COMPOUND)) == COMPOUND
        refuse_large(path, LARGEST_B, "save its sheets as CSV, which is read piece by piece")
        if old and not _survived(str(path), path.stat().st_mtime_ns):
            raise ValueError(ENDS_IT)
        yield
    except FileNotFoundError as error:
        raise DataError(f"{path}: no such file") from error
    except calamine.PasswordError as error:
        raise DataError(f"{path}: encrypted; save it without a password") from error
    except (calamine.CalamineError, *DAMAGE) as error:
        raise unreadable(path, "a workbook", error, "open it and save it as xlsx, or copy it again") from error


@lru_cache(maxsize=1024)
def _survived(path: str, _changed_ns: int) -> bool:
    """Whether another process lives that reads the whole workbook: the library aborts on some that are damaged."""
    with warnings.catch_warnings():  # other threads hold nothing that the child needs
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child:
        return os.waitpid(child, 0)[1] == 0
    ended = 1
    try:
        faulthandler.disable()
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        with suppress(Exception):  # which whoever reads it next will say; a panic is none
            book = calamine.CalamineWorkbook.from_path(path)
            for name in book.sheet_names:
                book.get_sheet_by_name(name).to_python(skip_empty_area=False)
        ended = 0
    finally:
        os._exit(ended)
