"""Commands about what was recorded: verify, repair, import, export."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from api.cli.asking import Person
from api.cli.live import compute
from api.cli.options import JsonOption, SessionArgument
from api.cli.output import show, write_json
from api.operations import records
from rig.errors import UsageError
from rig.intake.proposal import Proposal, propose
from rig.intake.rows import FIELDS
from rig.recording.export import FORMATS, Format
from rig.recording.files import write_text
from rig.recording.sessions import TrialInfo
from rig.results.recorded import RecordingResult
from rig.results.tables import TextTable


def verify(
    path: Annotated[Path, typer.Argument(help="Session folder, or one recording (.mcap).")],
    json_file: JsonOption = None,
) -> None:
    """Reads every byte of a recording or session and says per stream what is complete, missing, dropped or damaged.

    Exit code 1 if anything is. The quality of each trial is said too, and is no matter of completeness.

    Example: rig verify sessions/first
    """
    result = compute("verify", lambda operation: records.verify(operation, path))
    judged = ((name, found) for name, found in result.recordings.items() if found.quality)
    show(
        recording_table(result.recordings),
        *("; ".join([f"{name}: quality {found.quality}", *found.reasons]) for name, found in judged),
        *result.remarks,
        *(found.sentence for found in result.recordings.values() if not found.ok),
    )
    write_json(json_file, result)
    records.refuse_incomplete(result, path)


def recording_table(recordings: Mapping[str, RecordingResult]) -> TextTable:
    """What each stream of each recording holds, and what is wrong with it."""
    rows = [
        [
            name,
            recording.state,
            stream,
            str(found.samples),
            "" if found.rate_Hz is None else f"{found.rate_Hz:.1f}",
            ", ".join(f"{count} {fault}" for fault, count in found.faults.items()) or "none",
        ]
        for name, recording in recordings.items()
        for stream, found in recording.streams.items()
        if found.samples or found.faults
    ]
    return TextTable("", ["recording", "state", "stream", "samples", "rate (Hz)", "faults"], rows)


def repair(
    recording: Annotated[Path, typer.Argument(help="A recording that `rig verify` found incomplete or damaged.")],
    out: Annotated[Path, typer.Option("--out", help="New recording to write; the old one is not touched.")],
    json_file: JsonOption = None,
) -> None:
    """Saves every good sample of a cut or damaged recording as a new, valid one.

    Example: rig repair sessions/first/trial-03.mcap --out trial-03-good.mcap
    """
    result = compute("repair", lambda operation: records.repair(operation, recording, out))
    show(recording_table({out.stem: result}), result.sentence)
    write_json(json_file, result)


def import_(
    folder: Annotated[Path, typer.Argument(help="Folder or file with the data, as they are.")],
    out: Annotated[Path, typer.Option("--out", help="New folder for the session.")],
    mapping: Annotated[
        Path | None, typer.Option("--mapping", help="TOML file: what the files hold; else FOLDER/mapping.toml.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Takes the usual answer to every question.")] = False,
    json_file: JsonOption = None,
) -> None:
    """Makes a session from measured files of any laboratory; writes nothing if anything in them is wrong.

    Without a mapping one is proposed, saved as OUT.toml and used; what it doubts is said, and only what the data cannot
    say is asked. CSV and other text, xls, xlsx, MAT, HDF5, Parquet and MCAP. A mapping names files, header and unit
    rows, columns with units and signs, and what a recording is; examples/mappings holds one for each of nine sources.

    Example: rig import measured/ --mapping examples/mappings/asmi.toml --out sessions/measured
    """
    now = datetime.now().astimezone()
    chosen = mapping or records.mapping_in(folder) or _proposed(folder, out.with_name(f"{out.name}.toml"), yes)
    result = compute("import", lambda operation: records.import_data(operation, folder, chosen, out, now))
    show(_trial_table(result.trials), *result.remarks)
    write_json(json_file, result)


def _proposed(folder: Path, file: Path, yes: bool) -> Path:
    """The mapping proposed for ``folder``, its questions answered, saved as ``file``; what it doubts is said."""
    if file.exists():
        raise UsageError(f"{file}: was proposed before; use it by --mapping {file}, or remove it")
    found = propose(folder)
    write_text(file, found.text)
    show(_mapping_table(found), *found.doubts)
    for question in found.questions:
        usual = str(question.usual) if yes and question.usual else ""
        question.answer(found.tree, usual or Person().answer(question.text, f"the line {question.line} in {file}"))
    write_text(file, replace(found, questions=()).text)
    return file


def _mapping_table(found: Proposal) -> TextTable:
    """What every kind of file was understood to hold."""
    rows = [
        [str(table["files"]), quantity, *(str(column.get(key, "?")) for key in ("column", "unit", "positive"))]
        for table in found.tree["tables"]
        for quantity, column in {"time": table["time"], **table["columns"]}.items()
    ]
    return TextTable("", ["files", "quantity", "column", "unit", "positive"], rows)


def _trial_table(trials: Iterable[TrialInfo]) -> TextTable:
    rows = [
        [trial.name, *(f"{value:g}" for value in (trial.speed_mm_s, trial.depth_mm)), f"{trial.peak_force_N:.2f}"]
        + [str(trial.samples.get(name, 0)) for name in FIELDS]
        for trial in trials
    ]
    return TextTable("", ["trial", "speed (mm/s)", "depth (mm)", "peak (N)", *FIELDS], rows)


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
    write_json(json_file, compute("export", lambda operation: records.export_session(operation, session, out, chosen)))


def _formats(asked: list[str]) -> list[Format]:
    names = [name.strip().lower() for item in asked for name in item.split(",")]
    for name in names:
        if name not in FORMATS:
            raise UsageError(f"--format {name}: unknown; there are {', '.join(FORMATS)}")
    return [format for format in FORMATS if format in names]
