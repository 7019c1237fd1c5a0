"""The one raw form of every kind of file: named columns of numbers or texts, read a piece at a time."""

import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.intake.mapping import Place
from rig.intake.naming import TITLED

Column = NDArray[np.generic] | list[str]
Batch = Sequence[Column]
MISSING = "not there"
# Of more lines of a text than these only the first are looked at, in about a second.
MOST_LINES = 4_000_000
# A title that is a name and a number or letter: `Specimen 3`, `Probe Nr. 7`, `Sample B`.
_TITLE = re.compile(r"([^\W\d_]+)\s+(?:(?i:no|nr|id|number|nummer)\.?\s+|#\s*)?([A-Z]|[\w./-]*\d[\w./-]*)")
_PAIR, _QUOTES = re.compile(r"[^:=\d]*[^\W\d_]\s*[:=]\s*\S"), str.maketrans("", "", '{}"')
# What readers of files raise on bytes that were cut or changed.
DAMAGE = (OSError, EOFError, ValueError, TypeError, LookupError, RuntimeError, MemoryError, OverflowError, zlib.error)


class Source(NamedTuple):
    """A text, or a sheet of a workbook, which is read as one."""

    path: Path
    sheet: str = ""

    def __str__(self) -> str:
        return f"{self.path}, {self.sheet}" if self.sheet else str(self.path)

    def line(self, number: int) -> str:
        """Where line ``number`` stands."""
        return f"{self} {'row' if self.sheet else 'line'} {number}"


@dataclass(frozen=True)
class Sheet:
    """A CSV file, a sheet of a workbook, the vectors of a struct, a group or a topic.

    ``read`` takes the numbers (from 0) of columns, whether each is text, and gives them piece by piece, in the order
    asked for, alike in length. ``first_row`` is where the first of them stands in the file, counted from 1 in
    ``counted``s. ``facts`` are what stands above the table; ``unread`` says what in the file was not understood,
    ``rows`` about how many rows there are, 0 where nobody knows, ``line_of`` where one stands that is not at its place.
    """

    path: Path
    name: str
    header: tuple[str, ...]
    units: tuple[str, ...]
    read: Callable[[Mapping[int, bool]], Iterator[Batch]]
    facts: Mapping[str, str] = field(default_factory=dict)
    first_row: int = 1
    counted: str = "row"
    unread: str = ""
    rows: int = 0
    line_of: Callable[[int], int] | None = None

    @property
    def where(self) -> str:
        """The file, and the sheet where it has several."""
        return f"{self.path}, {self.name}" if self.name else str(self.path)

    def place(self, row: int) -> str:
        """Where row ``row`` (from 0) of the data stands."""
        return f"{self.where} {self.counted} {self.line_of(row) if self.line_of else self.first_row + row}"

    def number(self, place: Place) -> int:
        """The number of a column from 0; raises DataError where it is not there, or there twice."""
        if isinstance(place, int):
            if place > len(self.header):
                raise DataError(f"{self.where}: no column {place}; there are {len(self.header)}")
            return place - 1
        if (times := self.header.count(place)) > 1:
            raise DataError(f"{self.where}: column {place!r} stands there {times} times; name it by number")
        if place not in self.header:
            raise DataError(f"{self.where}: no column {place!r}; there are {self._shown()}{self.unread}")
        return self.header.index(place)

    def _shown(self) -> str:
        return ", ".join(map(repr, self.header[:20])) + (" ..." if len(self.header) > 20 else "")


def unreadable(path: Path, kind: str, error: Exception, advice: str = "copy it again") -> DataError:
    """The sentence for a file that its reader does not take as ``kind``."""
    if isinstance(error, PermissionError):
        return DataError(f"{path}: you may not read it; ask its owner, or copy it to where you may")
    said = " ".join(str(error).split()) or type(error).__name__
    return DataError(f"{path}: not readable as {kind} ({said}); {advice}")


def refuse_large(path: Path, most_B: float, instead: str) -> None:
    """Raises DataError where a file of a kind that is held in memory whole is larger than memory is taken for."""
    size_B = path.stat().st_size
    if size_B > most_B:
        why = f"its kind is held in memory whole, up to {most_B / 1e9:g} GB of it, and it has {size_B / 1e9:.2f} GB"
        raise DataError(f"{path}: {why}; {instead}")


def facts_in(rows: Sequence[Sequence[str]]) -> dict[str, str]:
    """Of the rows above a table those that are a name and a value, in two cells or one with a colon or = in it.

    And titles that name a specimen, a site or an operator by number or letter.
    """
    found = [[cell for cell in map(str.strip, row) if cell] for row in rows]
    titles = (_TITLE.fullmatch(row[0]) for row in found if len(row) == 1)
    known = {title[1]: title[2] for title in titles if title and title[1].lower() in TITLED}
    parted = [pair for row in found for pair in _pairs(row)]
    return {**known, **{row[0].rstrip(":= "): " ".join(row[1:]) for row in parted if len(row) > 1}}


def _pairs(row: Sequence[str]) -> Iterable[Sequence[str]]:
    """The row as it is; each of its cells by itself where all are a name and a value, as of JSON in one line."""
    cells = [cell.translate(_QUOTES) for cell in row] if len(row) > 1 else row
    alone = len(row) == 1 or all(map(_PAIR.match, cells))
    return [re.split(r"\s*[:=]\s*", cell, maxsplit=1) for cell in cells] if alone else [row]
