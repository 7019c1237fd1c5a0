"""Where jobs read and write: sessions, protocols, uploads and a folder of the job's own; no name leads out of these."""

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from api.http.jobs.params import ModelRef
from rig.errors import UsageError
from rig.recording.files import make_folder, write_text

NEW_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
# Bytes, of every file system that Linux has (NAME_MAX).
LONGEST_NAME = 255
UPLOAD = re.compile(r"[0-9a-f]{12}")
MODELS = {"fit": Path("fit") / "model.json", "diagnosis": Path("diagnosis") / "model.json"}
DOES = {"fit": "fit the session first", "diagnosis": "diagnose the session first; one without causes has none"}


class PlaceRefused(UsageError):
    """A name that stands for nothing here, or for what may not be touched; with the service's status and code."""

    def __init__(self, status: int, code: str, text: str) -> None:
        super().__init__(text)
        self.status, self.code = status, code


class Places(NamedTuple):
    """Folders of one job; ``files`` is its own, for what belongs to no session."""

    sessions: Path
    protocols: Path
    uploads: Path
    files: Path

    def folder(self, name: str) -> Path:
        """The folder of session ``name``."""
        folder = self.sessions / name
        if not _plain(name) or folder.is_symlink() or not folder.is_dir():
            raise PlaceRefused(404, "no-such-session", f"no session {name[:80]!r} in {self.sessions}")
        return folder

    def session(self, name: str) -> Path:
        """The same for a job, which writes there too: nothing below it may be a link."""
        refuse_links(self.folder(name))
        return self.sessions / name

    def new_session(self, name: str) -> Path:
        """Where a session of that name may begin."""
        if not NEW_NAME.fullmatch(name):
            text = f"session {name[:80]!r}: a new one is named by letters, digits, _, - and ., at most 64"
            raise PlaceRefused(422, "refused", text)
        folder = self.sessions / name
        if os.path.lexists(folder):
            raise PlaceRefused(409, "session-exists", f"session {name} exists; recordings are never overwritten")
        return folder

    def recorded_into(self, name: str) -> Path:
        """A session that a run is added to, or a new one."""
        return self.session(name) if os.path.lexists(self.sessions / name) else self.new_session(name)

    def recording(self, session: str, name: str) -> Path:
        """One recording of a session, by its name with or without ending."""
        folder = self.session(session)
        for found in (folder / name, folder / f"{name}.mcap"):
            if _plain(name) and found.is_file():
                return found
        raise PlaceRefused(404, "no-such-recording", f"session {session} has no recording {name[:80]!r}")

    def upload(self, identifier: str) -> Path:
        """The folder of an upload."""
        folder = self.uploads / identifier
        if not UPLOAD.fullmatch(identifier) or folder.is_symlink() or not folder.is_dir():
            raise PlaceRefused(404, "no-such-upload", f"no upload {identifier[:80]!r}; uploads are kept for a week")
        return folder

    def place(self, session: str | None, upload: str | None) -> Path:
        """Whichever of the two is given."""
        return self.session(session) if session is not None else self.upload(upload or "")

    def model(self, asked: ModelRef) -> Path:
        """The file of a model."""
        file = self.session(asked.session) / MODELS[asked.file]
        if not file.is_file():
            text = f"session {asked.session} has no {MODELS[asked.file]}: {DOES[asked.file]}"
            raise PlaceRefused(404, "no-such-model", text)
        return file

    def protocol(self, name: str) -> Path:
        """The file of protocol ``name``."""
        file = self.protocols / f"{name}.toml"
        if not NEW_NAME.fullmatch(name) or not file.is_file():
            raise PlaceRefused(404, "no-such-protocol", f"no protocol {name} in {self.protocols}")
        return file

    def text(self, name: str, text: str) -> Path | None:
        """``text`` as a file of the job's own; None of none."""
        if not text:
            return None
        make_folder(self.files)
        write_text(self.files / name, text)
        return self.files / name


def _plain(name: str) -> bool:
    """Whether it is one step down, not a hidden one, and no longer than names of files can be."""
    fits = 0 < len(os.fsencode(name)) <= LONGEST_NAME
    return fits and "/" not in name and "\0" not in name and not name.startswith(".")


def is_text(name: str) -> bool:
    """Whether a name found on disk can be shown and asked for: one that is no UTF-8 cannot."""
    return not any("\ud800" <= letter <= "\udfff" for letter in name)


def refuse_links(folder: Path) -> None:
    """Raises PlaceRefused where anything below is a link, which may lead out of the data folder."""
    for path in _below(folder):
        if path.is_symlink():
            text = f"{path.relative_to(folder.parent)} is a link; a session holds files, so copy what it leads to"
            raise PlaceRefused(409, "link", text)


def _below(folder: Path) -> Iterator[Path]:
    for base, folders, files in os.walk(folder):
        yield from (Path(base) / name for name in (*folders, *files))


def regular_file(folder: Path, path: str) -> Path | None:
    """The file ``path`` below ``folder``; None where there is none, or the way to it leads over a link or out."""
    parts = path.split("/")
    if "\0" in path or any(part in ("", ".", "..") or len(os.fsencode(part)) > LONGEST_NAME for part in parts):
        return None
    found = folder / path
    steps = [found, *list(found.parents)[: path.count("/")]]
    return found if not any(step.is_symlink() for step in steps) and found.is_file() else None
