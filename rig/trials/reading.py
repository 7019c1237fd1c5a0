"""Trials from where they are kept: a session folder, or a folder of CSV files as `rig import` reads it.

Unlike the import, which refuses a folder with anything wrong in it, this takes what can be used and says what was left
out: data that are wrong in part are the very data somebody wants to understand.
"""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from rig.config.table import load
from rig.errors import DataError, RigError
from rig.intake.mapping import MAPPING_FILE, DataMapping, RecordingFacts
from rig.intake.usable import read_usable
from rig.recording.import_format import EXPORTED, FIELDS, OPTIONAL, TOOL, column_names
from rig.recording.sessions import Session, open_session
from rig.recording.slope import TIP_TOOL
from rig.trials.findings import UNREADABLE, Array, Finding
from rig.trials.quality import quality_of
from rig.trials.recorded import in_time, late, shifted, start_ns, trial_of
from rig.trials.stacked import read_stacked, stacked_file
from rig.trials.trial import Trial, TrialSet


def read_trials(folder: Path, columns: tuple[str, ...] = (), only: str = "") -> TrialSet:
    """The trials in ``folder``, of which stacked recordings may be chosen by a pattern; raises DataError."""
    if not folder.is_dir():
        raise DataError(f"{folder}: no such folder; give a session, or a folder with trial_*/")
    if any(folder.glob("*.mcap")):
        return trials_of(open_session(folder))
    if any(folder.glob("trial_*")):
        return trials_in_csv(folder, columns)
    stacked = stacked_file(folder)
    if stacked is not None:
        return read_stacked(stacked, columns, only)
    raise DataError(f"{folder}: neither recordings (*.mcap) nor trial folders (trial_*) are in it")


def trials_of(session: Session) -> TrialSet:
    """Every trial of a session that opens and is not bad, on the clock of the first; no runs of force tracking."""
    findings = [Finding("", "session", "incomplete", remark) for remark in session.remarks]
    trials, starts_ns, stated = [], [], set()
    for info in session.trials:
        try:
            recording = session.recording(info.name)
            if recording.tracks_force:
                continue
            found = quality_of(recording, info)
            trial = trial_of(info.name, recording)
        except RigError as error:
            findings.append(Finding(info.name, "recording", UNREADABLE, str(error)))
            continue
        if found and found.reasons:
            findings.append(Finding(info.name, "recording", f"quality_{found.verdict}", found.sentence))
        if found is None or found.verdict != "bad":
            trials.append(trial)
            starts_ns.append(start_ns(recording))
            findings += late(info.name, recording.tables["axis"])
            stated.add(recording.metadata.get("calibration", {}).get("surface_mm", ""))
    pairs = list(zip(trials, starts_ns, strict=True))
    first_ns = min((start for trial, start in pairs if trial.force_s.size), default=0)
    on_one_clock = (shifted(trial, start - first_ns) for trial, start in pairs)
    surface = float(stated.pop()) if len(stated) == 1 and "" not in stated else None
    return TrialSet(session.folder.name, tuple(on_one_clock), surface, tuple(findings))


def trials_in_csv(folder: Path, columns: tuple[str, ...] = ()) -> TrialSet:
    """Trials of a CSV folder in the senses of its ``mapping.toml``; what cannot be read is left out and said."""
    names = column_names(columns)
    mapping = load(DataMapping, folder / MAPPING_FILE) if (folder / MAPPING_FILE).exists() else None
    trials, findings = [], []
    for path in sorted(path for path in folder.glob("trial_*") if path.is_dir()):
        read, said = _read_trial(path, names)
        findings += said
        if "force" in read and "axis" in read:
            findings += late(path.name, read["axis"]) if "arrival_ns" in read["axis"] else []
            trials.append(_csv_trial(path, read, mapping))
    surface = None if mapping is None or mapping.stated.surface_mm is None else mapping.surface_of(mapping.stated)
    return TrialSet(folder.name, tuple(trials), surface, tuple(findings))


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
            findings.append(Finding(path.name, stream, UNREADABLE, str(error)))
    return read, findings


def _csv_trial(path: Path, read: dict[str, dict[str, Array]], mapping: DataMapping | None) -> Trial:
    force, axis, marker = read["force"], _in_time_rows(read["axis"]), _tip_rows(read.get("marker"))
    facts = RecordingFacts() if mapping is None else mapping.facts_of(path.name)
    force_sense, position_sense = (1, 1) if mapping is None else (mapping.sense("force"), mapping.sense("position"))
    temperature_C = facts.temperature_C
    return Trial(
        path.name,
        force["time_s"],
        force_sense * force["force_N"],
        axis["time_s"],
        position_sense * axis["position_mm"],
        None if marker is None else marker["time_s"],
        None if marker is None else np.stack([marker[field] for field in ("x_mm", "y_mm", "z_mm")], axis=1),
        None if temperature_C is None else np.full(force["time_s"].shape, temperature_C),
        facts.speed_mm_s or math.nan,
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
