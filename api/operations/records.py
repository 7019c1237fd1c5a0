"""What is done with recordings: verify, repair, import, export."""

import contextlib
import math
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path

from controller.operation import Operation
from rig.errors import DataError
from rig.recording import verify as verification
from rig.recording.export import Format, export
from rig.recording.files import make_folder
from rig.recording.import_format import FIELDS
from rig.recording.importing import import_session
from rig.recording.reader import read_recording
from rig.recording.sessions import TrialInfo, open_session
from rig.recording.verify import Verdict
from rig.results.recorded import ExportResult, ImportResult, RepairResult, VerifiedTrial, VerifyResult
from rig.trials.quality import TrialQuality, quality_of

SUFFIXES: Mapping[Format, str] = {"csv": "csv", "parquet": "parquet", "hdf5": "session.h5", "mat": "session.mat"}


def verify(operation: Operation, path: Path) -> VerifyResult:
    """Reads every byte of a session or of one recording; what is no recording at all is damaged, and hides no other."""
    if path.is_file():
        trial = TrialInfo(path.stem, path.name, math.nan, math.nan, "")
        return _result((), {path.stem: _verified(verification.verify(path), trial)})
    session = open_session(path)
    found: dict[str, VerifiedTrial] = {}
    for number, trial in enumerate(session.trials):
        file = session.path(trial.name)
        operation.step(file.name, number / len(session.trials))
        found[file.stem] = _verified(_verdict(file), trial)
    operation.step("the session's list of hashes", 1.0)
    return _result((*session.remarks, *session.mismatches), found)


def _result(remarks: tuple[str, ...], found: Mapping[str, VerifiedTrial]) -> VerifyResult:
    whole = not remarks and all(recording.ok for recording in found.values())
    return VerifyResult(ok=whole, remarks=remarks, recordings=found)


def _verdict(path: Path) -> Verdict:
    try:
        return verification.verify(path)
    except DataError as error:
        return Verdict(path, "damaged", str(error), damage=(str(error),))


def _verified(verdict: Verdict, trial: TrialInfo) -> VerifiedTrial:
    found, quality = VerifiedTrial.model_validate(verdict), _quality(verdict.path, trial)
    if quality is None:
        return found
    return found.model_copy(
        update={"quality": quality.verdict, "reasons": quality.reasons, "measured": dict(quality.measured)}
    )


def _quality(path: Path, trial: TrialInfo) -> TrialQuality | None:
    """Of a trial that was made with bounds and can be read."""
    with contextlib.suppress(DataError):
        return quality_of(read_recording(path), trial)
    return None


def repair(operation: Operation, recording: Path, out: Path) -> RepairResult:
    """Saves every good sample of ``recording`` as the new recording ``out``."""
    operation.step(recording.name, 0.0)
    return RepairResult.model_validate(verification.repair(recording, out))


def import_folder(operation: Operation, folder: Path, out: Path, columns: Sequence[str], now: datetime) -> ImportResult:
    """Makes the session ``out`` of measured CSV files; writes nothing if anything in them is wrong."""
    operation.step(folder.name, 0.0)
    session = import_session(folder, out, list(columns), now)
    return ImportResult(
        session=str(out),
        recordings=len(session.trials),
        samples={name: sum(trial.samples.get(name, 0) for trial in session.trials) for name in FIELDS},
        remarks=session.remarks,
        trials=session.trials,
    )


def export_session(operation: Operation, folder: Path, out: Path, formats: Sequence[Format]) -> ExportResult:
    """Writes the session in ``folder`` to ``out`` in each format."""
    session = open_session(folder)
    make_folder(out)
    written: dict[str, str] = {}
    for number, name in enumerate(formats):
        operation.step(name, number / len(formats))
        written[name] = str(export(session, name, out / SUFFIXES[name]))
        operation.say(f"{name:8s}{written[name]}")
    return ExportResult(session=str(folder), written=written)
