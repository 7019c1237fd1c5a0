"""A session from a folder and its mapping: everything is checked while it is written, and nothing stays if it fails.

Streams keep their own rates; nothing is resampled. Force is stored positive in compression and position positive into
the tissue, as the mapping says the files have them.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import pairwise
from pathlib import Path

from rig.errors import DataError
from rig.intake.folder import FoundTable, file_name, labels_of, natural, tables_in, unnamed_in
from rig.intake.mapping import DataMapping, RecordingFacts
from rig.intake.rows import pieces
from rig.intake.writing import OpenRecording, Written
from rig.progress import Progress, silent
from rig.recording.files import whole_folder
from rig.recording.sessions import Session, SessionInfo, TrialInfo, open_session, plain, write_session
from rig.version import SOFTWARE


def import_folder(folder: Path, mapping: DataMapping, out: Path, now: datetime, tell: Progress = silent) -> Session:
    """Makes the session ``out`` of what ``mapping`` names in ``folder``; ``now`` is noted as time of import.

    Raises DataError or UsageError, naming file and place, and then has written nothing.
    """
    listed = _info(folder, mapping, now)
    with whole_folder(out) as scratch:
        found = list(_recordings(folder, mapping, scratch, listed, tell))
        _check_stated(folder, mapping, found)
        written = _in_order_of_time(_distinct(found))
        for copy in {item.info.file for item in found} - {item.info.file for item in written}:
            (scratch / copy).unlink()
        trials = tuple(item.info.sealed(scratch) for item in written)
        write_session(scratch, replace(listed, trials=trials))
    session = open_session(out)
    return replace(session, remarks=(*session.remarks, *_remarks(folder, mapping, written)))


def _recordings(
    folder: Path, mapping: DataMapping, scratch: Path, listed: SessionInfo, tell: Progress
) -> Iterator[Written]:
    """Each recording, written as soon as the last table that holds it is read."""
    names = set[str]()
    groups = _grouped(folder, mapping)
    for number, tables in enumerate(groups):
        now: OpenRecording | None = None
        try:
            for table, piece in ((each, piece) for each in tables for piece in pieces(each.sheet, each.form)):
                about = labels_of(table, piece.label, mapping)
                name = file_name(about["recording"])
                if now is not None and now.info.name != name:
                    yield now.finish()
                    now = None
                if now is None:
                    _check_new(name, names, table)
                    now = _opened(scratch, name, len(names) - 1, table, about, mapping, listed)
                now.add(piece, table)
                tell(f"{name}: {sum(now.info.samples.values())} samples", number / len(groups))
            if now is not None:
                yield now.finish()
        finally:
            if now is not None:
                now.close()


def _grouped(folder: Path, mapping: DataMapping) -> list[list[FoundTable]]:
    """Tables that are one recording, together; a table with a column of labels is one by itself."""
    groups: dict[object, list[FoundTable]] = {}
    for number, table in enumerate(tables_in(folder, mapping)):
        key = number if table.form.label is not None else file_name(labels_of(table, "", mapping)["recording"])
        groups.setdefault(key, []).append(table)
    return list(groups.values())


def _check_new(name: str, names: set[str], table: FoundTable) -> None:
    if name in names:
        raise DataError(
            f"{table.sheet.where}: recording {name} was there before; name what tells the two apart in `recording`, "
            "or sort the file so that its rows stand together"
        )
    names.add(name)


def _opened(
    scratch: Path,
    name: str,
    index: int,
    table: FoundTable,
    about: Mapping[str, str],
    mapping: DataMapping,
    listed: SessionInfo,
) -> OpenRecording:
    facts = mapping.facts_of(name) if name in mapping.recordings else mapping.facts_of(about["recording"])
    info = TrialInfo(name, f"{name}.mcap", facts.speed_mm_s or math.nan, facts.depth_mm or math.nan, facts.outcome)
    metadata = _metadata(info, index, table, about, facts, mapping, listed)
    return OpenRecording(scratch, info, metadata)


def _distinct(written: Sequence[Written]) -> list[Written]:
    """Without copies of a recording under another name, which would count twice in every fit; said where it stays."""
    kept: dict[bytes, Written] = {}
    for item in written:
        first = kept.setdefault(item.digest, item)
        if first is not item:
            said = f"{item.info.name} holds the same data as {first.info.name} and was left out"
            kept[item.digest] = replace(first, remarks=(*first.remarks, said))
    return list(kept.values())


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
        yield f"{len(left)} files are of no pattern and were left out: {', '.join(left[:5])}{' ...' * (len(left) > 5)}"


def _info(folder: Path, mapping: DataMapping, now: datetime) -> SessionInfo:
    facts = mapping.session
    given = facts.model_dump(exclude={"id", "subject", "notes"})
    notes = facts.notes if isinstance(facts.notes, dict) else {"notes": facts.notes}
    subject = facts.subject if isinstance(facts.subject, dict) else {"id": facts.subject}
    stated = {name: value for name, value in given.items() if value not in ("", None)}
    return SessionInfo(
        id=facts.id or facts.name or folder.resolve().name,
        kind="import",
        created=now.isoformat(),
        software=SOFTWARE,
        subject={str(key): plain(value) for key, value in subject.items()},
        notes={str(key): plain(value) for key, value in (stated | notes).items()},
    )


def _metadata(
    info: TrialInfo, index: int, table: FoundTable, about: Mapping[str, str], facts: RecordingFacts,
    mapping: DataMapping, listed: SessionInfo,
) -> dict[str, dict[str, str]]:  # fmt: skip
    calibration = {"force_axis": "fz", "compression": "positive"}
    surface_mm = mapping.surface_of(facts)
    if surface_mm is not None:
        calibration["surface_mm"] = repr(surface_mm)
    extra = facts.model_dump(exclude={"speed_mm_s", "depth_mm", "surface_mm"}, exclude_defaults=True)
    return {
        "recording": {
            "id": f"{listed.id}/{info.name}",
            "session": listed.id,
            "trial": info.name,
            "software": listed.software,
            "kind": "import",
            "wall_start_iso": listed.created,
        },
        "trial": {
            "index": str(index), "speed_mm_s": repr(info.speed_mm_s), "depth_mm": repr(info.depth_mm), **_texts(extra)
        },
        "calibration": calibration,
        "subject": _texts(listed.subject),
        "notes": _texts(listed.notes),
        "labels": {**table.labels, **about},
        "source": {**table.sheet.facts, "file": table.sheet.path.name},
    }  # fmt: skip


def _texts(values: Mapping[str, object]) -> dict[str, str]:
    return {name: value if isinstance(value, str) else json.dumps(plain(value)) for name, value in values.items()}
