"""A session from measured CSV files: ``session.toml`` and, per trial, ``trial.toml`` and one CSV file a stream.

Each row becomes one sample with capture and arrival at its ``time_s``; streams keep their own rates and clocks, nothing
is resampled or aligned. Force is stored positive in compression and position positive into the tissue, turned round
where ``session.toml`` says that the files have it the other way. Everything is read and checked before the first byte
is written.
"""

import hashlib
import json
import math
import signal
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from datetime import datetime
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.channels import AXIS, FORCE, MARKER, Stream
from rig.config.table import load
from rig.errors import DataError
from rig.progress import Progress, silent
from rig.recording.csv_columns import TIME, TOOL, read_columns
from rig.recording.files import whole_folder
from rig.recording.import_format import EXPORTED, FIELDS, OPTIONAL, SessionTable, TrialTable, column_names
from rig.recording.mcap_file import RecordingWriter
from rig.recording.sessions import Session, SessionInfo, TrialInfo, open_session, plain, write_session
from rig.version import SOFTWARE

STREAMS = {"force": FORCE, "axis": AXIS, "marker": MARKER}
ROWS_PER_CHUNK = 1000
PARALLEL_ROWS = 1_000_000  # 4 s of writing; a process that helps takes one or two to begin


@dataclass(frozen=True)
class TrialFiles:
    """One trial as its files have it: columns by stream and field, in the units and senses of the files."""

    name: str
    table: TrialTable
    streams: dict[str, dict[str, NDArray[np.float64]]]


def import_session(folder: Path, out: Path, columns: Iterable[str], now: datetime, tell: Progress = silent) -> Session:
    """Makes the session ``out`` from the CSV files in ``folder``.

    ``columns`` are ``[STREAM.]FIELD=HEADER`` for files with other column names; ``now`` is noted as time of import.
    Raises DataError or UsageError, naming file and place, and then has written nothing.
    """
    if not folder.is_dir():
        raise DataError(f"{folder}: no such folder; give the folder that holds session.toml and trial_*/")
    names = column_names(columns)
    if not (folder / "session.toml").exists():
        raise DataError(f"{folder}: no session.toml in it; examples/measured shows what an import folder holds")
    session = load(SessionTable, folder / "session.toml")
    trials = read_files(folder, names, tell)
    info = _info(folder, session, trials, now)
    with whole_folder(out) as scratch:
        _write_all(scratch, trials, session, info, tell)
        write_session(scratch, replace(info, trials=tuple(trial.sealed(scratch) for trial in info.trials)))
    written = open_session(out)
    return replace(written, remarks=(*written.remarks, *_overlaps(trials)))


def read_files(folder: Path, names: Mapping[str, Mapping[str, str]], tell: Progress = silent) -> list[TrialFiles]:
    """All trials, in order of time; raises DataError for the first thing wrong in any of them."""
    found = sorted(path for path in folder.glob("trial_*") if path.is_dir())
    if not found:
        raise DataError(f"{folder}: no trial in it; each trial is a folder trial_NAME with force.csv and axis.csv")
    trials = []
    for number, path in enumerate(found):
        tell(f"reading {path.name}", number / len(found) / 2)
        trials.append(_read_files(path, names))
    _check_distinct(folder, trials)
    return sorted(trials, key=lambda trial: float(trial.streams["force"][TIME][0]))


def _read_files(path: Path, names: Mapping[str, Mapping[str, str]]) -> TrialFiles:
    table = load(TrialTable, path / "trial.toml")
    streams = {
        stream: read_columns(path / f"{stream}.csv", names[stream], stream == "marker", EXPORTED[stream])
        for stream in FIELDS
        if stream not in OPTIONAL or (path / f"{stream}.csv").exists()
    }
    return TrialFiles(path.name, table, streams)


def _check_distinct(folder: Path, trials: Iterable[TrialFiles]) -> None:
    """No trial twice: neither under two spellings of its number, nor as a copy of its data."""
    numbers: dict[str, str] = {}
    contents: dict[str, str] = {}
    for trial in trials:
        number = trial.name.removeprefix("trial_").lstrip("0") or "0"
        content = hashlib.sha256(b"".join(value.tobytes() for value in trial.streams["force"].values())).hexdigest()
        for key, known, what in ((number, numbers, "number"), (content, contents, "data in force.csv")):
            if key in known:
                raise DataError(f"{folder}: {known[key]} and {trial.name} have the same {what}; remove the duplicate")
            known[key] = trial.name


def _overlaps(trials: Iterable[TrialFiles]) -> list[str]:
    """Sentences for trials that start before the one before them has ended."""
    spans = [(trial.name, *trial.streams["force"][TIME][[0, -1]].tolist()) for trial in trials]
    return [
        f"{name} starts at {start:g} s, before {before} ends at {end:g} s: time_s should run through the whole session"
        for (before, _, end), (name, start, _) in pairwise(spans)
        if start < end
    ]


def _info(folder: Path, session: SessionTable, trials: Iterable[TrialFiles], now: datetime) -> SessionInfo:
    facts = session.model_dump(exclude={"id", "subject", "notes", "force_positive", "position_positive"})
    given = {name: value for name, value in facts.items() if value not in ("", None)}
    notes = session.notes if isinstance(session.notes, dict) else {"notes": session.notes}
    subject = session.subject if isinstance(session.subject, dict) else {"id": session.subject}
    return SessionInfo(
        id=session.id or session.name or folder.resolve().name,
        kind="import",
        created=now.isoformat(),
        software=SOFTWARE,
        subject={str(key): plain(value) for key, value in subject.items()},
        notes={str(key): plain(value) for key, value in (given | notes).items()},
        trials=tuple(_trial_info(trial, session.force_positive) for trial in trials),
    )


