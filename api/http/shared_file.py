"""A file that several programs read and write: one at a time, and each sees what the others did."""

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

FileState = tuple[int, int, int, int]


def file_state(path: Path) -> FileState | None:
    """Tells one state of the file from the next, written on or put anew; None where there is no file.

    Of a folder, by its links, also where some of its folders come and others go within one tick of the file system.
    """
    try:
        found = path.stat()
    except FileNotFoundError:
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size, found.st_nlink


@contextlib.contextmanager
def alone(path: Path) -> Iterator[None]:
    """Around reading and writing the file, whose folder is there: no other process does either meanwhile."""
    lock = os.open(path.with_suffix(".lock"), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)
