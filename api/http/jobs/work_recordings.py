"""Jobs on recordings: verify, repair, import, export, report."""

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from api.http.jobs.params import DataPlace, ExportParams, ImportParams, ProposeParams, RepairParams, VerifyParams
from api.http.jobs.proposal import ColumnUnderstood, IntakeQuestion, ProposalResult
from api.http.jobs.worker import Desk
from api.operations import records
from api.operations import report as page
from controller.operation import Operation
from rig.config.table import TomlTable
from rig.errors import UsageError
from rig.intake.mapping import MAPPING_FILE
from rig.intake.proposal import Proposal, propose
from rig.recording.export import FORMATS
from rig.recording.files import make_folder
from rig.results.recorded import ExportResult, ImportResult, RepairResult, ReportResult, VerifyResult
from rig.trials.opening import Opening, is_recorded


def verify(operation: Operation, asked: VerifyParams, desk: Desk) -> VerifyResult:
    """Of the session, or of one recording."""
    places = desk.places
    whole = places.session(asked.session)
    return records.verify(operation, places.recording(asked.session, asked.recording) if asked.recording else whole)


def repair(operation: Operation, asked: RepairParams, desk: Desk) -> RepairResult:
    """Into the job's own folder: the session stays as it was recorded."""
    recording = desk.places.recording(asked.session, asked.recording)
    make_folder(desk.places.files)
    return records.repair(operation, recording, desk.places.files / recording.name)


def report(operation: Operation, asked: DataPlace, desk: Desk) -> ReportResult:
    """Into the session; of an upload into the job's own folder."""
    place = desk.places.place(asked.session, asked.upload)
    return page.report(operation, place, out_of(asked, desk, "report.html"), opening(asked, desk))


def export(operation: Operation, asked: ExportParams, desk: Desk) -> ExportResult:
    """Into the job's own folder."""
    place = desk.places.place(asked.session, asked.upload)
    formats = [each for each in FORMATS if each in asked.formats] or list(FORMATS)
    return records.export_session(operation, place, desk.places.files, formats, opening(asked, desk))


def opening(asked: DataPlace, desk: Desk) -> Opening:
    """How the place is read."""
    return Opening(desk.places.text(MAPPING_FILE, asked.mapping), asked.only)


def out_of(asked: DataPlace, desk: Desk, name: str) -> Path | None:
    """Results of a session stay in it; of files of others they are the job's."""
    if asked.session is not None:
        return None
    make_folder(desk.places.files)
    return desk.places.files / name


def propose_mapping(operation: Operation, asked: ProposeParams, desk: Desk) -> ProposalResult:
    """What an upload seems to hold."""
    place = desk.places.upload(asked.upload)
    operation.step("looking at every file", 0.0)
    found = propose(place)
    columns = tuple(
        _understood(table, quantity, column)
        for table in found.tree["tables"]
        for quantity, column in {"time": table["time"], **table["columns"]}.items()
    )
    questions = tuple(IntakeQuestion(text=each.text, line=each.line, usual=each.usual) for each in found.questions)
    return ProposalResult(mapping=found.text, columns=columns, doubts=found.doubts, questions=questions)


def _understood(table: TomlTable, quantity: str, column: TomlTable) -> ColumnUnderstood:
    names: str | Sequence[str] = table["files"]
    files = names if isinstance(names, str) else ", ".join(names)
    known = {key: str(column.get(key, "")) for key in ("column", "unit", "positive")}
    return ColumnUnderstood(files=files, quantity=quantity, **known)


def import_upload(operation: Operation, asked: ImportParams, desk: Desk) -> ImportResult:
    """By the mapping given, else that of the files, else the one proposed with its questions answered."""
    place, out = desk.places.upload(asked.upload), desk.places.new_session(asked.session)
    text = asked.mapping
    if not text and not is_recorded(place) and not (place / MAPPING_FILE).is_file():
        operation.step("looking at every file", 0.0)
        text = _answered(propose(place), asked).text
    mapping = desk.places.text(MAPPING_FILE, text)
    return records.import_data(operation, place, mapping, out, datetime.now().astimezone())


def _answered(found: Proposal, asked: ImportParams) -> Proposal:
    """Raises UsageError with the question where one stays open."""
    answers = list(asked.answers)
    for question in found.questions[len(answers) :]:
        if not (asked.usual and question.usual):
            raise UsageError(f"{question.text}: answer it, or give a mapping with the line {question.line}")
        answers.append(question.usual)
    if len(answers) > len(found.questions):
        raise UsageError(f"{len(answers)} answers to {len(found.questions)} questions: ask for the proposal again")
    return found.answered(answers)
