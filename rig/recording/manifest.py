"""What binds the files of a session to each other: hashes in ``session.json``, and what is found where they disagree.

Each trial carries the SHA-256 of its recording as it was closed, and the list carries one of itself. This tells of
swapped, copied and edited files; it is no signature, since whoever rewrites the list can seal it anew.
"""

import contextlib
import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from pydantic import JsonValue

from rig.errors import DataError
from rig.recording.mcap_file import SUMMARY
from rig.recording.reader import Recording, read_recording

SEAL = "sha256"


def file_sha256(path: Path) -> str:
    """SHA-256 of the file's bytes, 64 hexadecimal digits; raises OSError where it cannot be read."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def seal(table: Mapping[str, JsonValue]) -> Mapping[str, JsonValue]:
    """``table`` with the hash of everything else in it."""
    return {**table, SEAL: _table_sha256(table)}


def find_broken_seal(data: bytes, name: str) -> tuple[str, ...]:
    """A sentence where the list ``data`` of file ``name`` was changed after it was sealed, or never was."""
    try:
        table = json.loads(data)
    except ValueError:
        return ()  # whoever opens the session says that it cannot be read
    if not isinstance(table, dict) or SEAL not in table:
        return (f"{name}: carries no hash of its own, so changes in it cannot be seen; an earlier version wrote it",)
    if table[SEAL] != _table_sha256(table):
        return (f"{name}: was changed after the program wrote it; compare it with a copy of the session",)
    return ()


class Listed(NamedTuple):
    """What the session's list says of one recording; ``sha256`` is empty where nobody closed it."""

    trial: str
    file: str
    sha256: str


def find_mismatches(folder: Path, list_name: str, session: str, listed: Sequence[Listed]) -> tuple[str, ...]:
    """Every sentence on the session in ``folder``, whose list is the file ``list_name``."""
    path = folder / list_name
    said = find_broken_seal(path.read_bytes(), list_name) if path.is_file() else ()
    owners = {item.sha256: item.trial for item in listed if item.sha256}
    for item in listed:
        with contextlib.suppress(DataError, OSError):  # the verdict of that recording itself says so
            said += find_foreign(folder / item.file, session, item, owners)
    return said


def find_foreign(path: Path, session: str, item: Listed, owners: Mapping[str, str]) -> tuple[str, ...]:
    """Sentences on a recording that is not the one that was closed as ``item`` of ``session``.

    ``owners`` maps the hash of every listed recording to its trial. Raises DataError where it is no recording.
    """
    found = file_sha256(path)
    if found == item.sha256:
        return ()
    recording = read_recording(path)
    said = _find_other_origin(recording, session, item.trial)
    owner = owners.get(found, item.trial)
    if owner != item.trial:
        said += (f"{item.file}: has the content of {owner}, not of {item.trial}: was it swapped or copied?",)
    if said or not item.sha256 or SUMMARY not in recording.metadata:
        return said  # one that was cut is told by its own verdict
    return (f"{item.file}: was changed after it was closed: its hash is not the one in the session's list",)


def _find_other_origin(recording: Recording, session: str, trial: str) -> tuple[str, ...]:
    about = recording.metadata.get("recording", {})
    origin = (about.get("session", session), about.get("trial", trial))
    if origin == (session, trial):
        return ()
    return (
        f"{recording.path.name}: was recorded as {origin[1]} of session {origin[0]}, and is listed as {trial} of"
        f" {session}: was it swapped or copied?",
    )


def _table_sha256(table: Mapping[str, object]) -> str:
    content = {key: value for key, value in table.items() if key != SEAL}
    return hashlib.sha256(json.dumps(content, sort_keys=True, ensure_ascii=False).encode()).hexdigest()
