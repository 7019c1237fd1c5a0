"""A folder of measured CSV files with its mapping, and the call that imports it."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from rig.config.table import load
from rig.intake.mapping import MAPPING_FILE, DataMapping
from rig.intake.session import import_folder
from rig.recording.sessions import Session
from rig.trials.cycles import IndentationCycle

NOW = datetime(2024, 5, 1, 10, 0, tzinfo=UTC)
TABLES = """
[[tables]]
files = "{recording:trial_*}/force.csv"
time = { column = "time_s" }
columns.force = { column = "force_N" }

[[tables]]
files = "{recording:trial_*}/axis.csv"
time = { column = "time_s" }
columns.position = { column = "position_mm" }
"""
MARKER_TABLE = """
[[tables]]
files = "{recording:trial_*}/marker.csv"
time = { column = "time_s" }
columns = { x = { column = "x_mm" }, y = { column = "y_mm" }, z = { column = "z_mm" } }
"""
MAPPING = """
recording = "{recording}"
stated = { speed_mm_s = 5.0, depth_mm = 8.0, surface_mm = 20.0 }
session = { subject = { id = "S1", age = 31 }, notes = { room = "B12" } }
"""
FORCE = "time_s,force_N\n0.000,0.0\n0.001,0.5\n0.002,1.5\n"
AXIS = "time_s,position_mm\n0.0003,20.0\n0.0013,20.005\n0.0023,20.010\n"
MARKER = "time_s,x_mm,y_mm,z_mm\n0.01,1,2,3\n0.02,,,\n0.03,1.5,2.5,3.5\n"


def write(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def turned_tables(turned: bool) -> str:
    """How the streams are read, with both senses the other way round."""
    text = TABLES
    for column, sense in (("force_N", "tension"), ("position_mm", "out")):
        text = text.replace(f'"{column}" }}', f'"{column}", positive = "{sense}" }}') if turned else text
    return text


def measured(folder: Path) -> Path:
    """A good folder of two trials, the second with a marker."""
    files = {MAPPING_FILE: MAPPING + TABLES + MARKER_TABLE}
    for number, second in (("01", "0"), ("02", "9")):
        files[f"trial_{number}/force.csv"] = FORCE.replace("\n0", f"\n{second}")
        files[f"trial_{number}/axis.csv"] = AXIS.replace("\n0", f"\n{second}")
    files["trial_02/marker.csv"] = MARKER.replace("\n0", "\n9")
    return write(folder, files)


def pressed(folder: Path, cycles: Sequence[IndentationCycle], stated: str = "") -> Path:
    """A folder of trials that touch, each on a clock of its own; ``stated`` are further lines of its mapping."""
    for number, cycle in enumerate(cycles):
        trial = folder / f"trial_{number}"
        trial.mkdir(parents=True)
        for name, header, column in (("force", "force_N", cycle.force_N), ("axis", "position_mm", cycle.position_mm)):
            rows = np.stack([cycle.time_s, column], axis=1)
            np.savetxt(trial / f"{name}.csv", rows, delimiter=",", header=f"time_s,{header}", comments="", fmt="%.6f")
    return write(folder, {MAPPING_FILE: f'recording = "{{recording}}"\n{stated}\n{TABLES}'})


def run(source: Path, out: str = "out", mapping: str = MAPPING_FILE) -> Session:
    return import_folder(source, load(DataMapping, source / mapping), source.parent / out, NOW)
