"""Lines of a text, or rows of a sheet, that are no rows of its table: below it, between its rows, or of another."""

from collections.abc import Callable
from itertools import islice
from typing import NamedTuple

from rig.intake.cells import COMMENT, REMARK, bare, begins_another, cells_of, is_other, is_value
from rig.intake.edited import loosened
from rig.intake.headings import ROWS
from rig.intake.mapping import FileForm
from rig.intake.sheet import MOST_LINES, Source
from rig.intake.text import BLANK_CELLS, NUMBER_BEGINS, FilePart, Head, head_of, lines_in, names_again, open_utf8


class Interruptions(NamedTuple):
    """Lines, those that are no rows, the first of these or of another table, names again, first row below a gap."""

    lines: int
    others: int
    line: int
    text: str
    headers: int
    another: bool = False
    gap: int = 0


def interruptions_of(source: Source, form: FileForm) -> Interruptions:
    """What stands below the beginning of the table and is none of it; empty lines say nothing."""
    head, whole = head_of(source, form, FilePart()), bool(source.sheet) or form.encoding.startswith("utf-16")
    if form.across:
        return Interruptions(0, 0, 0, "", 0)
    others, headers, number, another = list[tuple[int, str]](), 0, 0, (0, "")
    gap, empty = 0, False
    with lines_in(source, form) if whole else open_utf8(source.path, "utf-8") as file:
        above = list(islice(file, form.rows_above))
        names = above[form.header_row - 1].strip() if form.header_row else b""
        is_usual: Callable[[bytes], bool] | None = None
        for number, line in enumerate(islice(file, MOST_LINES), form.rows_above + 1):
            is_usual = is_usual or _usual(line, form, head)
            gap = gap or number * (empty and is_usual(line))
            empty = not line.strip(BLANK_CELLS)
            if names and names_again(line, names):
                headers, another = headers + 1, (0, "")
            elif another[1]:
                if number > another[0] + ROWS:
                    break
            elif not (empty or is_usual(line)):
                text = line.decode("utf-8" if whole else form.encoding, errors="replace").strip()
                if not form.affixes and begins_another(text, form.delimiter, head.names):
                    another = (number, text)
                cells = cells_of(loosened(text, form.delimiter) if form.affixes else text, form.delimiter)
                cells = bare(cells, head.marks) if form.affixes else cells
                if remark := "".join(cells[len(head.names) : len(head.names) + 1]):
                    others += [(number, remark)] if remark.startswith(REMARK) else []
                others += [(number, text)] if text.startswith(COMMENT) or is_other(cells, head.first) else []
    first = another if another[1] else others[0] if others else (0, "")
    return Interruptions(number - form.rows_above, len(others), *first, headers, bool(another[1]), gap)


def _usual(first: bytes, form: FileForm, head: Head) -> Callable[[bytes], bool]:
    """Whether a line looks like the ``first`` row, so that its cells need not be parted."""
    sign, begins = form.delimiter.encode(), NUMBER_BEGINS if head.first and is_value(head.first[0]) else b""
    blank, count = sign == b" ", len(first.split()) if sign == b" " else first.count(sign)

    def is_usual(line: bytes) -> bool:
        cells = len(line.split()) if blank else line.count(sign)
        return cells == count and (not begins or line.lstrip(b" ")[:1] in begins)

    return is_usual
