"""CSV and other text: any encoding, delimiter and decimal sign, lines above the table, a row of units."""

import codecs
import csv
import gzip
import io
import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import islice, pairwise, zip_longest
from pathlib import Path
from typing import IO, NamedTuple, cast

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as arrow_csv
from numpy.typing import NDArray

from rig.errors import DataError
from rig.intake.cells import (
    COMMENT,
    REMARK,
    Affixed,
    above_columns,
    affixed,
    bare,
    begins_another,
    cells_of,
    ends_in_comment,
    is_other,
)
from rig.intake.edited import EditedLines, filled_up, joined, loosened, plain_numbers, single_blanks
from rig.intake.headings import stated_unit
from rig.intake.mapping import FileForm
from rig.intake.notation import GROUPS, is_number, is_stamp
from rig.intake.numerals import check_number
from rig.intake.roles import words_of
from rig.intake.sheet import DAMAGE, MOST_LINES, Batch, Column, Sheet, Source, facts_in, unreadable
from rig.intake.units import unit_in, unit_of
from rig.intake.workbook import sheet_text

# Read at a time; Arrow reads some 32 of these ahead, so 16 MiB would be half a gigabyte of memory.
BLOCK_BYTES = 1 << 22
Kinds = Mapping[int, bool]  # of the columns that are read, whether they are text
BLANK_CELLS = b" \t\r\n,;"
# A line that begins with one of these is a row, where it has as many cells as the first and that begins with a number.
NUMBER_BEGINS = b"0123456789+-.,"
_DIGITS = re.compile(rb"\d+")
_SECTION = re.compile(r'"?\[?([^\W\d_][\w .-]*)\]?"?[\s,;]*')
_UTF8 = ("utf-8", "utf8", "utf-8-sig", "ascii")


class FilePart(NamedTuple):
    """One of the tables of a file, by its number: the lines from ``start`` (0 the first) on, up to ``end``."""

    name: str = ""
    start: int = 0
    end: int | None = None


class Head(NamedTuple):
    """What stands above a table, its first row with marks, its line from 0, columns' names and units, how many rows."""

    above: list[list[str]]
    first: list[str]
    marks: list[Affixed]
    start: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    rows: int


def open_texts(source: Source, form: FileForm) -> list[Sheet]:
    """The tables in ``source``, one but where its names come again; raises DataError where it is not of the form."""
    if form.section:
        return [_open(source, form, section_in(source, form))]
    return [_open(source, form, part) for part in (_parts(source, form) if form.repeats else [FilePart()])]


def _parts(source: Source, form: FileForm) -> list[FilePart]:
    """Each table with as many lines above its row of names as the first has, without those that have no row."""
    header, at, number = b"", list[int](), 0
    with lines_in(source, form) as file:
        for number, line in enumerate(file):
            header = line.strip() if number == form.header_row - 1 else header
            at += [number] if header and names_again(line, header) else []
    below = form.rows_above - form.header_row + 1
    spans = [(here - form.header_row + 1, after) for here, after in pairwise([*at, number + 1]) if after - here > below]
    return [FilePart(str(index), *span) for index, span in enumerate(spans, 1)] if len(spans) > 1 else [FilePart()]


def names_again(line: bytes, header: bytes) -> bool:
    """Whether the line is the ``header`` row, but for numbers (``Specimen 2 Force (N)``)."""
    line = line.strip()
    alike = line[:2] == header[:2] and not line[:1].isdigit()  # as rows begin
    return line == header or (alike and _DIGITS.sub(b"0", line) == _DIGITS.sub(b"0", header))


def section_in(source: Source, form: FileForm) -> FilePart:
    """The lines below the one that is the section's name, up to an empty one below the row of names."""
    start, end = 0, None
    with lines_in(source, form) as file:
        for number, line in enumerate(file, 1):
            if not start and _section_name(line.decode(errors="replace")) == form.section:
                start = number
            elif start and number > start + form.rows_above and not line.strip(BLANK_CELLS):
                end = number - 1
                break
    if start:
        return FilePart(form.section, start, end)
    raise DataError(f"{source}: no line is {form.section!r}; correct `section`")


def sections_in(path: Path) -> list[str]:
    """The names of tables below each other, of a text that begins with one: lines of one cell behind empty ones."""
    found, empty = list[str](), True
    with open_utf8(path, "utf-8") as file:
        for line in islice(file, MOST_LINES):
            blank = not line.strip(BLANK_CELLS)
            name = _section_name(line.decode(errors="replace")) if empty and not blank else ""
            if not (found or blank or name):
                return []
            found += [name] if name else []
            empty = blank
    return found if len(set(found)) == len(found) else []


