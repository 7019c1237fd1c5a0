"""Files of any laboratory, sent for an import: streamed to disk, in a folder that appears whole or not at all."""

import asyncio
import contextlib
import os
import shutil
import uuid
from collections.abc import AsyncIterator, Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from pydantic import BaseModel, Field
from python_multipart.exceptions import MultipartParseError
from python_multipart.multipart import MultipartParser, parse_options_header

from api.http.access.secrets import steady_s
from api.http.jobs.places import UPLOAD
from api.http.problems import RequestRefused
from api.http.room import refuse_full
from rig.recording.files import make_folder

if TYPE_CHECKING:
    from python_multipart.multipart import MultipartCallbacks

# Ten hours of a 1 kHz sensor as text; more is sent in parts, or imported on the bench's computer.
LARGEST_UPLOAD_BYTES = 2_000_000_000
MOST_FILES = 5000
# Long enough for what studies call their files, short enough for every file system below our folder.
LONGEST_NAME, DEEPEST = 200, 8
KEPT_S = 7 * 24 * 3600.0
# What a person is at work with stays, should a clock that was wrong at the start make it old: one or two at a time.
NEWEST_KEPT = 3
# A sender that is silent for longer has been left.
SILENT_S = 30.0
# Written in one go: a thread's turn for each of the server's pieces would take longer than the disk.
WRITTEN_BYTES = 1 << 20


class UploadedFile(BaseModel):
    """One file; its name may have folders."""

    name: str
    bytes: int


class UploadView(BaseModel):
    """What was sent in one request."""

    id: str
    at: str
    files: list[UploadedFile]
    bytes: int
    left_out: list[str] = Field(default=[], description="hidden files, which no measurement is in")


class UploadShelf:
    """Uploads below ``root``, each a folder; those older than a week and not ``in_use`` go with the next one."""

    def __init__(self, root: Path, in_use: Callable[[str], bool] = lambda _: False) -> None:
        self._root, self._in_use, self._now_s = root, in_use, steady_s()
        self._coming: set[str] = set()

    async def receive(self, content_type: str, stated: int, pieces: AsyncIterator[bytes]) -> UploadView:
        """Everything of one body of multipart/form-data; raises RequestRefused, and then nothing is left of it."""
        boundary = parse_options_header(content_type)[1].get(b"boundary", b"")
        if not boundary or not content_type.startswith("multipart/form-data"):
            raise RequestRefused(415, "multipart", "send the files as multipart/form-data, each as a part named file")
        make_folder(self._root)
        self._prune()
        refuse_full(self._root, stated)
        identifier = uuid.uuid4().hex[:12]
        scratch = self._root / f".{identifier}.part"
        scratch.mkdir()
        self._coming.add(scratch.name)
        try:
            left_out = await _written(boundary, pieces, scratch)
            if not any(scratch.rglob("*")):
                raise RequestRefused(422, "no-files", "no file came: send each as a part with a filename")
            os.utime(scratch, (self._now_s(),) * 2)
            scratch.rename(self._root / identifier)
        finally:
            self._coming.remove(scratch.name)
            shutil.rmtree(scratch, ignore_errors=True)
        return self.view(identifier).model_copy(update={"left_out": left_out})

    def view(self, identifier: str) -> UploadView:
        """One of them; raises RequestRefused where there is none."""
        folder = self._root / identifier
        if not UPLOAD.fullmatch(identifier) or folder.is_symlink() or not folder.is_dir():
            raise RequestRefused(404, "no-such-upload", f"no upload {identifier[:80]!r}; uploads are kept for a week")
        files = [
            UploadedFile(name=path.relative_to(folder).as_posix(), bytes=path.stat().st_size)
            for path in sorted(folder.rglob("*"))
            if path.is_file()
        ]
        at = datetime.fromtimestamp(folder.stat().st_mtime, UTC).isoformat(timespec="seconds")
        return UploadView(id=identifier, at=at, files=files, bytes=sum(file.bytes for file in files))

    def listed(self) -> Iterator[UploadView]:
        """All there are."""
        for name in filter(UPLOAD.fullmatch, (path.name for path in self._root.glob("*"))):
            with contextlib.suppress(RequestRefused, FileNotFoundError):  # removed meanwhile
                yield self.view(name)

    def remove(self, identifier: str) -> None:
        """Removes one that was looked at."""
        shutil.rmtree(self._root / identifier)

    def _prune(self) -> None:
        with contextlib.suppress(OSError):  # where another removes one meanwhile, the next upload goes on
            folders = sorted((folder.stat().st_mtime, folder) for folder in self._root.iterdir())
            for at_s, folder in folders[:-NEWEST_KEPT]:
                held = folder.name in self._coming or self._in_use(folder.name)
                if self._now_s() - at_s > KEPT_S and not held:
                    shutil.rmtree(folder, ignore_errors=True)


