"""How the rows of a file nobody described are written: encoding, delimiter, decimal sign, header and unit rows."""

import gzip
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rig.config.table import TomlTable
from rig.errors import DataError
from rig.intake.mapping import FileForm
from rig.intake.readers import ARRAYS, kind_of, open_sheets
from rig.intake.roles import WORDS, candidates, knows
from rig.intake.units import unit_in, unit_of
from rig.intake.workbook import sheet_names, shown_rows

# Read of a text to see how it is written: preambles are shorter, and a table shows itself in a few rows.
HEAD_BYTES = 65_536
HEAD_ROWS = 200
# Of the encodings that laboratories' machines write; one that is no Unicode is told by the words of the header only.
ENCODINGS = ("gb18030", "cp949", "shift_jis", "big5", "cp1252", "cp1251")
DELIMITERS = ("\t", ";", ",", "|")
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")


class Layout(NamedTuple):
    """What was understood of one sheet: keys of its form, its columns, the first row of data, and what is doubtful."""

    sheet: str
    form: TomlTable
    header: tuple[str, ...]
    units: tuple[str, ...]
    first: tuple[str, ...]
    doubts: tuple[str, ...] = ()


def layouts_of(path: Path) -> list[Layout]:
    """Every sheet of the file that holds a table; raises DataError where the file cannot be read."""
    kind = kind_of(path)
    if kind == "text":
        return _of_text(path)
    if kind == "workbook":
        found = (_of_rows(name, shown_rows(path, name, HEAD_ROWS), {}, "") for name in sheet_names(path))
        return [layout for layout in found if layout is not None]
    if kind != "arrays" or path.suffix.lower() not in ARRAYS:
        return []
    form = FileForm.model_construct(sheets="**/*")
    sheets = [sheet for _, sheet in open_sheets(path, form) if sheet.header]
    return [Layout(sheet.name, {}, sheet.header, sheet.units, ()) for sheet in sheets]


def _of_text(path: Path) -> list[Layout]:
    try:
        with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
            head = file.read(HEAD_BYTES)
    except (OSError, EOFError) as error:
        raise DataError(f"{path}: cannot be read: {error}; copy it again from where it was recorded") from error
    encoding, doubts = encoding_of(head)
    lines = head.decode(encoding, errors="replace").removeprefix("\ufeff").splitlines()[:HEAD_ROWS]
    whole = lines[:-1] if len(head) == HEAD_BYTES else lines
    found = [_of_rows("", [_cells(line, sign) for line in whole], {"delimiter": sign}, sign) for sign in DELIMITERS]
    best = max((item for item in found if item is not None), key=_named, default=None)
    said = {"encoding": encoding} if encoding != "utf-8" else {}
    return [] if best is None else [best._replace(form=said | best.form, doubts=(*doubts, *best.doubts))]


def _named(layout: Layout) -> tuple[int, int]:
    """How many quantities are found in it, and how many columns."""
    found = (candidates(quantity, layout.header, layout.units) for quantity in WORDS)
    return sum(bool(items) for items in found), len(layout.header)


def encoding_of(head: bytes) -> tuple[str, tuple[str, ...]]:
    """The encoding whose header has the most words that are known, and a doubt where others have as many."""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16", ()
    if _decodes(head, "utf-8"):
        return "utf-8", ()
    header = b"\n".join(head.splitlines()[:HEAD_ROWS])
    known = {name: _words(header, name) for name in ENCODINGS if _decodes(head, name)}
    best = max(known, key=lambda name: known[name], default="cp1252")
    rivals = [name for name in known if known[name] == known[best] and name != best]
    shown = {
        name: next((line for line in header.decode(name).splitlines() if not line.isascii()), "") for name in known
    }
    texts = "; ".join(f"{name}: {shown[name]!r}" for name in (best, *rivals))
    return best, (f"the encoding may be {texts}",) if rivals else ()


def _decodes(head: bytes, name: str) -> bool:
    try:
        head[: head.rfind(b"\n") + 1 or len(head)].decode(name)
    except UnicodeDecodeError:
        return False
    return True


def _words(header: bytes, name: str) -> int:
    words = re.split(r"[\s,;|\"()\[\]]+", header.decode(name))
    return sum(knows(word) for word in words if not word.isascii())


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip().strip('"').strip() for cell in line.split(delimiter)]


def _of_rows(sheet: str, rows: Sequence[Sequence[str]], form: TomlTable, delimiter: str) -> Layout | None:
    """The longest run of rows with numbers and equally many cells, and what stands above it; None without one."""
    start, end = _longest([_kind(row, delimiter) for row in rows])
    if end - start < 2:  # two rows are the least that has a rate
        return None
    data = rows[start:end]
    unit_row = start if start and _are_units(rows[start - 1]) else 0
    above = start - 1 - bool(unit_row)
    header_row = above + 1 if above >= 0 and _names(rows[above]) else 0
    width = len(data[0])
    header = [*(rows[header_row - 1] if header_row else []), *[""] * width][:width]
    units = [*(rows[unit_row - 1] if unit_row else []), *[""] * width][:width]
    names = tuple(name or str(number + 1) for number, name in enumerate(header))
    comma = delimiter not in ("", ",") and any(_COMMA.fullmatch(cell) for row in data for cell in row)
    said = {**form, **({"decimal": ","} if comma else {}), "header_row": header_row, "unit_row": unit_row}
    found = tuple(unit_in(unit) or unit_of(name) for unit, name in zip(units, names, strict=True))
    return Layout(sheet, said, names, found, tuple(data[0]))


def _kind(row: Sequence[str], delimiter: str) -> int:
    """How many cells a row of data has; 0 for a row of anything else."""
    filled = [cell for cell in row if cell]
    least = 1 if delimiter == "" else 2
    numbers = sum(bool(_NUMBER.fullmatch(cell)) for cell in filled)
    return len(row) if numbers >= least and 2 * numbers >= len(filled) else 0


def _longest(kinds: Sequence[int]) -> tuple[int, int]:
    best, start = (0, 0), 0
    for at in range(len(kinds) + 1):
        if at == len(kinds) or kinds[at] != kinds[start]:
            best = max(best, (start, at), key=lambda span: span[1] - span[0] if kinds and kinds[span[0]] else 0)
            start = at
    return best if kinds and kinds[best[0]] else (0, 0)


def _are_units(row: Sequence[str]) -> bool:
    filled = [cell for cell in row if cell]
    return bool(filled) and 2 * sum(bool(unit_in(cell)) for cell in filled) >= len(filled)


def _names(row: Sequence[str]) -> bool:
    return any(cell and not _NUMBER.fullmatch(cell) for cell in row)