def _section_name(line: str) -> str:
    """The only cell of a line, where it is words; else empty."""
    found = _SECTION.fullmatch(line.strip())
    return found[1] if found else ""


def _open(source: Source, form: FileForm, part: FilePart) -> Sheet:
    head = head_of(source, form, part)
    if form.repeats and part.start:  # whose names may have its own number in them
        head = head._replace(names=head_of(source, form, FilePart()).names)
    read, lines = partial(_batches, source, form, part, head), partial(_lines, source, form, part, head)
    last, kind = (form.header_row or form.rows_above + 1) - 1, "row" if source.sheet else "line"
    facts = [row for row in head.above[:last] if not part.start or is_other(row, head.first)]
    name = "-".join(filter(None, (source.sheet, part.name)))
    stated = facts_in(facts)
    if form.section and head.above and is_number("".join(head.above[0])):  # as Vicon has it
        stated |= {"sampling rate (Hz)": "".join(head.above[0])}
    return Sheet(
        source.path, name, head.names, head.units, read, stated, head.start + 1,
        "column" if form.across else kind, rows=head.rows,
        line_of=None if form.across else lambda row: next(islice(lines(), row, None))[0],
    )  # fmt: skip


def head_of(source: Source, form: FileForm, part: FilePart) -> Head:
    """What stands above the table in ``part``, and its first row; raises DataError where it ends above it."""
    start = form.rows_above
    with lines_in(source, form) as file:
        raw = list(islice(file, part.start, part.start + start + 1))
    lines = joined([_decoded(source, part.start + number, line) for number, line in enumerate(raw, 1)])
    lines = [loosened(line, form.delimiter) for line in lines] if form.affixes else lines
    if len(lines) <= start:
        place = source.line(start + 1).removeprefix(f"{source} ")
        raise DataError(f"{source}: ends above {place}, where its table should begin; correct header_row")
    above = [cells_of(line, form.delimiter) for line in lines[:start]]
    for row in filter(None, {form.header_row, form.unit_row}):
        above[row - 1] = above_columns(lines[row - 1], form.delimiter, lines[start])
    first = cells_of(lines[start], form.delimiter)
    header = _row(above, form.header_row, _width(above, first, form))
    marks = list(map(affixed, first)) if form.affixes else []
    given = [*(mark.name for mark in marks), *[""] * (len(header) - len(marks))]
    names = tuple(
        ("" if is_stamp(name) else name.strip()) or own or str(number)
        for number, (name, own) in enumerate(zip(header, given, strict=False), 1)
    )
    below = _row(above, form.unit_row, len(names)) if form.unit_row else [""] * len(names)
    behind = [*(mark.unit for mark in marks), *[""] * len(names)]
    units = tuple(
        stated_unit(name, unit_in(unit) or unit_in(own)) or ""
        for unit, own, name in zip(below, behind, names, strict=False)
    )
    rows = 0 if source.sheet else _size(source.path) // len(raw[-1])
    return Head(above, bare(first, marks) if marks else first, marks, part.start + start, names, units, rows)


def open_utf8(path: Path, encoding: str) -> IO[bytes]:
    """The bytes of the file as UTF-8 without a mark; raises DataError where it cannot be opened."""
    try:
        raw = bytes_of(path)
        if encoding.lower() not in _UTF8:
            return codecs.EncodedFile(raw, "utf-8", encoding)
        if raw.read(3) != codecs.BOM_UTF8:
            raw.seek(0)
    except FileNotFoundError as error:
        raise DataError(f"{path}: no such file") from error
    except (OSError, EOFError, zlib.error) as error:
        raise unreadable(path, "text", error) from error
    except LookupError as error:
        raw.close()
        raise DataError(f"{path}: {encoding!r} is no encoding; utf-8, latin-1, utf-16 and gb18030 are") from error
    return raw


def lines_in(source: Source, form: FileForm) -> IO[bytes]:
    """The lines of the file in UTF-8, or those that its columns make where the table lies across."""
    path, sheet = source
    file = io.BytesIO(sheet_text(path, sheet, form.decimal)) if sheet else open_utf8(path, form.encoding)
    if not form.across:
        return file
    with file:
        rows = [cells_of(line.decode(), form.delimiter) for line in file]
    turned = io.StringIO()
    csv.writer(turned, delimiter=form.delimiter).writerows(zip_longest(*rows, fillvalue=""))
    return io.BytesIO(turned.getvalue().encode())


