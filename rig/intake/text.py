"""CSV and other text: any encoding, delimiter and decimal sign, lines above the table, a row of units."""

import codecs
import csv
import gzip
import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, cast

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as arrow_csv

from rig.errors import DataError
from rig.intake.mapping import FileForm
from rig.intake.sheet import Batch, Column, Sheet, facts_in
from rig.intake.units import unit_in, unit_of

# Read at a time; Arrow reads some 32 of these ahead, so 16 MiB would be half a gigabyte of memory.
BLOCK_BYTES = 1 << 22
_UTF8 = ("utf-8", "utf8", "utf-8-sig", "ascii")


def open_text(path: Path, form: FileForm) -> Sheet:
    """The table in ``path``; raises DataError naming file and line where the form is not the file's."""
    start = max(form.header_row, form.unit_row)
    with open_utf8(path, form.encoding) as file:
        above = [_cells(_decoded(path, number + 1, line), form) for number, line in enumerate(_head(file, start + 1))]
    if len(above) <= start:
        raise DataError(f"{path}: ends above line {start + 1}, where its table should begin; correct header_row")
    width = _width(above, form)
    header = _row(above, form.header_row, width)
    names = tuple(name.strip() or str(number + 1) for number, name in enumerate(header))
    stated = _row(above, form.unit_row, width) if form.unit_row else [""] * width
    units = tuple(unit_in(unit) or unit_of(name) for unit, name in zip(stated, names, strict=True))

    def read(columns: Mapping[int, bool]) -> Iterator[Batch]:
        return _batches(path, form, start, names, columns)

    last = (form.header_row or start + 1) - 1
    return Sheet(path, "", names, units, read, facts_in(above[:last]), start + 1, "line")


def open_utf8(path: Path, encoding: str) -> IO[bytes]:
    """The bytes of the file as UTF-8 without a mark; raises DataError where it cannot be opened."""
    try:
        raw = _bytes_of(path)
        if encoding.lower() not in _UTF8:
            return codecs.EncodedFile(raw, "utf-8", encoding)
        if raw.read(3) != codecs.BOM_UTF8:
            raw.seek(0)
    except FileNotFoundError as error:
        raise DataError(f"{path}: no such file") from error
    except (OSError, EOFError) as error:
        raise DataError(f"{path}: cannot be read: {error}; copy it again from where it was recorded") from error
    except LookupError as error:
        raw.close()
        raise DataError(f"{path}: {encoding!r} is no encoding; utf-8, latin-1, utf-16 and gb18030 are") from error
    return raw


def _bytes_of(path: Path) -> IO[bytes]:
    return cast("IO[bytes]", gzip.open(path)) if path.suffix == ".gz" else path.open("rb")


def _head(file: IO[bytes], count: int) -> list[bytes]:
    lines = (file.readline() for _ in range(count))
    return [line for line in lines if line]


def _decoded(path: Path, number: int, line: bytes) -> str:
    try:
        return line.decode()
    except UnicodeDecodeError as error:
        raise DataError(
            f"{path} line {number}: not UTF-8; state its encoding, for example encoding = 'latin-1'"
        ) from error


def _cells(line: str, form: FileForm) -> list[str]:
    return next(csv.reader([line], delimiter=form.delimiter, skipinitialspace=True), [])


def _width(above: list[list[str]], form: FileForm) -> int:
    """Cells of a row: as many as the header has, and empty ones that a comma at the end of each line makes."""
    named, first = above[form.header_row - 1] if form.header_row else [], above[-1]
    return len(named) if any(first[len(named) :]) and named else max(len(named), len(first))


def _row(above: list[list[str]], row: int, width: int) -> list[str]:
    found = above[row - 1] if row else []
    return [*found, *[""] * (width - len(found))]


def _batches(
    path: Path, form: FileForm, start: int, names: tuple[str, ...], columns: Mapping[int, bool]
) -> Iterator[Batch]:
    texts = {number: text or bool(form.thousands) for number, text in columns.items()}
    with open_utf8(path, form.encoding) as file:
        _head(file, start)
        try:
            for batch in _arrow(file, form, names, texts):
                yield [_column(batch.column(at), columns[number], form) for at, number in enumerate(columns)]
        except (pa.ArrowInvalid, ValueError, OSError, EOFError) as error:
            _explain(path, form, start, names, columns)
            raise DataError(f"{path}: not readable as text in columns: {error}") from error


def _arrow(
    file: IO[bytes], form: FileForm, names: tuple[str, ...], texts: Mapping[int, bool]
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
        plain = pc.replace_substring(pc.replace_substring(found, form.thousands, ""), form.decimal, ".")
        gone = pc.is_in(found, pa.array(form.missing))
        found = pc.cast(pc.if_else(gone, None, pc.utf8_trim_whitespace(plain)), pa.float64())
    return np.asarray(found.to_numpy(zero_copy_only=False), np.float64)


def _explain(path: Path, form: FileForm, start: int, names: tuple[str, ...], columns: Mapping[int, bool]) -> None:
    """Raises the sentence for the first line that is not of the form."""
    for line, cells in lines(path, form, start):
        place = f"{path} line {line}"
        if len(cells) != len(names):
            raise DataError(f"{place}: {len(cells)} cells where the header has {len(names)}")
        for number in (number for number, text in columns.items() if not text):
            _check_number(f"{place}, column {names[number]}", cells[number].strip(), form)


def lines(path: Path, form: FileForm, start: int) -> Iterator[tuple[int, list[str]]]:
    """Number and cells of each line below the first ``start``, empty ones left out; raises DataError."""
    with open_utf8(path, form.encoding) as file:
        _head(file, start)
        try:
            with io.TextIOWrapper(io.BytesIO(file.read()), "utf-8", newline="") as text:
                reader = csv.reader(text, delimiter=form.delimiter)
                yield from ((start + reader.line_num, cells) for cells in reader if cells)
        except (UnicodeDecodeError, csv.Error, OSError, EOFError) as error:
            raise DataError(f"{path}: {error}; state its encoding, or copy the file again") from error


def _check_number(place: str, text: str, form: FileForm) -> None:
    if text in form.missing:
        return
    try:
        float(text.replace(form.thousands, "").replace(form.decimal, ".") if form.thousands else _pointed(text, form))
    except ValueError as error:
        raise DataError(f"{place}: {text!r} is not a number{_hint(text, form)}") from error


def _pointed(text: str, form: FileForm) -> str:
    if "_" in text or (form.decimal == "," and "." in text):
        raise ValueError(text)
    return text.replace(form.decimal, ".")


def _hint(text: str, form: FileForm) -> str:
    bare = text.lstrip("+-")
    if bare.replace(",", "").replace(".", "").isdigit() and bare.count(",") + bare.count(".") > 1:
        return "; if digits are parted in thousands, state it: thousands = ',' (or '.', with decimal = ',')"
    if form.decimal == "." and bare.replace(",", "", 1).isdigit():
        return "; if this is a decimal comma, state it: decimal = ','"
    return f"; if it says that there is no value, add it: missing = ['', {text!r}]"
