"""What stands above a table: the row of names, the row of units, and all the words above each column."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from rig.intake.notation import is_number, is_stamp
from rig.intake.roles import knows, quantities_of, words_of
from rig.intake.units import UNIT_WORDS, unit_in, unit_of

# Filled rows above the data among which names and units are looked for: LabVIEW has six between units and names.
ROWS = 12
# Rows directly above the names whose words say more of a column, as a group's name over several columns does.
MORE_ROWS = 2
# Of letters: a longer word that is known among units makes names of them (`secs`, `nsecs`, `force`).
LONGEST_UNIT = 4

# A number behind a word, or before a sign, and a name.
_NUMBERED = re.compile(
    r"(?:(?P<word>[^\W\d_]+) ?(?P<number>\d+)\s*[:=.)]?\s+|(?P<alone>\d+)\s*[:=.)]\s*)(?P<name>[^\d\s].*)"
)

Row = Sequence[str]


class Headings(NamedTuple):
    """Rows are counted from 1, 0 where there is none; ``heads`` are all the words above each column."""

    header_row: int
    unit_row: int
    heads: tuple[str, ...]
    units: tuple[str, ...]

    def moved(self, rows: int) -> "Headings":
        """The same so many rows further down."""
        header_row, unit_row = (row + rows if row else 0 for row in self[:2])
        return self._replace(header_row=header_row, unit_row=unit_row)


def headings_of(above: Sequence[Row], width: int, used: int) -> Headings:
    """The names and units of ``width`` columns, of which ``used`` are filled, in the rows above them."""
    if listed := _listed(above, width):
        return Headings(0, 0, listed, tuple(map(unit_of, listed)))
    filled = [number for number, row in enumerate(above) if any(row)][-ROWS:]
    unit_at = next((number for number in filled[::-1] if _are_units(above[number], number == len(above) - 1)), None)
    header_at = _names_at(above, [number for number in filled if number != unit_at], used)
    names = above[header_at] if header_at is not None else []
    between = unit_at is not None and unit_at == len(above) - 1 and header_at is not None and header_at < unit_at
    stated = [] if unit_at is None else above[unit_at]
    # A name that has another unit is of other columns than a row of units that is not right below it.
    agreed = all(stated_unit(name, unit_in(unit)) is not None for name, unit in zip(names, stated, strict=False))
    stated = stated if between or agreed else []
    rows = [above[number] for number in _around(above, header_at, unit_at, used)]
    heads = tuple(
        " ".join(filter(None, (*(_cell(row, column) for row in rows), _unknown(_cell(stated, column)))))
        for column in range(width)
    )
    units = tuple(stated_unit(_cell(names, column), unit_in(_cell(stated, column))) or "" for column in range(width))
    return Headings(
        0 if header_at is None else header_at + 1,
        unit_at + 1 if unit_at is not None and stated else 0,
        tuple(head or str(number + 1) for number, head in enumerate(heads)),
        units,
    )


def _listed(above: Sequence[Row], width: int) -> tuple[str, ...]:
    """The names of all columns where each has a line with its number (``Sig2 Force (N)``, ``# 2: Force (N)``)."""
    found = [match for row in above if (match := _NUMBERED.fullmatch(" ".join(filter(None, row))))]
    runs = [found[at : at + width] for at, match in enumerate(found) if _place(match) == 1]
    for run in runs:
        counted = list(map(_place, run)) == list(range(1, width + 1))
        alike = len({match["word"] for match in run}) == 1
        if width > 1 and counted and alike and any(knows(match["name"]) for match in run):
            return tuple(match["name"] for match in run)
    return ()


def _place(match: re.Match[str]) -> int:
    return int(match["number"] or match["alone"])


def stated_unit(name: str, below: str) -> str | None:
    """The unit in the row of units, else that in the name; None where a name's own in brackets is another."""
    own = unit_of(name)
    return None if own and below and own != below and {*name} & {*"(["} else below or own


def _unknown(unit: str) -> str:
    """What stands in the row of units and is none that is known, as it would behind a name; else empty."""
    return f"({unit.strip('()[]{} ')})" if unit and not unit_in(unit) else ""


def _cell(row: Row, column: int) -> str:
    """What stands there, but a time: it is of the line, as a logger's before its names, and names nothing."""
    return row[column] if column < len(row) and not is_stamp(row[column]) else ""


def _are_units(row: Row, last: bool) -> bool:
    """Whether half of the cells are units: one is enough directly above the data, elsewhere it may be a setting."""
    filled = [cell for cell in row if cell]
    others = [cell for cell in filled if not unit_in(cell)]
    units = len(filled) - len(others)
    named = any(len(word) > LONGEST_UNIT and knows(word) for cell in others for word in words_of(cell))
    return not named and units >= (1 if last else 2) and 2 * units >= len(filled)


def _names_at(above: Sequence[Row], rows: Sequence[int], width: int) -> int | None:
    """The row with the most words that are known, the lowest of them; else the one directly above, if it is names."""
    known = {number: sum(map(knows, above[number])) for number in rows if _are_names(above[number], width)}
    # Words of settings have a value beside them.
    scores = {at: score - sum(is_number(cell) or is_stamp(cell) for cell in above[at]) for at, score in known.items()}
    best = max(scores, key=lambda number: (scores[number], number), default=None)
    if best is not None and scores[best] <= 0:
        return max(scores)
    return best


def _are_names(row: Row, width: int) -> bool:
    """Whether it has words, and fills half of the columns."""
    filled = [cell for cell in row if cell]
    return 2 * len(filled) >= width and len(filled) <= 2 * width and any(not is_number(cell) for cell in filled)


def _around(above: Sequence[Row], header_at: int | None, unit_at: int | None, width: int) -> list[int]:
    """The row of names, and those beside it that say more of the columns."""
    if header_at is None:
        return []
    before = range(max(0, header_at - MORE_ROWS), header_at)
    after = range(header_at + 1, len(above))
    more = [number for number in (*before, *after) if number != unit_at and _are_names(above[number], width)]
    more = [number for number in more if not _contradicts(above[number], above[header_at])]
    return [header_at, *(number for number in more if not any(map(_is_of_setting, above[number])))]


def _contradicts(row: Row, names: Row) -> bool:
    """Whether a row calls two columns what their names do not, as a sentence over them does."""
    pairs = [(quantities_of(cell), quantities_of(name)) for cell, name in zip(row, names, strict=False)]
    return sum(bool(said and known and said.isdisjoint(known)) for said, known in pairs) > 1


def _is_of_setting(cell: str) -> bool:
    """Whether a cell is a number, or says that a unit stands beside it."""
    return is_number(cell) or not UNIT_WORDS.isdisjoint(words_of(cell))
