"""Recordings stacked in one CSV file, told apart by a column ``recording``, as testing machines are often exported."""

from fnmatch import fnmatch
from pathlib import Path

import numpy as np

from rig.errors import DataError
from rig.intake.usable import read_header, read_usable
from rig.trials.findings import Finding
from rig.trials.trial import Trial, TrialSet

NAME = "recording"
# Headers a column may stand under, the project's own first.
HEADERS = {"time_s": ("time_s", "t_s"), "force_N": ("force_N",), "position_mm": ("position_mm", "extension_mm")}
SERIES = "|"
GAP_S = 1.0  # the file has no time between them: a hundred times what is a gap within one


def stacked_file(folder: Path) -> Path | None:
    """The one CSV file in ``folder`` that has a column ``recording``."""
    files = sorted([*folder.glob("*.csv"), *folder.glob("*.csv.gz")])
    return next((path for path in files if NAME in read_header(path)), None)


def read_stacked(path: Path, columns: tuple[str, ...] = (), only: str = "") -> TrialSet:
    """The recordings whose names match ``only``; without it those of the first series (the name up to ``|``).

    They state no common clock and are laid one after the other. Raises DataError naming what is missing.
    """
    table, remark, labels = read_usable(path, _names(path, columns), label=NAME)
    of = np.array(labels)
    found = list(dict.fromkeys(labels))
    pattern = only or f"{found[0].partition(SERIES)[0]}*"
    chosen = [name for name in found if fnmatch(name, pattern)]
    if not chosen:
        raise DataError(f"{path}: no recording matches {only!r}; they are called like {found[0]!r}")
    text = f"{len(chosen)} of {len(found)} recordings are judged, those matching {pattern!r}; choose others with --only"
    findings = (Finding("", "session", "chosen", text), *([Finding("", "session", "text", remark)] if remark else []))
    trials, start_s = [], 0.0
    for name in chosen:
        time_s, force_N, position_mm = (column[of == name] for column in table.values())
        at_s = time_s - time_s[0] + start_s
        trials.append(Trial(name, at_s, force_N, at_s, position_mm))
        start_s = float(np.nanmax(at_s)) + GAP_S
    return TrialSet(path.parent.name, tuple(trials), findings=findings)


def _names(path: Path, columns: tuple[str, ...]) -> dict[str, str]:
    """Which header each field stands under: the one given, else the first of the known ones that is there."""
    given = {key.rpartition(".")[2]: header for key, _, header in (column.partition("=") for column in columns)}
    header = read_header(path)
    known = {field: [name for name in names if name in header] for field, names in HEADERS.items()}
    return {field: given.get(field) or (known[field] or names)[0] for field, names in HEADERS.items()}
