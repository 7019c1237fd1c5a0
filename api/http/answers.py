"""Answers to requests with an Idempotency-Key: lines of a file beside the jobs, one program at a time writing it."""

import base64
import contextlib
import json
import os
import re
import sys
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from urllib.parse import quote

from pydantic import BaseModel, ValidationError

from api.http.shared_file import alone
from rig.recording.files import make_folder, whole_file

ANSWERS = "answers.jsonl"
# The status of an answer that was given, and told of what has been erased since.
ERASED = 404
PRIVATE = 0o600


class KeptAnswer(BaseModel):
    """What was answered; status 0 while nobody knows. ``body`` in base64."""

    place: str
    """Who asked, where, under which key."""
    asked: str
    """SHA-256 of the body."""
    at_s: float
    status: int = 0
    headers: dict[str, str] = {}
    body: str = ""

    def tells_of(self, names: re.Pattern[str]) -> bool:
        """Whether a name stands in it."""
        headers = " ".join(self.headers.values())
        return names.search(f"{headers} {base64.b64decode(self.body).decode(errors='replace')}") is not None


def read_answers(file: Path) -> dict[str, KeptAnswer]:
    """The last line of each place counts; one that was not written whole is none, which is told of."""
    found: dict[str, KeptAnswer] = {}
    for line in file.read_bytes().splitlines() if file.is_file() else []:  # names may hold what else ends lines of text
        try:
            answer = KeptAnswer.model_validate_json(line)
            found[answer.place] = answer
        except ValidationError:
            sys.stderr.write(f"{file}: left out, not understood: a full disk may have cut it: {line[:200]!r}\n")
    return found


def add_answer(file: Path, answer: KeptAnswer) -> None:
    """Adds its line, behind the end of one that was cut."""
    with os.fdopen(os.open(file, os.O_RDWR | os.O_APPEND | os.O_CREAT, PRIVATE), "ab") as lines:
        last = os.pread(lines.fileno(), 1, max(lines.tell() - 1, 0))
        lines.write((b"" if last in (b"", b"\n") else b"\n") + answer.model_dump_json().encode() + b"\n")


def write_answers(file: Path, answers: Iterable[KeptAnswer]) -> None:
    """These and no others, in a new file that its owner alone may read: leases stand in it."""
    with whole_file(file, overwrite=True) as scratch:
        scratch.touch(PRIVATE)
        scratch.write_text("".join(f"{each.model_dump_json()}\n" for each in answers), encoding="utf-8")


@contextlib.contextmanager
def writing(file: Path) -> Iterator[None]:
    """Around each change: no other program reads or writes meanwhile."""
    make_folder(file.parent)
    with alone(file):
        yield


def forget(file: Path, names: Collection[str]) -> None:
    """Takes out what was answered about ``names``; that there was an answer stays known: nothing is done again."""
    if not (names and file.is_file()):
        return
    said = {form for name in names for form in (name, quote(name), json.dumps(name, ensure_ascii=False)[1:-1])}
    pattern = re.compile(rf"(?<![\w.-])(?:{'|'.join(map(re.escape, said))})(?![\w-])")
    empty = {"status": ERASED, "headers": {}, "body": ""}
    with writing(file):
        kept = read_answers(file).values()
        write_answers(file, [each.model_copy(update=empty) if each.tells_of(pattern) else each for each in kept])
