"""From a folder of axis recordings to a diagnosis, and the simulation error on the recording left out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import scipy.io

from rig.diagnosis.answers import Diagnosis
from rig.diagnosis.axis import AxisProblem, AxisRecording, force_error_percent, motion_of
from rig.diagnosis.estimates import SimulationError
from rig.diagnosis.run import judge
from rig.errors import DataError
from rig.intake.usable import read_header, read_usable
from rig.progress import Progress, silent
from rig.trials.findings import inspect_stream

NAMES = {
    "time_s": ("t", "time_s"),
    "position_m": ("qm", "position_m"),
    "reference_m": ("qg", "reference_m"),
    "control_V": ("vir", "control_V"),
}
PULSES = ("pulses_N", "pulses_V")


def diagnose_axis_folder(folder: Path, progress: Progress = silent) -> Diagnosis:
    """The recording without pulses is fitted; every other one is left out and simulated in closed loop.

    Raises DataError where no recording has time, position, reference and control signal.
    """
    if not folder.is_dir():
        raise DataError(
            f"{folder}: no such folder; give one with MAT or CSV files of time, position, reference, control"
        )
    recordings = [read_axis(path) for path in sorted([*folder.glob("*.mat"), *folder.glob("*.csv")])]
    if not recordings:
        raise DataError(f"{folder}: no .mat or .csv file in it")
    recordings.sort(key=lambda recording: bool(np.any(recording.pulses_V)))
    return diagnose_axis(recordings, folder.name, progress)


def diagnose_axis(recordings: list[AxisRecording], name: str, progress: Progress = silent) -> Diagnosis:
    """The first recording is fitted, the others simulated with the model before and after."""
    first = recordings[0]
    quality = tuple(
        finding for r in recordings for finding in inspect_stream(r.name, "control signal", r.time_s, r.control_V)
    )
    result = judge(AxisProblem(motion_of(first)), name, quality, progress=progress)
    if result.search is None:
        return result
    before, after = result.search.before.values, result.search.after.values
    simulated = tuple(
        SimulationError(r.name, r is first, force_error_percent(r, before), force_error_percent(r, after))
        for r in recordings
    )
    return replace(result, simulated=simulated)


def read_axis(path: Path) -> AxisRecording:
    """A MAT file with ``t, qm, qg, vir, kp, kv, gtau`` or a CSV file with the long names and gains in its columns.

    Raises DataError naming the file and what it lacks.
    """
    table = _mat(path) if path.suffix == ".mat" else _csv(path)
    found = {}
    for field, names in NAMES.items():
        held = [table[name] for name in names if name in table]
        if not held:
            raise DataError(f"{path}: no {' or '.join(names)} in it; it has {', '.join(sorted(table))}")
        found[field] = held[0]
    pulses = next((table[name] for name in PULSES if name in table), np.zeros_like(found["time_s"]))
    gains = {name: float(table[name][0]) if name in table else 1.0 for name in ("gtau", "kp", "kv")}
    return AxisRecording(
        path.stem, found["time_s"], found["position_m"], found["reference_m"], found["control_V"], pulses,
        gains["gtau"], gains["kp"], gains["kv"],
    )  # fmt: skip


def _mat(path: Path) -> dict[str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    try:
        content = scipy.io.loadmat(path)
    except (OSError, ValueError, NotImplementedError) as error:
        raise DataError(f"{path}: cannot be read as a MAT file: {error}") from error
    return {name: np.asarray(value, float).ravel() for name, value in content.items() if isinstance(value, np.ndarray)}


def _csv(path: Path) -> dict[str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    return read_usable(path, {name: name for name in read_header(path)}).columns
