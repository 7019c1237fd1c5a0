"""Commands about what was recorded: verify, repair, import, export."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from itertools import chain, count
from pathlib import Path
from typing import Annotated, TypeVar

import typer

from api.cli.asking import Person
from api.cli.computing import compute
from api.cli.options import JsonOption, MappingOption, OnlyOption, PlaceArgument, YesOption
from api.cli.output import show, write_json
from api.operations import records
from rig.config.table import TomlTable
from rig.errors import UsageError
from rig.intake.mapping import MAPPING_FILE
from rig.intake.proposal import DOUBT, OPEN, Proposal, propose
from rig.intake.questions import Question
from rig.intake.rows import FIELDS
from rig.recording.export import FORMATS, Format
from rig.recording.files import refuse_unwritable, write_text
from rig.recording.remote import address_of
from rig.recording.sessions import TrialInfo
from rig.results.came_in import NAME
from rig.results.came_in_tables import short_parts
from rig.results.recorded import ExportResult, ImportResult, RecordingResult
from rig.results.tables import UNKNOWN, TextTable, cells
from rig.trials.opening import Opening, is_recorded

Remarked = TypeVar("Remarked", ImportResult, ExportResult)
# A line of a terminal takes as many.
MOST_NAMES = 3
MADE = {"speed (mm/s)": "speed_mm_s:g", "depth (mm)": "depth_mm:g", "peak (N)": "peak_force_N:.2f"}


def verify(
    path: Annotated[Path, typer.Argument(help="Session folder, or one recording (.mcap); a path or s3://...")],
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
    place: PlaceArgument,
    out: Annotated[Path, typer.Option("--out", help="New folder for the session.")],
    mapping: MappingOption = None,
    yes: YesOption = False,
    json_file: JsonOption = None,
) -> None:
    """Makes a session from measured files of any laboratory; writes nothing if anything in them is wrong.

    Without a mapping one is proposed, saved as OUT.toml and used; what it doubts is said, and only what the data cannot
    say is asked. CSV and other text, xls, xlsx, MAT, HDF5, Parquet and MCAP. A mapping names files, header and unit
    rows, columns with units and signs, and what a recording is; examples/mappings holds one for each of nine sources.
    A session, or one recording of it, is copied as it is.

    Example: rig import measured/ --mapping examples/mappings/asmi.toml --out sessions/measured
    """
    now = datetime.now().astimezone()
    chosen = mapping_for(place, mapping, out, yes)
    result = compute("import", lambda operation: records.import_data(operation, place, chosen, out, now))
    show(_trial_table(result.trials), *result.remarks)
    if result.came_in:
        show(*short_parts(result.came_in), f"{NAME}.svg, .csv and .json are in {out}")
    write_json(json_file, _with_doubts(result, chosen))


def _with_doubts(result: Remarked, mapping: Path | None) -> Remarked:
    """The result with what is still doubtful in the mapping that was proposed, as the terminal shows it."""
    doubts: list[str] = _doubts(mapping.read_text(errors="replace")) if mapping else []
    return result.model_copy(update={"remarks": (*doubts, *result.remarks)})


def _doubts(mapping: str) -> list[str]:
    return [line.removeprefix(DOUBT) for line in mapping.splitlines() if line.startswith(DOUBT)]


def mapping_for(place: Path, mapping: Path | None, out: Path, yes: bool) -> Path | None:
    """The mapping given; else None of what says itself what it holds, and of the rest one proposed, as OUT.toml."""
    if mapping or address_of(place) or is_recorded(place) or (place / MAPPING_FILE).is_file():
        return mapping
    return _proposed(place, out.with_name(f"{out.name}.toml"), yes)


def _proposed(folder: Path, file: Path, yes: bool) -> Path:
    """The mapping proposed for ``folder`` with answers, saved as ``file`` or beside it where that is another's."""
    head = f"# proposed for {folder.resolve()}\n"
    names = chain([file], (file.with_stem(f"{file.stem}-{number}") for number in count(2)))
    texts = ((name, name.read_text(errors="replace") if name.exists() else "") for name in names)
    file, before = next((name, text) for name, text in texts if not text or text.startswith(head))
    if OPEN in before:
        raise UsageError(f"{file}: was proposed before; answer what is open in it, then --mapping {file}, or remove it")
    if before:
        show(f"{file} was proposed for it before and is used; remove it for a new proposal", *_doubts(before))
        return file
    refuse_unwritable(file)
    found = propose(folder)
    file.parent.mkdir(parents=True, exist_ok=True)
    write_text(file, head + found.text)
    show(_mapping_table(found), *found.doubts)
    write_text(file, head + found.answered([_answer(question, found, file, yes) for question in found.questions]).text)
    return file


