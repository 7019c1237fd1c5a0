"""One way in: a session, one of its recordings, or files of any laboratory by their mapping, all as a session."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from rig.config.table import load, parse
from rig.errors import DataError, UsageError
from rig.intake.mapping import MAPPING_FILE, DataMapping
from rig.intake.proposal import propose
from rig.intake.session import Seeing, import_folder
from rig.progress import Progress, silent
from rig.recording.files import whole_folder
from rig.recording.reader import LONGEST_ROWS, Recording, read_recording
from rig.recording.sessions import SESSION_FILE, Session, TrialInfo, open_session, write_session
from rig.trials.chosen import chosen
from rig.trials.findings import Finding, merge
from rig.trials.quality import TrialQuality, quality_of

RECORDING = ".mcap"
# Who wrote an MCAP file stands in its first record, behind nine letters and the name of its profile.
MAGIC, WRITER, HEAD_BYTES = b"\x89MCAP0\r\n", b"tissue-rig", 64


@dataclass(frozen=True)
class Opening:
    """How a place is read: by which mapping, and which of its recordings (see `rig.trials.chosen`)."""

    mapping: Path | None = None
    only: str = ""
    part: str = ""


AS_IT_IS = Opening()


def is_recorded(place: Path) -> bool:
    """Whether the place is a session or a recording, which says by itself what it holds."""
    return is_session(place) or (place.is_file() and is_ours(place))


def is_session(place: Path) -> bool:
    """Whether the place is a session's own folder, in which its results are kept."""
    return (place / SESSION_FILE).is_file() or any(map(is_ours, place.glob(f"*{RECORDING}")))


def is_ours(file: Path) -> bool:
    """Whether it is a recording by its name, and does not begin as what another program wrote; damaged, it may be."""
    if file.suffix != RECORDING or not file.is_file():
        return False
    with file.open("rb") as opened:
        return WRITER in (head := opened.read(HEAD_BYTES)) or not head.startswith(MAGIC)


def open_place(place: Path, opening: Opening, scratch: Path, now: datetime, tell: Progress = silent) -> Session:
    """What ``place`` holds as a session; that of foreign files is made in ``scratch``, ``now`` being its date.

    Raises DataError or UsageError with what is wrong and the next step.
    """
    if opening.mapping is None and is_recorded(place):
        return chosen(open_session(place) if place.is_dir() else _alone(place), opening.only, opening.part)
    if not place.exists():
        raise DataError(f"{place}: no such file or folder; give a session, a recording, or files with their mapping")
    if (place / SESSION_FILE).is_file():
        raise UsageError(f"{place}: is a session, which says itself what it holds; leave out --mapping")
    name = place.resolve().name.partition(".")[0] if place.is_file() else place.resolve().name
    mapping, doubts = _mapping_of(place, opening.mapping)
    made = import_files(place, mapping, scratch / name, now, tell)
    found = chosen(replace(made, origin=place), opening.only, opening.part)
    return replace(found, remarks=(*doubts, *found.remarks))


def _alone(recording: Path) -> Session:
    """The recording as the one trial of its session."""
    read_recording(recording)
    around = open_session(recording.parent)
    trials = tuple(trial for trial in around.trials if trial.file == recording.name)
    return replace(around, info=replace(around.info, trials=trials), remarks=(), origin=recording)


def stated_mapping(place: Path, file: Path | None) -> DataMapping | None:
    """The mapping in ``file``, else that which lies with the files; None where there is neither."""
    beside = place / MAPPING_FILE
    return load(DataMapping, file or beside) if file is not None or beside.is_file() else None


def _mapping_of(place: Path, file: Path | None) -> tuple[DataMapping, tuple[str, ...]]:
    """The mapping named, else that which lies with the files, else the one proposed, with its doubts."""
    stated = stated_mapping(place, file)
    if stated is not None:
        return stated, ()
    found = propose(place)
    if found.questions:
        lines = "; ".join(f"{question.text}: {question.line}" for question in found.questions)
        raise UsageError(f"{place}: give a mapping that says what the files do not: {lines}")
    complete = found.answered(())
    return parse(DataMapping, complete.tree, f"the mapping proposed for {place}"), complete.doubts


def import_files(
    place: Path, mapping: DataMapping, out: Path, now: datetime, tell: Progress = silent, see: Seeing | None = None
) -> Session:
    """The session ``out`` made of foreign files, with a verdict on each recording whose motion is not as stated.

    ``see`` is shown each recording while it is in memory, but those too long to be.
    """
    facts = (mapping.stated, *mapping.recordings.values())
    if not any({"speed_mm_s", "depth_mm", "surface_mm"} & each.model_fields_set for each in facts):
        return import_folder(place, mapping, out, now, tell, see)
    verdicts: dict[str, TrialQuality | None] = {}

    def judge(info: TrialInfo, recording: Recording) -> None:
        verdicts[info.name] = quality_of(recording, info)
        if see is not None:
            see(info, recording)

    session = import_folder(place, mapping, out, now, tell, judge)
    found = [(info, verdicts.get(info.name)) for info in session.trials]
    trials = tuple(replace(info, quality=own.verdict, reasons=own.reasons) if own else info for info, own in found)
    info = replace(session.info, trials=trials)
    write_session(out, info)
    long = [trial.name for trial in trials if trial.name not in verdicts]
    unjudged = f"what is stated of {', '.join(long)} was not held against its motion: above {LONGEST_ROWS} rows"
    return replace(session, info=info, remarks=(*session.remarks, *_remarks(trials), *([unjudged] if long else [])))


def _remarks(trials: Sequence[TrialInfo]) -> list[str]:
    judged = [(info, TrialQuality(info.quality, info.reasons)) for info in trials if info.quality]
    found = [Finding(info.name, "recording", quality.verdict, quality.sentence) for info, quality in judged]
    return [finding.sentence.removeprefix("data: ") for finding in merge(found)]


def import_place(
    place: Path, mapping: Path | None, out: Path, now: datetime, tell: Progress = silent, see: Seeing | None = None
) -> Session:
    """The new session ``out`` of what ``place`` holds; a session or recording is copied as it is. Raises as above.

    ``see`` is shown each recording that is made, as by ``import_files``.
    """
    if mapping is None and is_recorded(place):
        return _copied(open_place(place, AS_IT_IS, out, now), out)
    known, doubts = _mapping_of(place, mapping)
    made = import_files(place, known, out, now, tell, see)
    return replace(made, remarks=(*doubts, *made.remarks))


def _copied(session: Session, out: Path) -> Session:
    with whole_folder(out) as scratch:
        for trial in session.trials:
            shutil.copy2(session.path(trial.name), scratch / trial.file)
        write_session(scratch, session.info)
    return open_session(out)
