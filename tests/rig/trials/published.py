"""Recordings that others have published, read from their makers' files without the project's own readers."""

import csv
import gzip
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from rig.trials.trial import Trial
from tests import data


def _trial(name: str, rows: Iterable[Sequence[str]], columns: tuple[int, int, int], sign: float = 1.0) -> Trial:
    """Time [s], force [N] and position [mm] from three columns of numbers."""
    time_s, force_N, position_mm = np.array([[float(row[column]) for column in columns] for row in rows]).T
    return Trial(name, time_s, sign * force_N, time_s, sign * position_mm)


def machine_strokes() -> list[Trial]:
    """Ramps on meat and silicone at 10 Hz; most begin at the surface, some above it, some under a preload."""
    rows: dict[str, list[list[str]]] = defaultdict(list)
    with gzip.open(data.recording("perineal_indentation/recordings.csv.gz"), "rt") as file:
        for row in list(csv.reader(file))[1:]:
            rows[row[0]].append(row)
    return [_trial(name, found, (1, 2, 3)) for name, found in rows.items()]


def elastomer() -> list[Trial]:
    """Strips pulled and released, clamped from the start; header in another encoding, a row of units."""
    paths = sorted(data.recording("vhb4910").glob("*.csv"))
    return [_trial(path.stem, _numbers(path), (0, 2, 1)) for path in paths]


def well_plate() -> list[Trial]:
    """Hydrogels pressed by a gantry at 10 Hz; below a preamble, position and force count upwards."""
    paths = sorted(data.recording("asmi").glob("*/well_??_*.csv"))
    return [_trial(f"{path.parent.name}/{path.stem}", _numbers(path), (0, 2, 1), -1.0) for path in paths]


def _numbers(path: Path) -> list[list[str]]:
    """The rows below whatever stands above them."""
    rows = csv.reader(path.read_text("latin-1").splitlines())
    return [row for row in rows if len(row) >= 3 and row[0].replace(".", "", 1).isdigit()]