async def _written(boundary: bytes, pieces: AsyncIterator[bytes], folder: Path) -> list[str]:
    parts = FormParts(folder)
    parser = MultipartParser(boundary, parts.callbacks())
    try:
        async for piece in _gathered(pieces):
            await asyncio.to_thread(refuse_full, folder, len(piece))
            await asyncio.to_thread(parser.write, piece)
        parser.finalize()
    except MultipartParseError as error:
        text = f"the body is no whole multipart/form-data: {error}; send it again"
        raise RequestRefused(400, "multipart", text) from error
    except TimeoutError as error:
        raise RequestRefused(408, "slow-body", f"nothing came for {SILENT_S:g} s; send it again") from error
    except OSError as error:
        raise RequestRefused(507, "disk-full", f"the files cannot be written: {error.strerror}") from error
    finally:
        parts.close()
    if not parts.ended:
        raise RequestRefused(400, "multipart", "the body ended within a file; send it again")
    return parts.left_out


async def _gathered(pieces: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    held = bytearray()
    while True:
        piece = await asyncio.wait_for(anext(pieces, None), SILENT_S)
        held += piece or b""
        if piece is None or len(held) >= WRITTEN_BYTES:
            yield bytes(held)
            held.clear()
        if piece is None:
            return


class FormParts:
    """Writes each part that is a file below ``folder`` as it comes; other parts are left aside."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._header, self._value = b"", b""
        self._name = ""
        self._file: BinaryIO | None = None
        self._count = 0
        self.left_out: list[str] = []
        self.ended = False
        """Whether the last boundary has come."""

    def callbacks(self) -> "MultipartCallbacks":
        """For the parser."""
        return {
            "on_part_begin": self._begin, "on_header_field": self._field, "on_header_value": self._said,
            "on_header_end": self._known, "on_headers_finished": self._open, "on_part_data": self._data,
            "on_part_end": self.close, "on_end": self._end,
        }  # fmt: skip

    def _begin(self) -> None:
        self._name = ""

    def _field(self, data: bytes, start: int, end: int) -> None:
        self._header += data[start:end]

    def _said(self, data: bytes, start: int, end: int) -> None:
        self._value += data[start:end]

    def _known(self) -> None:
        if self._header.lower() == b"content-disposition":
            _, options = parse_options_header(self._value)
            self._name = options.get(b"filename", b"").decode("utf-8", "replace")
        self._header, self._value = b"", b""

    def _open(self) -> None:
        if not self._name:
            return
        steps = steps_of(self._name)
        if any(step.startswith(".") for step in steps):
            self.left_out.append(self._name)
            return
        self._count += 1
        path = self._folder.joinpath(*steps)
        if self._count > MOST_FILES:
            raise RequestRefused(422, "refused", f"more than {MOST_FILES} files; send a part of them")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("xb")
        except (FileExistsError, NotADirectoryError) as error:
            raise RequestRefused(422, "refused", f"{self._name}: came twice, or as a folder and as a file") from error

    def _data(self, data: bytes, start: int, end: int) -> None:
        if self._file:
            self._file.write(data[start:end])

    def _end(self) -> None:
        self.ended = True

    def close(self) -> None:
        """The part is over."""
        if self._file:
            self._file.close()
        self._file = None


def steps_of(name: str) -> list[str]:
    """The way to a file below our folder; raises RequestRefused for one that leads out of it, or is none."""
    steps = name.replace("\\", "/").split("/")
    wrong = not all(steps) or {".", ".."} & set(steps) or "\0" in name
    if wrong or len(name.encode()) > LONGEST_NAME or len(steps) > DEEPEST:
        text = f"file name {name[:80]!r}: give a relative one of at most {LONGEST_NAME} bytes and {DEEPEST} folders"
        raise RequestRefused(422, "refused", text)
    return steps
