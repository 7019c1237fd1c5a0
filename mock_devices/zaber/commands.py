"""Commands as a Zaber device hears them: cut out of whatever comes, checksums looked at, words turned into numbers."""

import contextlib
import math
import re
from collections.abc import Iterator
from typing import NamedTuple

from drivers.zaber.codec import LONGEST, checksum

_COMMAND = re.compile(rb"/(?:(\d{1,2})(?: (\d)(?: (\d{1,2}))?)?)? ?([^:\d][^:]*)?", re.ASCII)


class Refused(Exception):
    """A command is refused with ``word``."""

    def __init__(self, word: str) -> None:
        super().__init__(word)
        self.word = word


class Request(NamedTuple):
    """One command; device and axis are 0 where it names none."""

    device: int
    axis: int
    number: int | None
    verb: str
    words: tuple[str, ...]

    def word(self, index: int) -> str:
        """A word behind the verb; raises Refused."""
        if index >= len(self.words):
            raise Refused("BADDATA")
        return self.words[index]

    def number_at(self, index: int) -> float:
        """The same as a finite number."""
        with contextlib.suppress(ValueError):
            if math.isfinite(number := float(self.word(index))):
                return number
        raise Refused("BADDATA")

    def optional(self, index: int) -> float:
        """The same, 0 where there is none."""
        return self.number_at(index) if index < len(self.words) else 0.0


class CommandLines:
    """Holds less than one line between calls."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> Iterator[Request]:
        """Commands completed by ``data``; those with a wrong checksum are passed over."""
        *lines, rest = (self._rest + data).replace(b"\r", b"\n").split(b"\n")
        self._rest = rest[-LONGEST:]
        for line in lines:
            text, mark, digits = line[line.rfind(b"/") :].partition(b":")
            if not mark or digits == checksum(text):
                match = _COMMAND.fullmatch(text)
                if match:
                    yield _request(match)


def _request(match: re.Match[bytes]) -> Request:
    device, axis, number, command = (part.decode("latin-1") if part else "" for part in match.groups())
    verb, *words = command.split() or [""]
    return Request(int(device or 0), int(axis or 0), int(number) if number else None, verb, tuple(words))
