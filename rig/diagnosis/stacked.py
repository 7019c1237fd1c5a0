"""Recordings stacked in one CSV file, told apart by a column ``recording``, as testing machines are often exported."""

import csv
import gzip
from fnmatch import fnmatch
from pathlib import Path
from typing import TextIO

import numpy as np

from rig.diagnosis.csv_table import as_number
from rig.diagnosis.gates import Finding
from rig.diagnosis.observations import Session, Streams
from rig.errors import DataError
from rig.simulation.drive import Array

NAME = "recording"
# Headers a column may stand under, the project's own first.
HEADERS = {"time_s": ("time_s", "t_s"), "force_N": ("force_N",), "position_mm": ("position_mm", "extension_mm")}
SERIES = "|"
GAP_S = 1.0


def stacked_file(folder: Path) -> Path | None:
    """The one CSV file in ``folder`` that has a column ``recording``."""
    for path in sorted([*folder.glob("*.csv"), *folder.glob("*.csv.gz")]):
        with _opened(path) as file:
            if NAME in next(csv.reader(file), []):
                return path
    return None


def from_stacked(path: Path, columns: tuple[str, ...] = (), only: str = "") -> Session:
    """The recordings whose names match ``only``; without it those of the first series (the name up to ``|``).

    They state no common clock and are laid one after the other. Raises DataError naming what is missing.
    """
    found = _read(path, _headers(columns))
    pattern = only or f"{next(iter(found)).partition(SERIES)[0]}*"
    chosen = {name: rows for name, rows in found.items() if fnmatch(name, pattern)}
    if not chosen:
        raise DataError(f"{path}: no recording matches {only!r}; they are called like {next(iter(found))!r}")
    text = f"{len(chosen)} of {len(found)} recordings are judged, those matching {pattern!r}; choose others with --only"
    streams, start_s = [], 0.0
    for name, (time_s, force_N, position_mm) in chosen.items():
        at_s = time_s - time_s[0] + start_s
        streams.append(Streams(name, at_s, force_N, at_s, position_mm))
        start_s = float(np.nanmax(at_s)) + GAP_S
    return Session(path.parent.name, tuple(streams), findings=(Finding("", "session", "chosen", text),))


def _headers(columns: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    given = {key.rpartition(".")[2]: header for key, _, header in (column.partition("=") for column in columns)}
    return {field: (given[field],) if field in given else names for field, names in HEADERS.items()}


def _read(path: Path, headers: dict[str, tuple[str, ...]]) -> dict[str, Array]:
    """Arrays of shape (3, n) by recording, in the order of the file; what is no number becomes NaN."""
    rows: dict[str, list[tuple[float, ...]]] = {}
    with _opened(path) as file:
        reader = csv.DictReader(file)
        header = reader.fieldnames or []
        names = []
        for field, known in headers.items():
            held = [name for name in known if name in header]
            if not held:
                raise DataError(f"{path}: no column {known[0]}; it has {', '.join(header)}; name it with --columns")
            names.append((field, held[0]))
        for row in reader:
            rows.setdefault(str(row[NAME]), []).append(tuple(as_number(row[name] or "") for _, name in names))
    if not rows:
        raise DataError(f"{path}: holds a header and nothing else")
    return {name: np.array(values).T for name, values in rows.items()}


def _opened(path: Path) -> TextIO:
    return gzip.open(path, "rt", newline="") if path.suffix == ".gz" else path.open(newline="")
