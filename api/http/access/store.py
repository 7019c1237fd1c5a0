"""One private file of a list: read anew where it changed, written whole or not at all, one writer at a time."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Generic, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from api.http.shared_file import FileState, alone, file_state
from rig.errors import UsageError

Content = TypeVar("Content", bound=BaseModel)


class KeptModel(BaseModel):
    """Root of what is kept of who may act: nothing in it changes by itself, and nothing unknown is taken."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class PrivateFile(Generic[Content]):
    """The file at ``path``; its owner alone may read it. Without a file the content is ``empty``."""

    def __init__(self, path: Path, empty: Content) -> None:
        self.path, self._empty = path, empty
        self._seen: FileState | None = None
        self._content = empty

    def read(self) -> Content:
        """What is in it now; raises UsageError where others may read or write it, or it is not what was written."""
        seen = file_state(self.path)
        if seen != self._seen:
            self._content = self._load() if seen else self._empty
            self._seen = seen
        return self._content

    def _load(self) -> Content:
        if self.path.stat().st_mode & 0o077:
            raise UsageError(
                f"{self.path}: others may read or change it; `chmod 600 {self.path}`, then make new tokens"
            )
        try:
            return type(self._empty).model_validate_json(self.path.read_bytes())
        except ValidationError as error:
            raise UsageError(
                f"{self.path}: cannot be read ({error.error_count()} errors); restore it from a backup, or delete it"
                " and make tokens and accounts anew"
            ) from error

    @contextlib.contextmanager
    def alone(self) -> Iterator[None]:
        """Around reading and writing: no other process does either meanwhile."""
        self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with alone(self.path):
            yield

    def write(self, content: Content) -> None:
        """Puts ``content`` in its place; within ``alone``."""
        new = self.path.with_suffix(".new")
        new.unlink(missing_ok=True)
        fd = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        with os.fdopen(fd, "w") as file:
            file.write(content.model_dump_json(indent=1))
            file.flush()
            os.fsync(file.fileno())
        new.rename(self.path)
