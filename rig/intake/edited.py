"""Lines of a text changed one by one while it is read, as a file that others read."""

import re
from collections.abc import Callable, Iterator, Sequence
from itertools import islice

_DOUBLE = re.compile(rb"(?<![\w.])([+-]?(?:\d+[.,]\d*|[.,]\d+))[dD]([+-]?\d+)(?!\w)")
# A minus sign, a dash or a wide hyphen (U+2212, U+2013, U+FF0D) before a number and behind none.
_MINUS = re.compile(rb"(?<![\w.])(?:\xe2\x88\x92|\xe2\x80\x93|\xef\xbc\x8d)(?=[\d.,])")
_ARROW = re.compile(r"\s*(?:->|=>|→)\s*")
_BRACKETS = re.compile(r"\s*[(\[{](.*)[)\]}]\s*[,;]?\s*")
# A cell that is opened and not closed in its line goes on in the next; names of columns have a few lines at most.
_OPEN_CELL = re.compile(r'(?:^|[\t;,|])\s*"[^"]*$')
LONGEST_CELL = 6
# Lines changed at a time.
CHUNK = 4096


class EditedLines:
    """``lines`` as ``edit`` leaves each of them; closes nothing, since the file they come from is its opener's."""

    def __init__(self, lines: Iterator[bytes], edit: Callable[[bytes], bytes]) -> None:
        self._lines, self._edit, self._rest, self.closed = lines, edit, b"", False

    def close(self) -> None:
        """Ends reading."""
        self.closed = True

    def read(self, size: int) -> bytes:
        """At most ``size`` bytes, none at the end."""
        while len(self._rest) < size and (lines := list(islice(self._lines, CHUNK))):
            self._rest += b"".join(map(self._edit, lines))
        found, self._rest = self._rest[:size], self._rest[size:]
        return found


def single_blanks(line: bytes) -> bytes:
    """One blank where the line has several, none at either end."""
    return b" ".join(line.split()) + b"\n"


def plain_numbers(line: bytes, edit: Callable[[bytes], bytes] | None) -> bytes:
    """With E in its numbers where Fortran writes D, and a hyphen for a minus, after another change."""
    return with_hyphens(_DOUBLE.sub(rb"\1E\2", edit(line) if edit else line))


def filled_up(line: bytes, edit: Callable[[bytes], bytes] | None, delimiter: bytes, cells: int) -> bytes:
    """With an empty last cell where the line lacks that one, after another change."""
    line = edit(line) if edit else line
    return line.rstrip(b"\r\n") + delimiter + b"\n" if line.count(delimiter) == cells - 2 else line


def with_hyphens(line: bytes) -> bytes:
    """With a hyphen where a number has another sign for minus."""
    return _MINUS.sub(b"-", line)


def loosened(line: str, delimiter: str) -> str:
    """The line without brackets around it, parted where it has an arrow (``10:11:12.000 -> 1.2,3.4``)."""
    inner = _BRACKETS.fullmatch(line)
    return _ARROW.sub(delimiter, inner[1] if inner else line)


def joined(lines: Sequence[str]) -> list[str]:
    """A quoted cell that goes on in the next lines in one, and empty lines in place of those it took."""
    found = list(lines)
    for at, line in enumerate(found):
        if line.count('"') % 2 and _OPEN_CELL.search(line):
            below = found[at + 1 : at + LONGEST_CELL]
            more = next((number for number, text in enumerate(below, 1) if text.count('"') % 2), 0)
            found[at : at + more + 1] = [" ".join(map(str.strip, found[at : at + more + 1])), *[""] * more]
    return found