def _size(path: Path) -> int:
    """Bytes of the text; of a compressed one as its end says."""
    if path.suffix != ".gz":
        return path.stat().st_size
    with path.open("rb") as file:
        file.seek(-4, io.SEEK_END)
        return int.from_bytes(file.read(4), "little")


def bytes_of(path: Path) -> IO[bytes]:
    """The bytes of the file, or of what it holds compressed."""
    return cast("IO[bytes]", gzip.open(path)) if path.suffix == ".gz" else path.open("rb")


def _decoded(source: Source, number: int, line: bytes) -> str:
    try:
        return line.decode()
    except UnicodeDecodeError as error:
        raise DataError(f"{source.line(number)}: not UTF-8; state its encoding, as in encoding = 'latin-1'") from error


def _width(above: list[list[str]], first: list[str], form: FileForm) -> int:
    """Cells of the first row of data, but not those behind the header that hold something; all of it with a comment."""
    named = above[form.header_row - 1] if form.header_row else []
    if ends_in_comment(named):
        return len(named)
    return len(named) if named and any(first[len(named) :]) else len(first) or len(named)


def _row(above: list[list[str]], row: int, width: int) -> list[str]:
    found = above[row - 1] if row else []
    return [*found, *[""] * (width - len(found))][:width]


def _batches(source: Source, form: FileForm, part: FilePart, head: Head, columns: Kinds) -> Iterator[Batch]:
    texts = {number: text or bool(form.thousands) for number, text in columns.items()}
    with lines_in(source, form) as file:
        try:
            for batch in _arrow(_rows(file, source, form, part, head), form, head.names, texts):
                yield [_column(batch.column(at), columns[number], form) for at, number in enumerate(columns)]
        except (pa.ArrowInvalid, *DAMAGE) as error:
            _explain(source, form, part, head, columns)
            raise unreadable(source.path, "text in columns", error) from error


def _rows(file: IO[bytes], source: Source, form: FileForm, part: FilePart, head: Head) -> IO[bytes] | EditedLines:
    """The lines of the table, as Arrow and csv read them; nothing is put between where they stand so in the file."""
    for _ in islice(file, head.start):
        pass
    edit = _edit(form, head)
    if edit is None and part.end is None:
        return file
    return EditedLines(_until(file, source, part, head, form), edit or bytes)


def _until(file: Iterable[bytes], source: Source, part: FilePart, head: Head, form: FileForm) -> Iterator[bytes]:
    """The lines of the part; where others are left out, none from one that begins another table to the names again."""
    is_left_out, another = form.other_lines == "drop" and not form.affixes, False
    for number, line in enumerate(islice(file, None if part.end is None else part.end - head.start), head.start + 1):
        if is_left_out and line[:1] not in NUMBER_BEGINS:
            text = line.decode(errors="replace")
            cells = cells_of(text, form.delimiter)
            refuse_units(source.line(number), cells, head.names, head.units)
            again = list(filter(None, cells)) == list(filter(None, head.names))
            another = begins_another(text, form.delimiter, head.names) or (another and not again)
        yield b"\n" if another else line


def refuse_units(place: str, cells: Sequence[str], names: Sequence[str], units: Sequence[str]) -> None:
    """Raises DataError where cells are units, or the names with units, and one of these is another than above."""
    own = ["" if is_number(cell) else unit_in(cell) for cell in cells]
    columns = list(zip(own, cells, names, units, strict=False))
    alike = (unit or not cell or words_of(cell)[:1] == words_of(name)[:1] for unit, cell, name, _ in columns)
    if len(cells) != len(names) or not all(alike):
        return
    for unit, cell, name, above in columns:
        said = unit or unit_of(cell)
        if said and above and said != above:
            why = f"{name!r} is in {said} from here on and in {above} above"
            raise DataError(f"{place}: {why}; save what stands from here on as a file of its own")


def _edit(form: FileForm, head: Head) -> Callable[[bytes], bytes] | None:
    edit = single_blanks if form.delimiter == " " else None
    if form.affixes or form.other_lines == "drop":
        edit = partial(_edited, form=form, head=head)
    if ends_in_comment(head.names):
        edit = partial(filled_up, edit=edit, delimiter=form.delimiter.encode(), cells=len(head.names))
    return partial(plain_numbers, edit=edit) if form.exponent == "D" or form.minus != "-" else edit


