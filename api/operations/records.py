"""What is done with recordings: verify, repair, import, export."""

import contextlib
import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path

from api.operations.at_hand import at_hand
from api.operations.opening import opened
from controller.operation import Operation
from rig.errors import CheckFailed, DataError
from rig.intake.rows import FIELDS
from rig.progress import portion
from rig.recording.export import Format, export
from rig.recording.files import make_folder
from rig.recording.reader import Recording, read_recording
from rig.recording.sessions import TrialInfo, open_session
from rig.recording.verify import repair as repaired
from rig.recording.verify import verdict_of
from rig.results.recorded import ExportResult, ImportResult, RepairResult, VerifiedTrial, VerifyResult
from rig.trials.opening import AS_IT_IS, Opening, import_place
from rig.trials.quality import quality_of

# Of the time that an import takes, each recording being looked at while it is in memory; the rest is contact.
IMPORTING = 0.8
SUFFIXES: Mapping[Format, str] = {"csv": "csv", "parquet": "parquet", "hdf5": "session.h5", "mat": "session.mat"}


def verify(operation: Operation, path: Path) -> VerifyResult:
    """Reads every byte of a session or of one recording; what is no recording at all is damaged, and hides no other."""
    with at_hand(path, operation.step) as near:
        return _verified_all(operation, near)


def _verified_all(operation: Operation, path: Path) -> VerifyResult:
    if path.is_file():
        trial = TrialInfo(path.stem, path.name, math.nan, math.nan, "")
        return _result((), {path.stem: _verified(read_recording(path), trial)})
    session = open_session(path)
    found: dict[str, VerifiedTrial] = {}
    for number, trial in enumerate(session.trials):
        file = session.path(trial.name)
        operation.step(file.name, number / len(session.trials))
        found[file.stem] = _read(file, trial)
    operation.step("the session's list of hashes", 1.0)
    return _result((*session.remarks, *session.mismatches), found)


def _result(remarks: tuple[str, ...], found: Mapping[str, VerifiedTrial]) -> VerifyResult:
    whole = not remarks and all(recording.ok for recording in found.values())
    return VerifyResult(ok=whole, remarks=remarks, recordings=found)


def refuse_incomplete(found: VerifyResult, path: Path) -> None:
    """Raises CheckFailed where anything is not whole."""
    if found.ok:
        return
    bad = [name for name, recording in found.recordings.items() if not recording.ok]
    raise CheckFailed(
        f"{path}: {len(bad)} of {len(found.recordings)} recordings are not complete"
        + (f" ({', '.join(bad)})" if bad else "")
        + (f"; {found.remarks[0]}" if found.remarks else "")
        + "; what is listed above is known, everything else is good"
    )


def _read(file: Path, trial: TrialInfo) -> VerifiedTrial:
    try:
        return _verified(read_recording(file), trial)
    except DataError as error:
        why = str(error)
        return VerifiedTrial(state="damaged", ok=False, sentence=why, damage=(why,), streams={})


def _verified(recording: Recording, trial: TrialInfo) -> VerifiedTrial:
    """With the quality of a trial that was made with bounds and can be judged."""
    found, quality = VerifiedTrial.model_validate(verdict_of(recording)), None
    with contextlib.suppress(DataError):
        quality = quality_of(recording, trial)
    if quality is None:
        return found
    return found.model_copy(
        update={"quality": quality.verdict, "reasons": quality.reasons, "measured": dict(quality.measured)}
    )


def repair(operation: Operation, recording: Path, out: Path) -> RepairResult:
    """Saves every good sample of ``recording`` as the new recording ``out``."""
    return RepairResult.model_validate(repaired(recording, out, operation.step))


def import_data(operation: Operation, place: Path, mapping: Path | None, out: Path, now: datetime) -> ImportResult:
    """Makes the session ``out`` of what ``place`` holds, by ``mapping``; writes nothing if anything in it is wrong.

    What came in is looked at then, and kept in the session as table, JSON and picture.
    """
    from rig.report.came_in import look_at, save_came_in  # noqa: PLC0415 - only an import needs them
    from rig.results.incoming import Looked  # noqa: PLC0415

    looked = Looked()
    session = import_place(place, mapping, out, now, portion(operation.step, 0.0, IMPORTING), looked.add)
    # Not cancelled any more: the session is there.
    finishing = portion(lambda message, share: operation.advance(share, message), IMPORTING, 1.0)
    found = look_at(session, finishing, looked)
    save_came_in(session, found)
    return ImportResult(
        session=str(out),
        recordings=len(session.trials),
        samples={name: sum(trial.samples.get(name, 0) for trial in session.trials) for name in FIELDS},
        remarks=session.remarks,
        trials=session.trials,
        came_in=found.result,
    )


def export_session(
    operation: Operation, place: Path, out: Path, formats: Sequence[Format], opening: Opening = AS_IT_IS
) -> ExportResult:
    """Writes what ``place`` holds to ``out`` in each format."""
    with opened(place, operation.step, opening) as session:
        make_folder(out)
        written: dict[str, str] = {}
        for number, name in enumerate(formats):
            operation.step(name, number / len(formats))
            written[name] = str(export(session, name, out / SUFFIXES[name]))
            operation.say(f"{name:8s}{written[name]}")
    return ExportResult(session=str(place), written=written, remarks=session.remarks)
