"""All of a subject's data in one archive; and their erasure, in two steps."""

import hashlib
import json
import os
import stat
import time
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from api.catalogue import people
from api.catalogue.catalogue import Catalogue, NoSuchSubject, code_of
from api.catalogue.erasing import put_aside
from api.catalogue.folder import read_folder
from api.catalogue.refresh import forget, scan
from rig.errors import UsageError
from rig.recording.files import whole_file
from rig.results.catalogue import ErasureResult, SubjectEntry, SubjectExport, SubjectHistory
from rig.trials.opening import RECORDING

# Where sessions go that the service deletes, in its own hidden folder.
TRASH = ".*/trash/*"
SUMS, ABOUT = "SHA256SUMS", "subject.json"
# Recordings are compressed already.
STORED = {RECORDING, ".parquet", ".h5", ".mat", ".png"}
# The last bytes of a recording that was closed, as the format has them.
END = b"\x89MCAP0\r\n"
# A recorder writes several times a second; one that has not for a minute has died.
LONGEST_SILENCE_S = 60.0


@dataclass
class _Packed:
    """What is in an archive, and what was left out."""

    sums: list[str] = field(default_factory=list)
    bytes: int = 0
    left_out: list[str] = field(default_factory=list)


def export_subject(catalogue: Catalogue, subject: str, out: Path, named: bool = True) -> SubjectExport:
    """Writes recordings, results and what the catalogue knows of a subject to the new zip ``out``, with all sums."""
    history = catalogue.history(subject, named)
    packed = _Packed()
    with whole_file(out) as scratch:
        os.close(os.open(scratch, os.O_CREAT | os.O_WRONLY, 0o600))
        with zipfile.ZipFile(scratch, "w", zipfile.ZIP_DEFLATED, strict_timestamps=False) as archive:
            _pack(archive, catalogue.root, history, packed)
    return SubjectExport(
        subject=history.subject.subject,
        archive=str(out),
        sessions=len(history.sessions),
        files=len(packed.sums),
        bytes=packed.bytes,
        left_out=tuple(packed.left_out),
    )


def _pack(archive: zipfile.ZipFile, root: Path, history: SubjectHistory, packed: _Packed) -> None:
    for session in history.sessions:
        for path in _files(root / session.session, packed.left_out):
            _add(archive, path, f"sessions/{path.relative_to(root).as_posix()}", packed)
    about = (history.model_dump_json(indent=2) + "\n").encode()
    archive.writestr(ABOUT, about)
    packed.sums.append(_sum_line(hashlib.sha256(about).hexdigest(), ABOUT))
    archive.writestr(SUMS, "".join(packed.sums))


def _files(folder: Path, left_out: list[str]) -> Iterator[Path]:
    """All files below a session's folder; links and what is no file are left out, and that is said."""
    for place, folders, names in os.walk(folder):
        folders.sort()
        for name in sorted([*names, *(name for name in folders if (Path(place) / name).is_symlink())]):
            path = Path(place) / name
            said = path.relative_to(folder.parent).as_posix().encode("utf-8", "backslashreplace").decode()
            if path.is_symlink():
                left_out.append(f"{said}: is a link, which is not followed")
            elif not stat.S_ISREG(path.lstat().st_mode):
                left_out.append(f"{said}: is no file")
            else:
                yield path


def _add(archive: zipfile.ZipFile, path: Path, name: str, packed: _Packed) -> None:
    """One file under a name that every archiver can read, with the sum of the bytes that were taken."""
    name = name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    entry = zipfile.ZipInfo.from_file(path, name, strict_timestamps=False)
    entry.compress_type = zipfile.ZIP_STORED if path.suffix in STORED else zipfile.ZIP_DEFLATED
    found = hashlib.sha256()
    with path.open("rb") as source, archive.open(entry, "w", force_zip64=True) as target:
        while piece := source.read(1 << 20):
            found.update(piece)
            target.write(piece)
            packed.bytes += len(piece)
    packed.sums.append(_sum_line(found.hexdigest(), name))


def _sum_line(sha256: str, name: str) -> str:
    """As `sha256sum` writes and checks it, where a name may have any character."""
    escaped = name.replace("\\", "\\\\").replace("\n", "\\n").replace("\r", "\\r")
    mark = "" if escaped == name else "\\"
    return f"{mark}{sha256}  {escaped}\n"


