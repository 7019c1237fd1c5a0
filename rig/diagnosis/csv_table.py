"""Columns of a CSV file of which some cells may be no numbers: what can be used, and what to say of the rest."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from rig.errors import DataError
from rig.recording.csv_columns import with_more
from rig.simulation.drive import Array


def read_table(path: Path, names: Mapping[str, str], more: Sequence[str] = ()) -> tuple[dict[str, Array], str]:
    """The named columns of a CSV file, with ``more`` where all of these are there, and a remark on what is no number.

    Cells that are no number become NaN. Raises DataError naming file and cause.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            header = [name.strip() for name in next(csv.reader([file.readline()]), [])]
            lines = file.readlines()
    except FileNotFoundError as error:
        raise DataError(f"{path}: no such file, so this stream is missing") from error
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: is no text; export it as CSV again") from error
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from error
    lacking = [name for name in names.values() if name not in header]
    if lacking:
        raise DataError(f"{path}: {_lacking(header, lacking[0])}")
    if not lines:
        raise DataError(f"{path}: holds a header and nothing else")
    wanted = with_more(names, header, more)
    rows, remark = _numbers(lines, [header.index(name) for name in wanted.values()], header)
    return {field: rows[:, column] for column, field in enumerate(wanted)}, f"{path.name} {remark}" if remark else ""


def _lacking(header: Sequence[str], name: str) -> str:
    if not any(header):
        return "is empty; export it again"
    if len(header) == 1 and any(separator in header[0] for separator in ";\t|"):
        return f"the header is {header[0]!r}; separate columns by commas and write decimals with points"
    return f"no column {name}; it has {', '.join(header)}; name it with --columns"


def _numbers(lines: Sequence[str], columns: Sequence[int], header: Sequence[str]) -> tuple[Array, str]:
    """The columns, and where the first cell is that is no number; in one go where there is none."""
    try:
        return np.loadtxt(lines, delimiter=",", ndmin=2, usecols=columns, quotechar='"', comments=None), ""
    except (ValueError, IndexError):
        pass
    found, bad = [], []
    for line, cells in enumerate(csv.reader(lines), start=2):
        texts = [cells[column].strip() if column < len(cells) else "" for column in columns]
        found.append([as_number(text) for text in texts])
        bad += [(line, header[c], text) for c, text in zip(columns, texts, strict=True) if not is_number_or_gap(text)]
    remark = "line {}, column {}: {!r} is no number; left out".format(*bad[0]) if bad else ""
    return np.array(found), remark + (f", as {len(bad) - 1} more" if len(bad) > 1 else "")


def is_number_or_gap(text: str) -> bool:
    """Whether a cell holds a number, or says by itself that nothing was measured."""
    return text.lower() in ("", "nan") or not np.isnan(as_number(text))


def as_number(text: str) -> float:
    """The number a cell holds, NaN for anything else."""
    try:
        return float(text)
    except ValueError:
        return float("nan")
