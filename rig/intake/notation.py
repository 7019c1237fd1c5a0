"""How numbers and times are written in the cells of a text: decimal sign, thousands, dates and hours."""

import re
from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import NamedTuple

from rig.intake.edited import with_hyphens

_PLAIN = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
# Fortran writes doubles with D, and always with a point: without one it is a name, such as 3D2.
_DOUBLE = re.compile(r"[+-]?(\d+[.,]\d*|[.,]\d+)[dD][+-]?\d+")
# A group before the first sign begins with no 0: 0.020 is no 20.
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:([.,'\u2019 \u00a0\u202f])\d{3})(?:\1\d{3})*(?:([.,])\d+)?")
_STAMP = re.compile(r"(\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}[T ]?)?(\d{1,2}:\d{2}(:\d{2}([.,:]\d*)?)?( ?[AaPp][Mm])?)?.{0,6}")
# A number in which the sign parts thousands.
GROUPS = r"[+-]?[1-9]\d{{0,2}}(?:{0}\d{{3}})+(?:[.,]\d*)?(?:[eE][+-]?\d+)?"
# A comma with three digits behind and one to three, the first of them no 0, before it may part thousands.
_UNSURE = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
# As loggers and spreadsheets write times that are not ISO 8601.
DAYS = ("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%Y/%m/%d", "%Y.%m.%d", "%d-%m-%Y", "%Y-%m-%d")
HOURS = (
    "%H:%M:%S.%f", "%H:%M:%S,%f", "%H:%M:%S", "%I:%M:%S %p", "%I:%M:%S.%f %p", "%M:%S.%f", "%H:%M:%S:%f",
    "%M:%S,%f",
)  # fmt: skip
ZONED = ("%H:%M:%S.%f %z", "%H:%M:%S %z")


class Notation(NamedTuple):
    """The decimal sign, the sign that parts thousands, the letter of exponents.

    ``unsure`` is a cell of which the signs are not certain, ``minus`` one whose minus is no hyphen.
    """

    decimal: str
    thousands: str
    unsure: str = ""
    exponent: str = "E"
    minus: str = ""


def is_number(cell: str) -> bool:
    """Whether the cell is a number in any notation."""
    cell = hyphened(cell)
    return bool(_PLAIN.fullmatch(cell) or _GROUPED.fullmatch(cell) or _DOUBLE.fullmatch(cell))


def hyphened(cell: str) -> str:
    """The cell with a hyphen for its minus."""
    return cell if cell.isascii() else with_hyphens(cell.encode()).decode()


def is_stamp(cell: str) -> bool:
    """Whether the cell is a date, a time of day or both."""
    return len(cell) > 4 and cell[0].isdigit() and ":" in cell and bool(_STAMP.fullmatch(cell))


def notation_of(cells: Iterable[str]) -> Notation:
    """What all the cells together say."""
    written = [cell for cell in cells if is_number(cell)]
    numbers = list(map(hyphened, written))
    minus = next((cell for cell, plain in zip(written, numbers, strict=True) if cell != plain), "")
    return _signs_of(numbers)._replace(exponent="D" if any(map(_DOUBLE.fullmatch, numbers)) else "E", minus=minus)


def _signs_of(numbers: Sequence[str]) -> Notation:
    commas = [cell for cell in numbers if "," in cell]
    parted = {match[1] for match in map(_GROUPED.fullmatch, numbers) if match and _parts(match)}
    points = any("." in cell and not _GROUPED.fullmatch(cell) for cell in numbers)
    if parted:
        (thousands, *_) = sorted(parted)
        decimal = "," if thousands == "." or (thousands != "," and commas) else "."
        return Notation(decimal, thousands)
    if not commas:
        return Notation(".", "")
    if points:
        return Notation(".", ",") if all(map(_GROUPED.fullmatch, commas)) else Notation(",", "")
    unsure = next(iter(commas), "") if all(_UNSURE.fullmatch(cell) for cell in commas) else ""
    return Notation(",", "", unsure)


def parts_thousands(columns: Iterable[Sequence[str]]) -> bool:
    """Whether a column has whole numbers below a thousand without a comma, and above with one before three digits."""
    return any(
        any(map(_UNSURE.fullmatch, cells)) and any(cell.isdigit() and 0 < int(cell) < 1000 for cell in cells)
        for cells in columns
    )


def _parts(match: re.Match[str]) -> bool:
    """Whether the sign cannot be a decimal one: there is another, it stands twice, or it is neither point nor comma."""
    return bool(match[2]) or match[0].count(match[1]) > 1 or match[1] not in ".,"


def pattern_of(texts: Iterable[str]) -> tuple[str, ...]:
    """The patterns of `strptime` in which all of the texts are written, the likeliest first."""
    shown = list(texts)
    patterns = [*HOURS, *(f"{day} {hour}" for day in DAYS for hour in (*HOURS[:5], *ZONED))]
    return tuple(pattern for pattern in patterns if shown and all(_written(text, pattern) for text in shown))


def _written(text: str, pattern: str) -> bool:
    try:
        datetime.strptime(text, pattern)
    except ValueError:
        return False
    return True
