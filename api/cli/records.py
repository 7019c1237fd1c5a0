"""Commands about what was recorded: verify, repair, import, export."""

import contextlib
import math
import re
from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from api.cli.options import JsonOption
from api.cli.output import console, table, write_json
from rig.errors import CheckFailed, DataError, UsageError
from rig.recording import verify as verification
from rig.recording.export import FORMATS, Format, export
from rig.recording.files import make_folder
from rig.recording.import_format import FIELDS
from rig.recording.importing import import_session
from rig.recording.reader import read_recording
from rig.recording.sessions import TrialInfo, open_session
from rig.recording.verify import Verdict
from rig.results.recorded import ExportResult, ImportResult, RecordingResult, VerifiedTrial, VerifyResult
from rig.trials.quality import TrialQuality, quality_of

SUFFIXES: Mapping[Format, str] = {"csv": "csv", "parquet": "parquet", "hdf5": "session.h5", "mat": "session.mat"}
SessionArgument = Annotated[Path, typer.Argument(help="Session folder.")]


def verify(
    path: Annotated[Path, typer.Argument(help="Session folder, or one recording (.mcap).")],
    json_file: JsonOption = None,
) -> None:
    """Reads every byte of a recording or session and says per stream what is complete, missing, dropped or damaged.

    Exit code 1 if anything is. The quality of each trial is said too, and is no matter of completeness.

    Example: rig verify sessions/first
    """
    verdicts, remarks = _verdicts(path)
    qualities = _qualities(path, verdicts)
    console.print(_verdict_table(verdicts))
    for name, quality in qualities.items():
        said = "; ".join([f"{name}: quality {quality.verdict}", *quality.reasons])
        console.print(said, markup=False, highlight=False, soft_wrap=True)
    for sentence in [*remarks, *(verdict.sentence for verdict in verdicts if not verdict.ok)]:
        console.print(sentence, markup=False, highlight=False, soft_wrap=True)
    bad = [verdict.path.stem for verdict in verdicts if not verdict.ok]
    checked = {verdict.path.stem: _verified(verdict, qualities.get(verdict.path.stem)) for verdict in verdicts}
    write_json(json_file, VerifyResult(ok=not bad and not remarks, remarks=remarks, recordings=checked))
    if bad or remarks:
        raise CheckFailed(
            f"{path}: {len(bad)} of {len(verdicts)} recordings are not complete"
            + (f" ({', '.join(bad)})" if bad else "")
            + (f"; {remarks[0]}" if remarks else "")
            + "; what is listed above is known, everything else is good"
        )


def _verdicts(path: Path) -> tuple[list[Verdict], tuple[str, ...]]:
    if path.is_file():
        return [verification.verify(path)], ()
    session = open_session(path)
    verdicts = [_verdict(session.path(trial.name)) for trial in session.trials]
    return verdicts, (*session.remarks, *session.mismatches)


def _qualities(path: Path, verdicts: list[Verdict]) -> dict[str, TrialQuality]:
    """Of every trial that was made with bounds and can be read, by the name of its recording."""
    listed = {} if path.is_file() else {trial.file: trial for trial in open_session(path).trials}
    found = {}
    for verdict in verdicts:
        trial = listed.get(verdict.path.name, TrialInfo(verdict.path.stem, verdict.path.name, math.nan, math.nan, ""))
        with contextlib.suppress(DataError):
            found[verdict.path.stem] = quality_of(read_recording(verdict.path), trial)
    return {name: quality for name, quality in found.items() if quality is not None}


def _verified(verdict: Verdict, quality: TrialQuality | None) -> VerifiedTrial:
    found = VerifiedTrial.model_validate(verdict)
    if quality is None:
        return found
    said = {"quality": quality.verdict, "reasons": quality.reasons, "measured": quality.measured}
    return VerifiedTrial.model_validate(found.model_dump() | said)


def _verdict(path: Path) -> Verdict:
    """What is no recording at all is damaged, and hides no other."""
    try:
        return verification.verify(path)
    except DataError as error:
        return Verdict(path, "damaged", str(error), damage=(str(error),))