def _trial_info(trial: TrialFiles, force_sense: int) -> TrialInfo:
    return TrialInfo(
        name=trial.name,
        file=f"{trial.name}.mcap",
        speed_mm_s=trial.table.speed_mm_s,
        depth_mm=trial.table.depth_mm,
        outcome=trial.table.outcome,
        peak_force_N=float((force_sense * trial.streams["force"]["force_N"]).max()),
        samples={stream: table[TIME].size for stream, table in trial.streams.items()},
    )


def _write_all(
    folder: Path, trials: Sequence[TrialFiles], session: SessionTable, info: SessionInfo, tell: Progress
) -> None:
    jobs = [(folder / f"{trial.name}.mcap", index, trial, session, info) for index, trial in enumerate(trials)]
    if sum(sum(item.samples.values()) for item in info.trials) < PARALLEL_ROWS:
        for number, job in enumerate(jobs):
            tell(f"writing {job[0].name}", (1 + number / len(jobs)) / 2)
            _write(*job)
        return
    # The stock writer takes some 4 us a row; the trials of a long session are written side by side.
    # Ctrl-C reaches the whole group of processes; this one alone answers it.
    ignoring = (signal.SIGINT, signal.SIG_IGN)
    with ProcessPoolExecutor(mp_context=get_context("spawn"), initializer=signal.signal, initargs=ignoring) as pool:
        try:
            for number, done in enumerate([pool.submit(_write, *job) for job in jobs]):
                tell(f"writing {jobs[number][0].name}", (1 + number / len(jobs)) / 2)
                done.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _write(path: Path, index: int, trial: TrialFiles, session: SessionTable, info: SessionInfo) -> None:
    rows = {stream: _rows(stream, columns, session) for stream, columns in trial.streams.items()}
    writer = RecordingWriter(path, _metadata(index, trial, session, info))
    try:
        for number, (stream, body) in enumerate(_in_time_order(rows)):
            writer.add(stream.id, body)
            if number % ROWS_PER_CHUNK == ROWS_PER_CHUNK - 1:
                writer.flush()
        counts = {stream: table.size for stream, table in rows.items()}
        writer.finish({"outcome": trial.table.outcome, "samples": json.dumps(counts)})
    finally:
        writer.close()


def _rows(stream: str, columns: Mapping[str, NDArray[np.float64]], session: SessionTable) -> NDArray[np.void]:
    """The columns as samples of ``stream``; what was not measured is NaN, or 0 where the field is an integer."""
    time_s = columns[TIME]
    rows = np.zeros(time_s.size, STREAMS[stream].dtype)
    for name, kind in STREAMS[stream].kinds.items():
        if kind is float:
            rows[name] = math.nan
    rows["seq"] = np.arange(time_s.size)
    rows["capture_ns"] = rows["arrival_ns"] = np.round(time_s * 1e9).astype(np.int64)
    rows["valid"] = 1
    if "arrival_ns" in columns:
        rows["arrival_ns"] += (columns["arrival_ns"] - columns["capture_ns"]).astype(np.int64)
    if stream == "force":
        rows["fz_N"] = session.force_positive * columns["force_N"]
    elif stream == "axis":
        rows["position_mm"] = session.position_positive * columns["position_mm"]
        rows["velocity_mm_s"] = np.gradient(rows["position_mm"], time_s)
    else:
        rows["frame"] = rows["seq"]
        rows["tool"] = columns.get(TOOL, 0)
        for name in FIELDS["marker"][1:]:
            rows[name] = columns[name]
        rows["valid"] = np.isfinite(rows["x_mm"])
    return rows


def _in_time_order(rows: Mapping[str, NDArray[np.void]]) -> Iterable[tuple[Stream, bytes]]:
    bodies = [(STREAMS[stream], memoryview(table.tobytes()), table.itemsize) for stream, table in rows.items()]
    owner = np.concatenate([np.full(table.size, number) for number, table in enumerate(rows.values())])
    order = np.argsort(np.concatenate([table["capture_ns"] for table in rows.values()]), kind="stable")
    taken = [0] * len(bodies)
    for number in owner[order].tolist():
        stream, data, size = bodies[number]
        yield stream, bytes(data[taken[number] : taken[number] + size])
        taken[number] += size


def _metadata(index: int, trial: TrialFiles, session: SessionTable, info: SessionInfo) -> dict[str, dict[str, str]]:
    surface_mm = session.surface_mm if trial.table.surface_mm is None else trial.table.surface_mm
    calibration = {"force_axis": "fz", "compression": "positive"}
    if surface_mm is not None:
        calibration["surface_mm"] = repr(session.position_positive * surface_mm)
    devices = {stream: json.dumps({"product": f"{stream}.csv"}) for stream in trial.streams}
    extra = trial.table.model_dump(exclude={"speed_mm_s", "depth_mm", "index"}, exclude_defaults=True)
    return {
        "recording": {
            "id": f"{info.id}/{trial.name}",
            "session": info.id,
            "trial": trial.name,
            "software": info.software,
            "kind": "import",
            "wall_start_iso": info.created,
        },
        "trial": {
            "index": str(index),
            "speed_mm_s": repr(trial.table.speed_mm_s),
            "depth_mm": repr(trial.table.depth_mm),
            **_texts(extra),
        },
        "devices": devices,
        "calibration": calibration,
        "subject": _texts(info.subject),
        "notes": _texts(info.notes),
        "import": {
            "force_turned": str(session.force_positive < 0).lower(),
            "position_turned": str(session.position_positive < 0).lower(),
            "clock": "time_s of each file; streams are not aligned",
        },
    }


def _texts(values: Mapping[str, object]) -> dict[str, str]:
    return {name: value if isinstance(value, str) else json.dumps(plain(value)) for name, value in values.items()}
