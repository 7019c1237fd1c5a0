"""A folder of measured CSV files as `rig import` wants it, and the call that reads it."""

from datetime import UTC, datetime
from pathlib import Path

from rig.recording.importing import import_session
from rig.recording.sessions import Session

NOW = datetime(2024, 5, 1, 10, 0, tzinfo=UTC)
SESSION = 'surface_mm = 20.0\n[subject]\nid = "S1"\nage = 31\n[notes]\nroom = "B12"\n'
TRIAL = "speed_mm_s = 5.0\ndepth_mm = 8.0\n"
FORCE = "time_s,force_N\n0.000,0.0\n0.001,0.5\n0.002,1.5\n"
AXIS = "time_s,position_mm\n0.0003,20.0\n0.0013,20.005\n0.0023,20.010\n"
MARKER = "time_s,x_mm,y_mm,z_mm\n0.01,1,2,3\n0.02,,,\n0.03,1.5,2.5,3.5\n"


def write(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def measured(folder: Path) -> Path:
    """A good folder of two trials, the second with a marker."""
    files = {"session.toml": SESSION}
    for number, second in (("01", "0"), ("02", "9")):
        files[f"trial_{number}/trial.toml"] = TRIAL
        files[f"trial_{number}/force.csv"] = FORCE.replace("\n0", f"\n{second}")
        files[f"trial_{number}/axis.csv"] = AXIS.replace("\n0", f"\n{second}")
    files["trial_02/marker.csv"] = MARKER.replace("\n0", "\n9")
    return write(folder, files)


def run(source: Path, *columns: str) -> Session:
    return import_session(source, source.parent / "out", columns, NOW)
