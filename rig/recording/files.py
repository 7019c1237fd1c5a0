"""Files and folders that appear whole or not at all: built under another name next to the place, then renamed."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from rig.errors import UsageError, write_failed


@contextmanager
def whole_file(path: Path, overwrite: bool = False) -> Iterator[Path]:
    """A scratch path that becomes ``path`` when the block ends well; raises UsageError where ``path`` may not."""
    _check(path, overwrite)
    with _put_in_place(path, partial(Path.unlink, missing_ok=True)) as scratch:
        yield scratch
        wait_for_disk(scratch)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """A scratch folder that becomes ``path`` when the block ends well; an empty folder at ``path`` is replaced."""
    if not (path.is_dir() and not any(path.iterdir())):
        _check(path, overwrite=False)
    with _put_in_place(path, partial(shutil.rmtree, ignore_errors=True)) as scratch:
        scratch.mkdir(parents=True)
        yield scratch


@contextmanager
def _put_in_place(path: Path, remove: Callable[[Path], object]) -> Iterator[Path]:
    scratch = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield scratch
        scratch.replace(path)
    except OSError as error:
        said = f"{path}: cannot be written: {error.strerror or error}; nothing was left behind"
        raise write_failed(said, error) from error
    finally:
        remove(scratch)


def make_folder(path: Path) -> None:
    """Makes the folder and those above it where they are missing."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise write_failed(f"{path}: cannot be made: {error.strerror}; give another place", error) from error


def refuse_unwritable(path: Path) -> None:
    """Raises UsageError where ``path`` could not be made, before any work is done for it; writes nothing."""
    if path.is_dir():
        raise UsageError(f"{path}: is a folder; give the name of a file")
    parent = next(place for place in path.absolute().parents if place.exists())
    if not parent.is_dir():
        raise UsageError(f"{path}: {parent} is a file, not a folder; give another place")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise UsageError(f"{path}: {parent} may not be written to; give another place, or change its permissions")


def write_text(path: Path, text: str) -> None:
    """Replaces the content of ``path`` in one step."""
    with whole_file(path, overwrite=True) as scratch:
        scratch.write_text(text, encoding="utf-8")


def _check(path: Path, overwrite: bool) -> None:
    if path.exists() and not overwrite:
        raise UsageError(f"{path}: exists already and is not overwritten; give a new name")
    if overwrite and path.is_dir():
        raise UsageError(f"{path}: is a folder; give the name of a file")


def wait_for_disk(path: Path) -> None:
    """Waits until the disk has the file or folder."""
    fd = os.open(path, os.O_RDONLY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)