def _edited(line: bytes, form: FileForm, head: Head) -> bytes:
    """Empty where a line is none of the table and such are left out, so that the others keep their numbers."""
    text, remark, _ = line.decode(errors="replace").partition(form.delimiter + REMARK)
    line = f"{text}\n".encode() if remark else line
    cells = cells_of(text, form.delimiter)
    if form.affixes:
        cells = bare(cells_of(loosened(text, form.delimiter), form.delimiter), head.marks)
    if form.other_lines == "drop" and (text.startswith(COMMENT) or is_other(cells, head.first)):
        return b"\n"
    if form.affixes:
        return form.delimiter.join(f'"{cell}"' for cell in cells).encode() + b"\n"
    return single_blanks(line) if form.delimiter == " " else line


def _arrow(
    file: IO[bytes] | EditedLines, form: FileForm, names: tuple[str, ...], texts: Mapping[int, bool]
) -> arrow_csv.CSVStreamingReader:
    kinds = {str(number): pa.string() if text else pa.float64() for number, text in texts.items()}
    return arrow_csv.open_csv(
        pa.PythonFile(file, "r"),
        read_options=arrow_csv.ReadOptions(column_names=list(map(str, range(len(names)))), block_size=BLOCK_BYTES),
        parse_options=arrow_csv.ParseOptions(delimiter=form.delimiter),
        convert_options=arrow_csv.ConvertOptions(
            include_columns=list(kinds), column_types=kinds, null_values=list(form.missing), decimal_point=form.decimal
        ),
    )


def _column(found: pa.Array, text: bool, form: FileForm) -> Column:
    if text:
        return ["" if item is None else item.strip() for item in found.to_pylist()]
    if form.thousands:
        grouped = pc.match_substring_regex(found, rf"^\s*(?:{GROUPS.format(re.escape(form.thousands))})\s*$")
        if pc.any(pc.and_not(pc.match_substring(found, form.thousands), grouped)).as_py():
            raise pa.ArrowInvalid("digits are not parted in thousands")
        plain = pc.replace_substring(pc.replace_substring(found, form.thousands, ""), form.decimal, ".")
        gone = pc.is_in(found, pa.array(form.missing))
        found = pc.cast(pc.if_else(gone, None, pc.utf8_trim_whitespace(plain)), pa.float64())
    return _numbers(found)


def _numbers(found: pa.Array) -> NDArray[np.float64]:
    """NaN where nothing is. From the buffers: `to_numpy` loads pandas where that is installed, for half a second."""
    rows = slice(found.offset, found.offset + len(found))
    there, data = found.buffers()
    values = np.frombuffer(data, np.float64)[rows]
    if not found.null_count:
        return values
    known = np.unpackbits(np.frombuffer(there, np.uint8), bitorder="little")[rows]
    return np.where(known, values, np.nan)


def _explain(source: Source, form: FileForm, part: FilePart, head: Head, columns: Mapping[int, bool]) -> None:
    """Raises the sentence for the first line that is not of the form."""
    for line, cells in _lines(source, form, part, head):
        place = source.line(line)
        refuse_units(place, cells, head.names, head.units)
        if len(cells) != len(head.names) and is_other([cell.strip() for cell in cells], head.first):
            said = " ".join(filter(None, cells))[:40]
            raise DataError(f"{place}: {said!r} is no row of the table; to leave such lines out, say {_LEFT_OUT}")
        if len(cells) != len(head.names):
            why = _TWICE if len(cells) == 2 * len(head.names) and form.delimiter == "," else "mend it or take it out"
            raise DataError(f"{place}: {len(cells)} cells where the header has {len(head.names)}; {why}")
        for number in (number for number, text in columns.items() if not text):
            check_number(f"{place}, column {head.names[number]}", cells[number].strip(), form)


_TWICE = "the comma parts cells and decimals: save it with semicolons"
_LEFT_OUT = "other_lines = 'drop', and repeats = true where its row of names comes again"


def _lines(source: Source, form: FileForm, part: FilePart, head: Head) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line of the table, empty ones left out; raises DataError."""
    with lines_in(source, form) as file:
        edit, below = _edit(form, head) or bytes, islice(file, head.start, None)
        try:
            rows = (edit(line).decode() for line in _until(below, source, part, head, form))
            reader = csv.reader(rows, delimiter=form.delimiter)
            yield from ((head.start + reader.line_num, cells) for cells in reader if cells)
        except (UnicodeDecodeError, csv.Error, *DAMAGE) as error:
            raise unreadable(source.path, "text", error, "state its encoding, or copy the file again") from error
