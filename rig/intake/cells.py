"""Cells of a line of text: parted, laid over the columns below, freed of names and units, told from other lines."""

import csv
import re
from collections.abc import Sequence
from typing import NamedTuple

from rig.intake.notation import hyphened, is_number, is_stamp
from rig.intake.roles import knows, words_of
from rig.intake.units import unit_in

# Written for a number that is not there, besides an empty cell, by loggers, spreadsheets and statistics programs.
NO_VALUE = frozenset((
    "na", "n/a", "n.a.", "nan", "-nan", "null", "none", "nil", "missing", "-", "--", "---", "*", "**", "***", ".", "?",
    "#n/a", "#nv", "#value!", "#wert!", "#div/0!", "#num!", "overflow", "over", "overload", "overrange",
    "ol", "ovld", "out of range", "inf", "-inf", "∞", "-∞", "bad", "invalid",
))  # fmt: skip
COMMENT = ("#", "%", "//")
REMARK = "#"  # behind the last cell of a row
# Names of a last column that is written in the rows where there is something to say, and left out in all others.
REMARKS = frozenset(("comment", "comments", "remark", "remarks", "note", "notes", "kommentar", "bemerkung", "备注"))
_AFFIXED = re.compile(
    r"(?:(?P<name>[^\W\d][^:=]*?)\s*[:=]\s*)?(?P<number>[+-]?[\d.,]*\d[\d.,]*(?:[eE][+-]?\d+)?)\s*(?P<unit>[^\d\s.,+-]\S*)?"
)


class Affixed(NamedTuple):
    """A number with the name before it and the unit behind it (``F:1.2 N``), each empty where there is none."""

    name: str
    number: str
    unit: str


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of a line, without the mark of a comment before them; blanks may stand several together."""
    line = line.lstrip("#%;/ ") if line.startswith(COMMENT) or (line.startswith("; ") and delimiter != ";") else line
    line = " ".join(line.split()) if delimiter == " " else line
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter or ",", skipinitialspace=True), [])]


def above_columns(line: str, delimiter: str, below: str) -> list[str]:
    """The cells of a line over the columns of the row ``below`` it.

    ``columns: a b`` begins with what it is itself, R writes nothing over the names of rows, which it quotes, and names
    with blanks in them stand above columns that are parted by blanks with several between them. Names may be parted by
    another sign than the numbers.
    """
    cells, first = cells_of(line, delimiter), cells_of(below, delimiter)
    if len(cells) == len(first) + 1 and cells[0].endswith(":"):
        return cells[1:]
    if len(cells) == 1 < len(first):
        others = (cells_of(line, sign) for sign in "\t;,|" if sign in line)
        return next((found for found in others if len(found) == len(first)), cells)
    is_named = below.startswith('"') and not below.rstrip().endswith('"')
    if len(cells) == len(first) - 1 and is_named and is_number(first[-1]):
        return ["", *cells]
    if delimiter == " " and len(cells) < len(first) and line[:1].isspace():
        return _standing_above(line, below) or cells
    if delimiter == " " and len(cells) > len(first):
        apart = re.split(r"\s{2,}|\t", line.strip())
        return apart if len(apart) == len(first) else []
    return cells


def _standing_above(line: str, below: str) -> list[str]:
    """Each cell of a line parted by blanks over the number that stands nearest to it; none where two have the same."""
    numbers = [match.span() for match in re.finditer(r"\S+", below)]
    found = [""] * len(numbers)
    for match in re.finditer(r"\S+(?: \S+)*", line):
        apart = [max(start - match.end(), match.start() - end) for start, end in numbers]
        at = apart.index(min(apart))
        if found[at]:
            return []
        found[at] = match[0]
    return found


def affixed(cell: str) -> Affixed:
    """The parts of a cell; one that is no number between a name and a unit that is known is all number."""
    match = _AFFIXED.fullmatch(hyphened(cell))
    if match is None or (match["unit"] and not unit_in(match["unit"])):
        return Affixed("", cell, "")
    return Affixed(match["name"] or "", match["number"], match["unit"] or "")


def bare(cells: Sequence[str], like: Sequence[Affixed]) -> list[str]:
    """The numbers of the cells that have the names and units of the first row, ``like``; others as they stand."""
    found = [affixed(cell) for cell in cells]
    known = [(own.name, own.unit) for own in like]
    return [
        part.number if (part.name, part.unit) in known[at : at + 1] else cell
        for at, (part, cell) in enumerate(zip(found, cells, strict=True))
    ]


def ends_in_comment(names: Sequence[str]) -> bool:
    """Whether the last of the names is one of comments, which rows may lack."""
    return len(names) > 2 and not REMARKS.isdisjoint(words_of(names[-1]))


def with_comments(rows: Sequence[Sequence[str]]) -> list[Sequence[str]]:
    """The rows, those that lack only the cell of a comment with an empty one, where their names end in it."""
    cells = next((len(row) for row in rows if ends_in_comment(row)), 0)
    return [[*row, ""] if len(row) == cells - 1 else row for row in rows]


def is_value(cell: str) -> bool:
    """Whether the cell is a number or a time."""
    return is_number(cell) or is_stamp(cell)


def is_other(cells: Sequence[str], first: Sequence[str]) -> bool:
    """Whether a line is none of the table with this ``first`` row: where that has numbers, it begins with text.

    Nor is one that begins where that is empty, one without any number, or one with fewer numbers than texts. A row that
    lacks a cell, or has one of text, is damaged.
    """
    if first and cells and not first[0] and cells[0] and not is_value(cells[0]):
        return True
    known = [cell for cell, model in zip(cells, first, strict=False) if is_value(model)]
    said = [cell for cell in known if cell and cell.lower() not in NO_VALUE]
    numbers = [cell for cell in said if is_value(cell)]
    return 2 * len(numbers) < len(said) or not numbers or (said[0] is known[0] and said[0] is not numbers[0])


def begins_another(line: str, delimiter: str, names: Sequence[str]) -> bool:
    """Whether a line among the rows names other columns than these: words, one of them known, and no number."""
    cells = [cell for cell in cells_of(line, delimiter) if cell]
    if len(cells) < 2 or line.startswith(COMMENT) or cells == [name for name in names if name]:
        return False
    return not any(map(is_value, cells)) and any(knows(cell) and not unit_in(cell) for cell in cells)