def _verdict_table(verdicts: list[Verdict]) -> object:
    rows = [
        [
            verdict.path.stem,
            verdict.state,
            name,
            str(stream.samples),
            "" if math.isnan(stream.rate_Hz) else f"{stream.rate_Hz:.1f}",
            ", ".join(f"{count} {fault}" for fault, count in stream.faults.items()) or "none",
        ]
        for verdict in verdicts
        for name, stream in verdict.streams.items()
        if stream.samples or stream.faults
    ]
    return table(["recording", "state", "stream", "samples", "rate Hz", "faults"], rows)


def repair(
    recording: Annotated[Path, typer.Argument(help="A recording that `rig verify` found incomplete or damaged.")],
    out: Annotated[Path, typer.Option("--out", help="New recording to write; the old one is not touched.")],
    json_file: JsonOption = None,
) -> None:
    """Saves every good sample of a cut or damaged recording as a new, valid one.

    Example: rig repair sessions/first/trial-03.mcap --out trial-03-good.mcap
    """
    verdict = verification.repair(recording, out)
    console.print(_verdict_table([verdict]))
    console.print(verdict.sentence, markup=False, highlight=False, soft_wrap=True)
    write_json(json_file, RecordingResult.model_validate(verdict))


def import_(
    folder: Annotated[Path, typer.Argument(help="Folder with session.toml and trial_*/.")],
    out: Annotated[Path, typer.Option("--out", help="New folder for the session.")],
    columns: Annotated[
        list[str] | None,
        typer.Option("--columns", help="Other column name: [STREAM.]FIELD=HEADER; may be repeated or comma-separated."),
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Makes a session from measured CSV files; writes nothing if anything in them is wrong.

    FOLDER holds session.toml (may be empty; keys force_positive "compression" or "tension", position_positive "into"
    or "out", surface_mm, and anything under [subject] and [notes]) and folders trial_NAME with trial.toml (speed_mm_s,
    depth_mm), force.csv (time_s,force_N), axis.csv (time_s,position_mm) and, where there is one, marker.csv
    (time_s,x_mm,y_mm,z_mm). time_s runs through the whole session; each stream keeps its own rate and clock.

    Example: rig import measured/ --out sessions/measured --columns force.force_N=Fz
    """
    chosen = [column for item in columns or [] for column in re.split(r",(?=[\w.]+=)", item)]
    session = import_session(folder, out, chosen, datetime.now().astimezone())
    console.print(_trial_table(session.trials))
    for remark in session.remarks:
        console.print(remark, markup=False, highlight=False, soft_wrap=True)
    samples = {name: sum(trial.samples.get(name, 0) for trial in session.trials) for name in FIELDS}
    write_json(
        json_file,
        ImportResult(session=str(out), recordings=len(session.trials), samples=samples, remarks=session.remarks),
    )


def _trial_table(trials: Iterable[TrialInfo]) -> object:
    rows = [
        [trial.name, *(f"{value:g}" for value in (trial.speed_mm_s, trial.depth_mm)), f"{trial.peak_force_N:.2f}"]
        + [str(trial.samples.get(name, 0)) for name in FIELDS]
        for trial in trials
    ]
    return table(["trial", "mm/s", "depth mm", "peak N", *FIELDS], rows)


def export_(
    session: SessionArgument,
    out: Annotated[Path, typer.Option("--out", help="Folder to write to; made where it is missing.")],
    formats: Annotated[
        list[str] | None, typer.Option("--format", help="csv, parquet, hdf5 or mat; may be repeated; default all.")
    ] = None,
    json_file: JsonOption = None,
) -> None:
    """Writes a session as CSV and Parquet folders, HDF5 and MAT files, with units.

    OUT gets csv/ (which `rig import` reads again), parquet/, session.h5 and session.mat.

    Example: rig export sessions/first --out exported --format hdf5
    """
    chosen = _formats(formats or list(FORMATS))
    opened = open_session(session)
    written: dict[str, str] = {}
    make_folder(out)
    for format in chosen:
        written[format] = str(export(opened, format, out / SUFFIXES[format]))
        console.print(f"{format:8s}{written[format]}", highlight=False, soft_wrap=True)
    write_json(json_file, ExportResult(session=str(session), written=written))


def _formats(asked: list[str]) -> list[Format]:
    names = [name.strip().lower() for item in asked for name in item.split(",")]
    for name in names:
        if name not in FORMATS:
            raise UsageError(f"--format {name}: unknown; there are {', '.join(FORMATS)}")
    return [format for format in FORMATS if format in names]
