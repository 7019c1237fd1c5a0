"""Real recordings, by `rig import` with the mappings in `examples/mappings`, in sets of one material and one test."""

import tempfile
from dataclasses import replace
from datetime import UTC, datetime
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.config.table import load
from rig.errors import DataError
from rig.intake.mapping import DataMapping
from rig.intake.session import import_folder
from rig.trials.reading import trials_of
from rig.trials.trial import Trial, TrialSet
from tests.data import ROOT, folder

FEWEST = 4  # with fewer recordings nothing is judged
MOST = 10  # as many as a session of the bench has; more take longer and show nothing else
MEMORY = frozenset({"relaxation", "second_relaxation", "third_relaxation", "power_law_relaxation"})
MEAT = MEMORY | {"elastic_law", "rate_law", "hunt_crossley", "mullins", "preconditioning", "substrate"}
GEL = MEMORY | {"elastic_law", "substrate"}  # free exponents of 1.5 to 2.2, over a rigid well


class MeasuredSet(NamedTuple):
    """Recordings of ``source`` whose names match; ``known`` are causes that its makers or anybody would expect of it.

    What else is named with certainty counts as false.
    """

    source: str
    pattern: str
    known: frozenset[str]

    @property
    def name(self) -> str:
        """Of source and pattern."""
        return f"{self.source}:{self.pattern}"


SETS = (
    MeasuredSet("asmi", "run_001_*", GEL),
    MeasuredSet("asmi", "run_002_*", GEL),
    MeasuredSet("asmi", "run_004_*", GEL),
    MeasuredSet("asmi", "run_007*", GEL),
    MeasuredSet("perineal_indentation", "230411_C_Ind*RDG1*", MEAT),
    MeasuredSet("perineal_indentation", "230411_C_Ind*FF1*", MEAT),
    MeasuredSet("perineal_indentation", "230331_C_Texturo_FF*FF1*", MEAT),
    MeasuredSet("perineal_indentation", "230411_C_Texturo*FF2*", MEAT),
    MeasuredSet("zwick_original", "*", MEAT),
    MeasuredSet("soft_food", "*", MEAT),
    MeasuredSet("vhb4910", "*", MEAT),
)


@cache
def imported(source: str) -> TrialSet:
    """Everything of one source; raises DataError where it is not here."""
    where = folder() / source
    if not where.is_dir():
        raise DataError(f"{where}: no such recordings; set TISSUE_RIG_DATA to the folder that holds {source}")
    mapping = load(DataMapping, ROOT / "examples" / "mappings" / f"{source}.toml")
    with tempfile.TemporaryDirectory() as scratch:
        return trials_of(import_folder(where, mapping, Path(scratch) / "session", datetime(2026, 1, 1, tzinfo=UTC)))


@cache
def session_of(chosen: MeasuredSet) -> TrialSet:
    """The set as a session, one recording after the other where each counts its own time."""
    found = [trial for trial in imported(chosen.source).trials if fnmatch(trial.name, chosen.pattern)]
    if len(found) < FEWEST:
        raise DataError(f"{chosen.name}: {len(found)} recordings (limit {FEWEST}); mend the pattern")
    return TrialSet(chosen.name, in_a_row(found[:MOST]))


def in_a_row(trials: list[Trial], pause_s: float = 1.0) -> tuple[Trial, ...]:
    """Each trial after the one before it, on one clock."""
    placed, begin_s = list[Trial](), 0.0
    for trial in trials:
        first_s = float(min(np.nanmin(trial.force_s), np.nanmin(trial.axis_s)))
        force_s, axis_s = trial.force_s - first_s + begin_s, trial.axis_s - first_s + begin_s
        placed.append(replace(trial, force_s=force_s, axis_s=axis_s, marker_s=None, marker_mm=None))
        begin_s = float(max(np.nanmax(force_s), np.nanmax(axis_s))) + pause_s
    return tuple(placed)
