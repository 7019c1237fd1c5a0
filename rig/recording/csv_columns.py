"""Columns of a CSV file nobody here wrote: what can be used of it, and a remark on what cannot.

Arrow reads the file in one go; only where something is wrong is it read again, cell by cell, to say what and where.
"""

import csv
import gzip
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv
from numpy.typing import NDArray

from rig.errors import DataError

TIME, TOOL = "time_s", "tool"
# Units people write behind a name; used only to tell a wrong unit from a wrong name.
UNITS = frozenset("s ms us ns min N kN mN cN kg g lb lbf kgf V mV mm m cm um nm in inch mil".split())  # noqa: SIM905
_MISSING = ("", "nan", "NaN", "NAN", "MISSING")


class Usable(NamedTuple):
    """What of a file can be used: columns by field, NaN where a cell holds no number.

    ``remark`` says of the first cell that holds something else where it stands and how many more there are; ``labels``
    is the column of texts, where one was asked for.
    """

    columns: dict[str, NDArray[np.float64]]
    remark: str
    labels: tuple[str, ...] = ()


def read_usable(path: Path, names: Mapping[str, str], more: Sequence[str] = (), label: str = "") -> Usable:
    """Columns of ``path`` by field; ``names`` says which header each field stands under, ``label`` a column of texts.

    ``more`` are columns to be read where they are there, all of them or none.

    Raises DataError where there is no such file, no such column or no row, or where it is no text.
    """
    header = read_header(path)
    names = _checked(path, header, names, more)
    try:
        found = _read(path, header, names, label)
    except pa.ArrowInvalid:
        found = _read_cells(path, header, names, label)
    if not len(next(iter(found.columns.values()))):
        raise DataError(f"{path}: holds a header and nothing else")
    return found


def read_header(path: Path) -> list[str]:
    """The names in the first line; raises DataError where the file is not there or no text."""
    try:
        with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
            line = file.readline(100_000).decode("utf-8-sig")
    except FileNotFoundError as error:
        raise DataError(f"{path}: no such file") from error
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise DataError(f"{path} line 1: not UTF-8 text; save the file as UTF-8") from error
    return [name.strip() for name in next(csv.reader([line]), [])]


def _checked(path: Path, header: list[str], names: Mapping[str, str], more: Sequence[str]) -> dict[str, str]:
    """``names``, each of which is in the header, and ``more`` under their own names where all of these are."""
    for field, name in names.items():
        _check_name(path, header, field, name)
    return {**names, **({name: name for name in more} if all(name in header for name in more) else {})}


def _check_name(path: Path, header: list[str], field: str, name: str) -> None:
    shown = ",".join(header)
    if name not in header:
        if len(header) == 1 and any(separator in shown for separator in ";\t|"):
            raise DataError(
                f"{path} line 1: the header is {shown!r}; separate columns by commas and write decimals with points"
            )
        raise DataError(f"{path} line 1: no column {name} in the header {shown!r}; {_advice(header, path, field)}")
    if header.count(name) > 1:
        raise DataError(f"{path} line 1: column {name} stands {header.count(name)} times in the header {shown!r}")
    if (unit := unit_of(name)) and unit != unit_of(field):
        raise DataError(f"{path} line 1: column {name} is in {unit} by its name; {field} is needed, convert the file")


def _advice(header: list[str], path: Path, field: str) -> str:
    base, _, unit = field.rpartition("_")
    for name in header:
        if name.lower().startswith(base) and unit_of(name) not in ("", unit):
            return f"{name} is in {unit_of(name)}, {unit} is needed: convert the file"
    return f"if it is there under another name, say --columns {path.stem}.{field}=NAME"


def unit_of(name: str) -> str:
    """The unit a column's name ends in (``force_kN``, ``Force [kN]``, ``x (mm)``); empty if it names none."""
    last = name.replace("[", " ").replace("]", " ").replace("(", " ").replace(")", " ").replace("_", " ").split()
    return last[-1] if len(last) > 1 and last[-1] in UNITS else ""


def _read(path: Path, header: list[str], names: Mapping[str, str], label: str = "") -> Usable:
    unique = [f"{number}:{name}" for number, name in enumerate(header)]
    chosen = {field: unique[header.index(name)] for field, name in names.items()}
    texts = [unique[header.index(label)]] if label else []
    table = arrow_csv.read_csv(
        path,
        read_options=arrow_csv.ReadOptions(skip_rows=1, column_names=unique),
        convert_options=arrow_csv.ConvertOptions(
            include_columns=[*chosen.values(), *texts],
            column_types=dict.fromkeys(chosen.values(), pa.float64()) | dict.fromkeys(texts, pa.string()),
            null_values=list(_MISSING),
        ),
    )
    columns = {field: table[name].to_numpy().astype(np.float64) for field, name in chosen.items()}
    return Usable(columns, "", tuple(table[texts[0]].to_pylist()) if label else ())


def _read_cells(path: Path, header: list[str], names: Mapping[str, str], label: str) -> Usable:
    """The same cell by cell: NaN for what is no number, and a remark on it."""
    places, found, bad, labels = {f: header.index(n) for f, n in names.items()}, [], [], []
    for line, cells in _rows(path):
        texts = {field: cells[place].strip() if place < len(cells) else "" for field, place in places.items()}
        numbers = {field: _number_or_nan(text) for field, text in texts.items()}
        bad += [(line, names[f], texts[f]) for f, x in numbers.items() if math.isnan(x) and texts[f] not in _MISSING]
        found.append(list(numbers.values()))
        labels.append(cells[header.index(label)] if label and header.index(label) < len(cells) else "")
    remark = "{} line {}, column {}: {!r} is no number; left out".format(path.name, *bad[0]) if bad else ""
    columns = dict(zip(names, np.array(found, float).reshape(-1, len(names)).T, strict=True))
    return Usable(columns, remark + (f", as {len(bad) - 1} more" if len(bad) > 1 else ""), tuple(labels))


def _number_or_nan(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _rows(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number of the line and cells of each row under the header."""
    reader = csv.reader(io.StringIO(_text(path), newline=""))
    try:
        next(reader)
        yield from ((reader.line_num, cells) for cells in filter(None, reader))
    except csv.Error as error:
        raise DataError(f"{path} line {reader.line_num}: {error}") from error


def _text(path: Path) -> str:
    data = gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise DataError(f"{path} line {line}: not UTF-8 text; save the file as UTF-8") from error
