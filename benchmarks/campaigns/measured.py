"""Real recordings, by `rig import` with the mappings in `examples/mappings`, in sets of one material and one test."""

import math
import tempfile
from dataclasses import replace
from datetime import UTC, datetime
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mock_devices.testing.real_data import ROOT, folder
from rig.config.table import load
from rig.errors import DataError
from rig.intake.mapping import DataMapping
from rig.intake.session import import_folder
from rig.trials.reading import trials_of
from rig.trials.trial import FEWEST_SAMPLES, Trial, TrialSet, drop_unusable

FEWEST = 4  # with fewer recordings nothing is judged
AT_REST = 5  # samples at the beginning, half a second of the slowest machine
MOST = 10  # as many as a session of the bench has; more take longer and show nothing else
MEMORY = frozenset({"relaxation", "second_relaxation", "third_relaxation", "power_law_relaxation"})
MEAT = MEMORY | {"elastic_law", "rate_law", "hunt_crossley", "mullins", "preconditioning", "substrate"}
GEL = MEMORY | {"elastic_law", "substrate"}  # free exponents of 1.5 to 2.2, over a rigid well


class WayIn(NamedTuple):
    """A recording from its beginning until the axis has gone ``far_mm`` or the force has changed by ``rise_N``."""

    far_mm: float = math.inf
    rise_N: float = math.inf

    def of(self, trial: Trial) -> Trial:
        """Force and motion of that part; to the turn where neither is reached."""
        trial = drop_unusable(trial)
        way_mm = np.abs(np.interp(trial.force_s, trial.axis_s, trial.axis_mm) - trial.axis_mm[0])
        rise_N = np.abs(trial.force_N - np.median(trial.force_N[:AT_REST]))
        beyond = np.flatnonzero((way_mm > self.far_mm) | (rise_N > self.rise_N))
        end = min([int(way_mm.argmax()), *beyond[:1].tolist()]) + 1
        # The motion goes on for two samples, so that it is known at the last of the force too.
        axis = np.searchsorted(trial.axis_s, trial.force_s[end - 1], side="right") + 2
        return replace(
            trial, force_s=trial.force_s[:end], force_N=trial.force_N[:end], axis_s=trial.axis_s[:axis],
            axis_mm=trial.axis_mm[:axis], temperature_C=None,
        )  # fmt: skip

    def __str__(self) -> str:
        ends = (f"{end:g} {unit}" for end, unit in zip(self, ("mm", "N"), strict=True) if end < math.inf)
        return f"in to {' or '.join(ends)}"


class MeasuredSet(NamedTuple):
    """Recordings of ``source`` whose names match; ``known`` are causes that its makers or anybody would expect of it.

    What else is named with certainty counts as false. Of each recording the whole is taken, or its ``part``.
    """

    source: str
    pattern: str
    known: frozenset[str]
    part: WayIn | None = None

    @property
    def name(self) -> str:
        """Of source and pattern, and which part."""
        return f"{self.source}:{self.pattern}{f' {self.part}' if self.part else ''}"


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
# Of none of these does the simulation reach the noise, so that no size is stated for any cause. What was chosen here is
# the first part of recordings, as far as it does or what it names does, before anything was planted in them.
PARTS = (
    MeasuredSet("vhb4910", "0d05*", MEAT, WayIn(far_mm=30.0)),
    MeasuredSet("perineal_indentation", "230331_C_Ind*FF2_1[A-H]*", MEAT, WayIn(far_mm=3.0)),
    MeasuredSet("perineal_indentation", "230331_C_Ind*FF2_2[A-H]*", MEAT, WayIn(far_mm=3.0)),
    MeasuredSet("perineal_indentation", "230331_C_Ind*FF2[A-Ha-h_]*", MEAT, WayIn(rise_N=0.2)),
    MeasuredSet("perineal_indentation", "230331_C_Ind*RDG1_1[A-H]*", MEAT, WayIn(rise_N=0.3)),
    MeasuredSet("perineal_indentation", "230403_C_Ind*-RDG2*", MEAT, WayIn(rise_N=3.0)),
    MeasuredSet("perineal_indentation", "230407_C_Ind*_FF2*", MEAT, WayIn(rise_N=1.0)),
    MeasuredSet("perineal_indentation", "230411_C_Tex*RDG2*", MEAT, WayIn(rise_N=10.0)),
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
    found = [trial for trial in imported(chosen.source).trials if fnmatch(trial.name, chosen.pattern)][:MOST]
    if chosen.part is not None:
        parts = [chosen.part.of(trial) for trial in found]
        found = [part for part in parts if len(part.force_s) >= FEWEST_SAMPLES]
    if len(found) < FEWEST:
        raise DataError(f"{chosen.name}: {len(found)} recordings (limit {FEWEST}); mend the pattern")
    return TrialSet(chosen.name, in_a_row(found))


def in_a_row(trials: list[Trial], pause_s: float = 1.0) -> tuple[Trial, ...]:
    """Each trial after the one before it, on one clock."""
    placed, begin_s = list[Trial](), 0.0
    for trial in trials:
        first_s = float(min(np.nanmin(trial.force_s), np.nanmin(trial.axis_s)))
        force_s, axis_s = trial.force_s - first_s + begin_s, trial.axis_s - first_s + begin_s
        placed.append(replace(trial, force_s=force_s, axis_s=axis_s, marker_s=None, marker_mm=None))
        begin_s = float(max(np.nanmax(force_s), np.nanmax(axis_s))) + pause_s
    return tuple(placed)
