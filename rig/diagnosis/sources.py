"""Where a session to be judged comes from: a session folder, or a folder of CSV files as `rig import` reads it.

Unlike the import, which refuses a folder with anything wrong in it, the diagnosis takes what can be used and says what
was left out: data that are wrong in part are the very data somebody wants to understand.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.config.table import load
from rig.diagnosis.gates import Finding
from rig.diagnosis.observations import Session, Streams
from rig.diagnosis.stacked import from_stacked, stacked_file
from rig.errors import DataError, RigError
from rig.recording.csv_columns import TOOL, read_usable
from rig.recording.import_format import EXPORTED, FIELDS, OPTIONAL, SessionTable, TrialTable, column_names
from rig.recording.reader import Recording
from rig.recording.sessions import open_session
from rig.recording.tables import compression_N
from rig.simulation.drive import Array, Index
from rig.trials.quality import TrialQuality, quality_of

TIP_TOOL = 0
NS = 1e-9
LATE_NS = 500_000
MOST_LATE = 0.01


def read_source(folder: Path, columns: tuple[str, ...] = (), only: str = "") -> Session:
    """The session in ``folder``, of which stacked recordings may be chosen by a pattern; raises DataError."""
    if not folder.is_dir():
        raise DataError(f"{folder}: no such folder; give a session, or a folder with session.toml and trial_*/")
    if any(folder.glob("*.mcap")):
        return from_session(folder)
    if any(folder.glob("trial_*")):
        return from_csv(folder, columns)
    stacked = stacked_file(folder)
    if stacked is not None:
        return from_stacked(stacked, columns, only)
    raise DataError(f"{folder}: neither recordings (*.mcap) nor trial folders (trial_*) are in it")


def from_session(folder: Path) -> Session:
    """Every trial of a session whose recording opens, on the clock of the first; no runs of force tracking."""
    session = open_session(folder)
    recordings, findings = [], [Finding("", "session", "incomplete", remark) for remark in session.remarks]
    for trial in session.trials:
        try:
            recording = session.recording(trial.name)
        except RigError as error:
            findings.append(Finding(trial.name, "recording", "unreadable", str(error)))
            continue
        if recording.tracks_force:
            continue
        found = quality_of(recording, trial)
        if found and found.reasons:
            findings.append(Finding(trial.name, "recording", f"quality_{found.verdict}", _of_quality(found)))
        if found is None or found.verdict != "bad":
            recordings.append((trial.name, recording))
    starts = [int(r.tables["force"]["capture_ns"][0]) for _, r in recordings if len(r.tables["force"])]
    streams = [streams_of(name, recording, min(starts, default=0)) for name, recording in recordings]
    findings += [finding for name, recording in recordings for finding in late(name, recording.tables["axis"])]
    stated = {r.metadata.get("calibration", {}).get("surface_mm", "") for _, r in recordings}
    surface = float(stated.pop()) if len(stated) == 1 and "" not in stated else None
    return Session(folder.name, tuple(streams), surface, findings=tuple(findings))


def _of_quality(found: TrialQuality) -> str:
    left_out = ", left out" if found.verdict == "bad" else ""
    return f"quality {found.verdict}{left_out}: {'; '.join(found.reasons)}"


def streams_of(name: str, recording: Recording, start_ns: int) -> Streams:
    """The raw streams of a recording, samples the devices vouch for; the tip is tool 0 of the tracker."""
    force, axis, marker = (recording.tables[stream] for stream in ("force", "axis", "marker"))
    sound, moving = force["valid"] != 0, (axis["valid"] != 0) & in_time(axis["capture_ns"], axis["arrival_ns"])
    seen = (marker["tool"] == TIP_TOOL) & (marker["valid"] != 0)
    temperature = force["temperature_C"][sound]
    return Streams(
        name,
        (force["capture_ns"][sound] - start_ns) * NS,
        compression_N(recording)[sound],
        (axis["capture_ns"][moving] - start_ns) * NS,
        axis["position_mm"][moving],
        (marker["capture_ns"][seen] - start_ns) * NS,
        np.stack([marker[field][seen] for field in ("x_mm", "y_mm", "z_mm")], axis=1),
        temperature if temperature.size and np.isfinite(temperature).all() else None,
    )


def late(name: str, axis: Mapping[str, Array] | NDArray[np.void]) -> list[Finding]:
    """What to say of an axis whose samples came late; nothing below 1 %."""
    share = 1 - float(np.mean(in_time(axis["capture_ns"], axis["arrival_ns"]))) if len(axis["capture_ns"]) else 0.0
    text = f"axis: {100 * share:.0f} % of the samples came more than 0.5 ms later than usual; these were left out"
    return [Finding(name, "axis", "late", text)] if share > MOST_LATE else []


def in_time(capture_ns: Index | Array, arrival_ns: Index | Array) -> NDArray[np.bool_]:
    """Samples that came no later than usual, within 0.5 ms.

    A drive that is asked late tells where it is then, under the time it should have been asked; at the ends of a dither
    that is always further back, and would pass for stiffer tissue there.
    """
    taken_ns = arrival_ns - capture_ns
    return np.asarray(taken_ns < np.median(taken_ns) + LATE_NS) if len(taken_ns) else np.zeros(0, bool)


def from_csv(folder: Path, columns: tuple[str, ...] = ()) -> Session:
    """Trials of a CSV folder in the senses of its ``session.toml``; what cannot be read is left out and said."""
    names = column_names(columns)
    table = load(SessionTable, folder / "session.toml") if (folder / "session.toml").exists() else SessionTable()
    streams, findings = [], []
    for path in sorted(path for path in folder.glob("trial_*") if path.is_dir()):
        read, said = _read_trial(path, names)
        findings += said
        if "force" in read and "axis" in read:
            findings += late(path.name, read["axis"]) if "arrival_ns" in read["axis"] else []
            streams.append(_csv_streams(path, read, table))
    surface = None if table.surface_mm is None else table.position_positive * table.surface_mm
    return Session(folder.name, tuple(streams), surface, findings=tuple(findings))


def _read_trial(
    path: Path, names: Mapping[str, Mapping[str, str]]
) -> tuple[dict[str, dict[str, Array]], list[Finding]]:
    """The streams that can be read, and what is to be said of the others."""
    read: dict[str, dict[str, Array]] = {}
    findings = []
    for stream in FIELDS:
        file = path / f"{stream}.csv"
        if stream in OPTIONAL and not file.exists():
            continue
        try:
            found = read_usable(file, names[stream], EXPORTED[stream])
            read[stream] = found.columns
            findings += [Finding(path.name, stream, "text", found.remark)] if found.remark else []
        except DataError as error:
            findings.append(Finding(path.name, stream, "unreadable", str(error)))
    return read, findings


def _csv_streams(path: Path, read: dict[str, dict[str, Array]], table: SessionTable) -> Streams:
    force, axis, marker = read["force"], _in_time_rows(read["axis"]), _tip_rows(read.get("marker"))
    trial = load(TrialTable, path / "trial.toml") if (path / "trial.toml").exists() else None
    kelvin = None if trial is None else trial.temperature_C
    return Streams(
        path.name,
        force["time_s"],
        table.force_positive * force["force_N"],
        axis["time_s"],
        table.position_positive * axis["position_mm"],
        None if marker is None else marker["time_s"],
        None if marker is None else np.stack([marker[field] for field in ("x_mm", "y_mm", "z_mm")], axis=1),
        None if kelvin is None else np.full(force["time_s"].shape, kelvin),
    )


def _in_time_rows(axis: dict[str, Array]) -> dict[str, Array]:
    """Without the rows that came late, where the file says when each came."""
    if "arrival_ns" not in axis:
        return axis
    keep = in_time(axis["capture_ns"], axis["arrival_ns"])
    return {field: column[keep] for field, column in axis.items()}


def _tip_rows(marker: dict[str, Array] | None) -> dict[str, Array] | None:
    """The tip's own rows, where the file holds several tools."""
    if marker is None or TOOL not in marker:
        return marker
    return {field: column[marker[TOOL] == TIP_TOOL] for field, column in marker.items()}
