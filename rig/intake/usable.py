"""Columns of a CSV file of which something may be wrong: what can be used of it, and a remark on what cannot."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.intake.mapping import FileForm, TimeColumn, ValueColumn
from rig.intake.sheet import Sheet
from rig.intake.text import lines, open_text
from rig.intake.units import FORCE_N, LENGTH_MM, TIME_NS, unit_of

# As `rig export` writes; where a column stands is asked of each file.
PLAIN = FileForm(files="*.csv", time=TimeColumn(column="time_s"), columns={"force": ValueColumn(column="force_N")})
# Other than these the end of a name (Sensor_A, Channel_1) is no unit for certain.
CERTAIN = frozenset((*TIME_NS, *FORCE_N, *LENGTH_MM, "V", "mV", "g", "kg", "lb"))


class Usable(NamedTuple):
    """What of a file can be used: columns by field, NaN where a cell holds no number.

    ``remark`` says of the first cell that holds something else where it stands and how many more there are; ``labels``
    is the column of texts, where one was asked for.
    """

    columns: dict[str, NDArray[np.float64]]
    remark: str
    labels: tuple[str, ...] = ()


def read_header(path: Path) -> tuple[str, ...]:
    """The names in the first line; raises DataError where the file is not there, no text, or holds nothing else."""
    return open_text(path, PLAIN).header


def read_usable(path: Path, names: Mapping[str, str], more: Sequence[str] = (), label: str = "") -> Usable:
    """Columns of ``path`` by field; ``names`` says which header each field stands under, ``label`` a column of texts.

    ``more`` are columns to be read where they are there, all of them or none. Raises DataError where there is no such
    file, no such column or no row, or where it is no text.
    """
    sheet = open_text(path, PLAIN)
    there = {name: name for name in more} if set(more) <= set(sheet.header) else {}
    places = {field: _place(sheet, field, name) for field, name in {**names, **there}.items()}
    try:
        return _read(sheet, places, sheet.number(label) if label else None)
    except DataError:
        return _read_cells(sheet, places, sheet.number(label) if label else None)


def _place(sheet: Sheet, field: str, name: str) -> int:
    if name not in sheet.header:
        raise DataError(
            f"{sheet.path}: no column {name} in the header {','.join(sheet.header)!r}; "
            f"if it is there under another name, say --columns {sheet.path.stem}.{field}=NAME"
        )
    if (unit := unit_of(name)) in CERTAIN and unit != unit_of(field):
        raise DataError(f"{sheet.path}: column {name} is in {unit} by its name; {field} is needed, convert the file")
    return sheet.number(name)


def _read(sheet: Sheet, places: Mapping[str, int], label: int | None) -> Usable:
    asked = dict.fromkeys(places.values(), False) | ({} if label is None else {label: True})
    batches = [dict(zip(asked, batch, strict=True)) for batch in sheet.read(asked)]
    columns = {
        field: np.concatenate([np.asarray(batch[at], np.float64) for batch in batches]) for field, at in places.items()
    }
    return Usable(columns, "", () if label is None else tuple(str(text) for batch in batches for text in batch[label]))


def _read_cells(sheet: Sheet, places: Mapping[str, int], label: int | None) -> Usable:
    """The same cell by cell: NaN for what is no number, and a remark on it."""
    found, bad, labels = [], [], []
    for line, cells in lines(sheet.path, PLAIN, PLAIN.header_row):
        texts = [cells[place].strip() if place < len(cells) else "" for place in places.values()]
        found.append([_number_or_nan(text) for text in texts])
        bad += [
            (line, sheet.header[place], text)
            for place, text, number in zip(places.values(), texts, found[-1], strict=True)
            if math.isnan(number) and text not in PLAIN.missing
        ]
        labels.append(cells[label] if label is not None and label < len(cells) else "")
    if not found:
        raise DataError(f"{sheet.path}: holds a header and nothing else")
    remark = "{} line {}, column {}: {!r} is no number; left out".format(sheet.path.name, *bad[0]) if bad else ""
    columns = dict(zip(places, np.array(found, float).T, strict=True))
    return Usable(columns, remark + (f", as {len(bad) - 1} more" if len(bad) > 1 else ""), tuple(labels))


def _number_or_nan(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