def erase_subject(
    catalogue: Catalogue,
    subject: str,
    confirm: str = "",
    now_s: float | None = None,
    also: Callable[[Sequence[str]], None] = lambda _: None,
) -> ErasureResult:
    """First, without ``confirm``, what would go; then, with what that returned, it goes.

    ``also`` erases what is kept of these sessions elsewhere.

    Raises UsageError where something else would go by now than what was confirmed, or a session is being recorded.
    """
    planned = _planned(catalogue, subject, now_s or time.time())
    if not confirm:
        return planned
    if confirm != planned.confirm:
        raise UsageError(
            f"subject {subject!r}: what would be erased is not what was confirmed; look at it again, without --confirm"
        )
    with catalogue.database.writing() as connection, put_aside(catalogue.root, planned.sessions):
        forget(connection, planned.sessions)
        people.forget_name(connection, planned.subject)
        also(planned.sessions)
    catalogue.database.compact()
    return planned.model_copy(update={"done": True, "confirm": ""})


def _planned(catalogue: Catalogue, subject: str, now_s: float) -> ErasureResult:
    deleted = _in_trash(catalogue.root, code_of(subject))
    try:
        history = catalogue.history(subject)
    except NoSuchSubject:
        if not deleted:
            raise
        history = _without_sessions(code_of(subject))
    names = (*(session.session for session in history.sessions), *deleted)
    for name in names:
        _refuse_recording(catalogue.root / name, now_s)
    sizes = [path.lstat().st_size for name in names for path in _files(catalogue.root / name, [])]
    code, named = history.subject.subject, history.subject.name is not None
    looks = scan(catalogue.root).stamps
    facts = [code, named, len(sizes), sum(sizes), *((name, looks.get(name, "")) for name in names)]
    return ErasureResult(
        subject=code,
        done=False,
        named=named,
        sessions=names,
        files=len(sizes),
        bytes=sum(sizes),
        statement=_statement(catalogue, len(names), named),
        confirm=hashlib.sha256(json.dumps(facts).encode()).hexdigest()[:16],
    )


def _in_trash(root: Path, code: str) -> tuple[str, ...]:
    """A subject's sessions that were deleted and wait in the service's own folder, by their path in ``root``."""
    folders = (path for path in sorted(root.glob(TRASH)) if path.is_dir() and not path.is_symlink())
    whose = {path: next(iter(read_folder(path)), None) for path in folders}
    return tuple(str(path.relative_to(root)) for path, entry in whose.items() if entry and entry.subject == code)


def _without_sessions(code: str) -> SubjectHistory:
    nothing = {"sessions": (), "thresholds": (), "models": (), "diagnoses": (), "operations": ()}
    return SubjectHistory.model_validate({"subject": SubjectEntry(subject=code), **nothing})


def _refuse_recording(folder: Path, now_s: float) -> None:
    """Raises UsageError where a recording in ``folder`` is being written."""
    for path in folder.glob(f"*{RECORDING}"):
        silent_s = abs(now_s - path.lstat().st_mtime)
        if silent_s < LONGEST_SILENCE_S and not _is_closed(path):
            raise UsageError(f"{path}: was written {silent_s:.0f} s ago and is not closed; wait until it is recorded")


def _is_closed(recording: Path) -> bool:
    with recording.open("rb") as file:
        file.seek(max(0, recording.stat().st_size - len(END)))
        return file.read() == END


def _statement(catalogue: Catalogue, sessions: int, named: bool) -> str:
    kept = "the name kept for the code goes too" if named else "no name is kept for the code"
    unknown = [each.session for each in catalogue.unreadable()]
    whose = f" Nobody can say whose these are: {', '.join(unknown)}." if unknown else ""
    return (
        f"{sessions} sessions are removed whole, with recordings and all results in them, and nothing brings them back;"
        f" {kept}. What jobs of the service made of them goes too, and uploads they were imported from."
        f" Not reached: exports, reports and copies elsewhere, results of several sessions written with --out,"
        f" and backups of names (make a new one and delete those).{whose}"
    )
