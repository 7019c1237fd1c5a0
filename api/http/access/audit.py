"""Who did what, when, and how it ended: a file that is only ever added to, each line bound to the one before it.

A line that was changed or removed shows: each carries the SHA-256 of the line before. Times of day are for people; the
order is that of ``seq``, whatever the clock was set to.
"""

import contextlib
import fcntl
import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path

from api.http.access.scopes import Caller
from api.http.access.store import KeptModel
from api.http.priority import follow

TAIL_BYTES = 65_536  # many times the longest line
FIRST = "0" * 64


class AuditLine(KeptModel):
    """One thing that somebody did, or was kept from doing."""

    seq: int
    time: str
    who: str
    credential: str
    what: str
    outcome: str
    before: str


class AuditLog:
    """The log at ``path``; services of one account may share it."""

    def __init__(self, path: Path, now: Callable[[], datetime] = lambda: datetime.now(UTC)) -> None:
        self.path, self._now = path, now
        self._writer = ThreadPoolExecutor(1, "audit", initializer=follow)

    def add(self, caller: Caller | None, what: str, outcome: str) -> "Future[None]":
        """Adds a line, in a thread: a disk that is slow must keep nobody from stopping; one that is full is told of."""
        return self._writer.submit(self._add, caller, what, outcome)

    def settle(self) -> None:
        """Waits until all that was added is written."""
        self._writer.submit(lambda: None).result()

    def _add(self, caller: Caller | None, what: str, outcome: str) -> None:
        try:
            self._append(caller, what, outcome)
        except OSError as error:
            sys.stderr.write(f"{self.path}: not in the audit log: {what}: {error.strerror}\n")

    def _append(self, caller: Caller | None, what: str, outcome: str) -> None:
        self.path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        fd = os.open(self.path, os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX)
            seq, before, end = _last(fd)
            line = AuditLine(
                seq=seq + 1, time=self._now().isoformat(timespec="milliseconds"), who=caller.name if caller else "",
                credential=f"{caller.by} {caller.id}".strip() if caller else "", what=what[:300], outcome=outcome[:300],
                before=before,
            )  # fmt: skip
            os.write(fd, end + line.model_dump_json().encode() + b"\n")
        finally:
            os.close(fd)

    def lines(self) -> Sequence[bytes]:
        """All lines, oldest first."""
        return self.path.read_bytes().splitlines() if self.path.exists() else []

    def entries(self, lines: Sequence[bytes] | None = None) -> Iterator[AuditLine]:
        """Of all ``lines``, oldest first; `broken` tells of those left out, which cannot be read."""
        for line in self.lines() if lines is None else lines:
            with contextlib.suppress(ValueError):
                yield AuditLine.model_validate_json(line)

    def broken(self, lines: Sequence[bytes] | None = None) -> list[int]:
        """Numbers of the lines, from 1, that do not follow the line before: something was changed there, or taken."""
        found, seq, before = [], 0, FIRST
        for number, line in enumerate(self.lines() if lines is None else lines, 1):
            try:
                known = AuditLine.model_validate_json(line)
                follows = (known.seq, known.before) == (seq + 1, before)
                seq = known.seq
            except ValueError:
                follows, seq = False, seq + 1
            before = hashlib.sha256(line).hexdigest()
            found += [] if follows else [number]
        return found


def _last(fd: int) -> tuple[int, str, bytes]:
    """Number and SHA-256 of the last line, and what ends it where a power failure or a full disk cut it."""
    tail = os.pread(fd, TAIL_BYTES, max(os.fstat(fd).st_size - TAIL_BYTES, 0))
    lines = tail.splitlines()
    before = hashlib.sha256(lines[-1]).hexdigest() if lines else FIRST
    end = b"" if tail.endswith(b"\n") or not tail else b"\n"
    for behind, line in enumerate(reversed(lines)):
        with contextlib.suppress(ValueError, KeyError, TypeError):
            return int(json.loads(line)["seq"]) + behind, before, end
    return len(lines), before, end
