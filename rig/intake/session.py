"""A session from a folder and its mapping: everything is checked while it is written, and nothing stays if it fails.

Streams keep their own rates; nothing is resampled. Force is stored positive in compression and position positive into
the tissue, as the mapping says the files have them.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path

from rig.errors import DataError
from rig.intake.clocks import Part, on_one_clock
from rig.intake.folder import FoundTable, file_name, labels_of, listed, natural, tables_in, unnamed_in
from rig.intake.mapping import RESTART, DataMapping
from rig.intake.stating import StatedFacts, stated_of
from rig.intake.writing import OpenRecording, Written
from rig.progress import Progress, silent
from rig.recording.files import whole_folder
from rig.recording.reader import Recording
from rig.recording.sessions import Session, SessionInfo, TrialInfo, open_session, plain, write_session
from rig.version import SOFTWARE

Seeing = Callable[[TrialInfo, Recording], None]


def import_folder(
    folder: Path, mapping: DataMapping, out: Path, now: datetime, tell: Progress = silent, see: Seeing | None = None
) -> Session:
    """Makes the session ``out`` of what ``mapping`` names in ``folder``; ``now`` is noted as time of import.

    ``see`` is shown each recording as its file holds it, while it is in memory, but those too long to be.
    Raises DataError or UsageError, naming file and place, and then has written nothing.
    """
    listed = _info(folder, mapping, now)
    with whole_folder(out) as scratch:
        found = [_shown(item, see) for item in _recordings(folder, mapping, scratch, listed, tell)]
        _check_stated(folder, mapping, found)
        written = _in_order_of_time(_distinct(found))
        for copy in {item.info.file for item in found} - {item.info.file for item in written}:
            (scratch / copy).unlink()
        trials = tuple(item.info.sealed(scratch) for item in written)
        write_session(scratch, replace(listed, trials=trials))
    session = open_session(out)
    return replace(session, remarks=(*session.remarks, *_remarks(folder, mapping, written), *_copies(found)))


def _shown(item: Written, see: Seeing | None) -> Written:
    """Without its rows, which ``see`` has seen."""
    if see is not None and item.recording is not None:
        see(item.info, item.recording)
    return replace(item, recording=None)


def _recordings(
    folder: Path, mapping: DataMapping, scratch: Path, listed: SessionInfo, tell: Progress
) -> Iterator[Written]:
    """Each recording, written as soon as the last table that holds it is read."""
    names = dict[str, FoundTable]()
    groups = grouped(folder, mapping)
    parts = ((number, part) for number, tables in enumerate(groups) for part in on_one_clock(tables))
    for number, part in parts:
        now: OpenRecording | None = None
        rows, expected = 0, max(1, sum(table.sheet.rows for table in part.tables))
        try:
            for table, piece in part.pieces():
                about = labels_of(table, piece.labels, mapping)
                name = file_name(about["recording"] + part.suffix)
                if now is not None and now.info.name != name:
                    yield now.finish()
                    now = None
                if now is None:
                    _check_new(name, names, table)
                    now = _opened(scratch, name, len(names) - 1, table, about, mapping, listed, part)
                now.add(piece, table)
                rows += piece.at_ns.size + piece.dropped
                share = min(1.0, rows / expected)
                tell(f"{name}: {sum(now.info.samples.values())} samples", (number + share) / len(groups))
            if now is not None:
                yield now.finish()
        finally:
            if now is not None:
                now.close()


def grouped(folder: Path, mapping: DataMapping) -> list[list[FoundTable]]:
    """Tables that are one recording, together; a table whose labels name recordings is one by itself."""
    groups: dict[object, list[FoundTable]] = {}
    for number, table in enumerate(tables_in(folder, mapping)):
        labels = dict.fromkeys(table.form.row_labels, "")
        name = file_name(labels_of(table, labels, mapping)["recording"])
        groups.setdefault(number if _parted(table, mapping) else name, []).append(table)
    return list(groups.values())


def _parted(table: FoundTable, mapping: DataMapping) -> bool:
    """Whether rows of the table are of several recordings, by its labels."""
    named = mapping.recording or "{label}"
    return table.form.disorder == RESTART or any(f"{{{label}}}" in named for label in table.form.label_columns)


def _check_new(name: str, names: dict[str, FoundTable], table: FoundTable) -> None:
    if name not in names:
        names[name] = table
        return
    before, apart = names[name], "name what tells the two apart in `recording`"
    if before is table:
        apart += ", or sort the file so that its rows stand together"
    elif before.form.columns.keys().isdisjoint(table.form.columns):
        split = "files of its own (as 1_force.csv and 1_position.csv), or force and position in one table"
        apart = f"two tables that each hold several recordings are not joined: save each recording in {split}"
    there = f" in {before.sheet.where}" if before is not table else ""
    raise DataError(f"{table.sheet.where}: recording {name} was there before{there}; {apart}")


def _opened(
    scratch: Path, name: str, index: int, table: FoundTable, about: Mapping[str, str], mapping: DataMapping,
    listed: SessionInfo, part: Part,
) -> OpenRecording:  # fmt: skip
    stated = mapping.facts_of(name if name in mapping.recordings else about["recording"])
    facts = stated_of(stated, about, table.sheet.where)
    info = TrialInfo(name, f"{name}.mcap", facts.speed_mm_s, facts.depth_mm, facts.outcome)
    metadata = _metadata(info, index, table, about, facts, mapping, listed)
    return OpenRecording(scratch, info, metadata | part.metadata, part.remarks(name))


def _distinct(written: Sequence[Written]) -> list[Written]:
    """Without copies of a recording under another name, which would count twice in every fit."""
    return list({item.digest: item for item in written[::-1]}.values())[::-1]


def _copies(written: Sequence[Written]) -> Iterator[str]:
    """Which recordings are copies of which, in one sentence."""
    first = {item.digest: item.info.name for item in written[::-1]}
    pairs = [(item.info.name, first[item.digest]) for item in written if item.info.name != first[item.digest]]
    if len(pairs) == 1:
        yield f"{pairs[0][0]} holds the same data as {pairs[0][1]} and was left out"
    elif pairs:
        shown = listed([f"{copy} as {original}" for copy, original in pairs])
        yield f"{len(pairs)} recordings hold the same data as others and were left out: {shown}"


def _check_stated(folder: Path, mapping: DataMapping, written: Sequence[Written]) -> None:
    names = {item.info.name for item in written}
    for name in mapping.recordings:
        if file_name(name) not in names:
            raise DataError(f"{folder}: the mapping states facts of {name}, and there is no such recording")


def _in_order_of_time(written: list[Written]) -> list[Written]:
    """By time where one clock runs through all of them, else in the order of their files."""
    by_time = sorted(written, key=lambda item: item.span_ns)
    apart = all(before.span_ns[1] < after.span_ns[0] for before, after in pairwise(by_time))
    return by_time if apart else sorted(written, key=lambda item: natural(item.info.name))


def _remarks(folder: Path, mapping: DataMapping, written: Sequence[Written]) -> Iterator[str]:
    for item in written:
        yield from item.remarks
    overlaps = [pair for pair in pairwise(written) if pair[1].span_ns[0] <= pair[0].span_ns[1]]
    if overlaps:
        (before, after) = overlaps[0]
        yield (
            f"{after.info.name} starts at {after.span_ns[0] * 1e-9:g} s, before {before.info.name} ends at "
            f"{before.span_ns[1] * 1e-9:g} s: each recording counts its own time, so nothing is said of drift"
        )
    left = unnamed_in(folder, mapping)
    if left:
        yield f"{len(left)} files are of no pattern and were left out: {listed(left)}"


def _info(folder: Path, mapping: DataMapping, now: datetime) -> SessionInfo:
    facts = mapping.session
    given = facts.model_dump(exclude={"id", "subject", "notes"})
    notes = facts.notes if isinstance(facts.notes, dict) else {"notes": facts.notes}
    subject = facts.subject if isinstance(facts.subject, dict) else {"id": facts.subject}
    stated = {name: value for name, value in given.items() if value not in ("", None)}
    return SessionInfo(
        id=facts.id or facts.name or folder.resolve().name, kind="import", created=now.isoformat(), software=SOFTWARE,
        subject={str(key): plain(value) for key, value in subject.items()},
        notes={str(key): plain(value) for key, value in (stated | notes).items()},
        axis_files=str(folder.resolve()) if mapping.axis else "",
    )  # fmt: skip


def _metadata(
    info: TrialInfo, index: int, table: FoundTable, about: Mapping[str, str], facts: StatedFacts,
    mapping: DataMapping, listed: SessionInfo,
) -> dict[str, dict[str, str]]:  # fmt: skip
    calibration = {"force_axis": "fz", "compression": "positive"}
    if not math.isnan(facts.surface_mm):
        calibration["surface_mm"] = repr(mapping.sense("position") * facts.surface_mm)
    return {
        "recording": {
            "id": f"{listed.id}/{info.name}", "session": listed.id, "trial": info.name,
            "software": listed.software, "kind": "import", "wall_start_iso": listed.created,
            **({"axis_files": listed.axis_files} if listed.axis_files else {}),
        },
        "trial": {
            "index": str(index), "speed_mm_s": repr(info.speed_mm_s), "depth_mm": repr(info.depth_mm),
            **_texts(facts.more),
        },
        "calibration": calibration,
        "subject": _texts(listed.subject),
        "notes": _texts(listed.notes),
        "labels": {**about, **({"operator": facts.operator} if facts.operator else {})},
        "source": {**table.sheet.facts, "file": table.sheet.path.name},
    }  # fmt: skip


def _texts(values: Mapping[str, object]) -> dict[str, str]:
    return {name: value if isinstance(value, str) else json.dumps(plain(value)) for name, value in values.items()}