def _answer(question: Question, found: Proposal, file: Path, yes: bool) -> str:
    """The usual answer, or what a person says; raises UsageError with the lines of the mapping where nobody does."""
    lines = " and ".join(f"the line {each.line}" for each in found.questions)
    option = f"{lines} in {file}, then --mapping {file}"
    if question.usual and yes:
        show(f"nothing says it, so --yes takes {question.line}")
        return question.usual
    if yes:
        raise UsageError(f"{question.text}: no answer is clearly the best, so --yes takes none; give {option}")
    said = Person().answer(question.text, option)
    try:
        question.value(said)
    except UsageError as error:
        show(str(error))
        return _answer(question, found, file, yes)
    return said


def _mapping_table(found: Proposal) -> TextTable:
    """What every kind of file was understood to hold."""
    rows = [
        [_names(table["files"]), quantity, *_understood(quantity, column)]
        for table in found.tree["tables"]
        for quantity, column in {"time": table["time"], **table["columns"]}.items()
    ]
    return TextTable("", ["files", "quantity", "column", "unit", "positive"], rows)


def _names(files: str | Sequence[str]) -> str:
    """As a person writes them, the first of many."""
    named = [files] if isinstance(files, str) else list(files)
    more = len(named) - MOST_NAMES
    return ", ".join(named[:MOST_NAMES]) + (f" and {more} more" if more > 0 else "")


def _understood(quantity: str, column: TomlTable) -> Iterator[str]:
    """Column, unit and sense of a quantity; a time has no sense."""
    yield from (str(column.get(key, UNKNOWN)) for key in ("column", "unit"))
    yield "" if quantity == "time" else str(column.get("positive", UNKNOWN))


def _trial_table(trials: Iterable[TrialInfo]) -> TextTable:
    rows = [[it.name, *cells(it, MADE), *(str(it.samples.get(name, 0)) for name in FIELDS)] for it in trials]
    return TextTable("", ["trial", *MADE, *FIELDS], rows)


def export_(
    place: PlaceArgument,
    out: Annotated[Path, typer.Option("--out", help="Folder to write to; made where it is missing.")],
    formats: Annotated[
        list[str] | None, typer.Option("--format", help="csv, parquet, hdf5 or mat; may be repeated; default all.")
    ] = None,
    mapping: MappingOption = None,
    only: OnlyOption = "",
    yes: YesOption = False,
    json_file: JsonOption = None,
) -> None:
    """Writes a session as CSV and Parquet folders, HDF5 and MAT files, with units.

    OUT gets csv/ (which `rig import` reads again), parquet/, session.h5 and session.mat.

    Example: rig export sessions/first --out exported --format hdf5
    """
    chosen = _formats(formats or list(FORMATS))
    opening = Opening(mapping_for(place, mapping, out, yes), only)
    result = compute("export", lambda operation: records.export_session(operation, place, out, chosen, opening))
    write_json(json_file, _with_doubts(result, opening.mapping))


def _formats(asked: list[str]) -> list[Format]:
    names = [name.strip().lower() for item in asked for name in item.split(",")]
    for name in names:
        if name not in FORMATS:
            raise UsageError(f"--format {name}: unknown; there are {', '.join(FORMATS)}")
    return [format for format in FORMATS if format in names]
