"""How the rows of a file nobody described are written: encoding, delimiter, decimal sign, header and unit rows."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import islice, zip_longest
from pathlib import Path
from typing import NamedTuple

from rig.config.table import TomlTable
from rig.errors import DataError
from rig.intake.cells import NO_VALUE, Affixed, above_columns, affixed, cells_of, is_value, with_comments
from rig.intake.edited import joined, loosened
from rig.intake.encodings import HEAD_ROWS, encoding_of
from rig.intake.headings import Headings, headings_of
from rig.intake.interruptions import interruptions_of
from rig.intake.long import by_channel
from rig.intake.mapping import FileForm, LongForm
from rig.intake.notation import Notation, notation_of, parts_thousands
from rig.intake.readers import kind_of, open_sheets
from rig.intake.roles import WORDS, candidates, knows, words_of
from rig.intake.sheet import DAMAGE, Sheet, Source, unreadable
from rig.intake.survey import texts_of
from rig.intake.text import bytes_of, lines_in, open_texts, refuse_units, section_in, sections_in
from rig.intake.units import UNIT_WORDS, unit_in, unit_of
from rig.intake.workbook import hidden_sheets, sheet_names

# Read of a text to see how it is written: preambles are shorter.
HEAD_BYTES = 65_536
DELIMITERS = ("\t", ";", ",", "|", " ")
LEAST_ROWS = 2  # the least that has a rate
# By chance two numbers stand at the same places in a few lines of words.
LABELLED_ROWS = 8
# A table of so few rows may lie across; a quantity each is fewer.
ACROSS_ROWS = 100
# Force and a way at least: words for fewer may be there by chance.
QUANTITIES = 2
# Parted by the wrong sign, half of the cells are numbers by chance; by the right one all but texts and labels are.
SURE_SHARE = 0.75
# A row for each value has its time, channel, value and unit, and what the whole is called.
WIDEST_LONG = 12
VALUES = frozenset(("value", "wert", "reading", "messwert", "data", "val", "valeur"))
# Where more of the lines are none of the table, it is another table than was thought.
OTHER_SHARE = 0.1


class Layout(NamedTuple):
    """Of one sheet the keys of its form, all words above each column, doubts, and which lines are no rows."""

    sheet: Sheet
    source: Source
    form: TomlTable
    heads: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    broken: str = ""


class Found(NamedTuple):
    """The rows of data in a piece of text or a sheet, what stands above them, and the share of numbers."""

    form: TomlTable
    headings: Headings
    notation: Notation
    share: float


def layouts_of(path: Path) -> list[Layout]:
    """Every sheet of the file that holds a table; raises DataError where the file cannot be read."""
    return [long for layout in _layouts(path) for long in _by_channel(layout)]


def _by_channel(layout: Layout) -> list[Layout]:
    """The table as it is, or those of its channels, where it has a row for each value."""
    if candidates("force", layout.heads, layout.sheet.units) or len(layout.heads) > WIDEST_LONG:
        return [layout]
    form = _long_form(layout.sheet)
    if form is None:
        return [layout]
    key = {"long": form.model_dump(exclude_none=True)}
    sheets = by_channel(layout.sheet, form)
    return [layout._replace(sheet=sheet, form=layout.form | key, heads=sheet.header) for sheet in sheets]


def _long_form(sheet: Sheet) -> LongForm | None:
    """The form of a sheet in which one column says of what a row is, a force or a way among others."""
    texts = {number: list(dict.fromkeys(own)) for number, own in texts_of(sheet, range(len(sheet.header))).items()}
    units = _called(sheet, UNIT_WORDS)
    told = [number for number, names in texts.items() if number not in units and _are_channels(names)]
    values = [number for number in _called(sheet, VALUES) if number not in told]
    units = [number for number in units if all(map(unit_in, texts[number]))]
    if len(told) != 1 or len(values) != 1:
        return None
    return LongForm(channel=told[0] + 1, value=values[0] + 1, unit=units[0] + 1 if units else None)


def _called(sheet: Sheet, words: frozenset[str]) -> list[int]:
    return [number for number, name in enumerate(sheet.header) if words & set(words_of(name))]


def _are_channels(names: Sequence[str]) -> bool:
    units = list(map(unit_of, names))
    found = [{item.column for item in candidates(quantity, names, units)} for quantity in ("force", "position")]
    return all(found) and len(found[0] | found[1]) > 1


def _layouts(path: Path) -> list[Layout]:
    kind = kind_of(path)
    if kind == "text":
        sections = sections_in(path)
        found = {name: _of_text(Source(path), name) for name in sections if len(sections) > 1}
        return [layout for layouts in found.values() for layout in layouts] or _of_text(Source(path))
    if kind == "workbook":
        hidden = hidden_sheets(path)
        found = {name: _of_text(Source(path, name)) for name in sheet_names(path)}
        seen = [layout for name, layouts in found.items() if name not in hidden for layout in layouts]
        return seen or [layout for layouts in found.values() for layout in layouts]
    if kind != "arrays":
        return []
    opened = [sheet for _, sheet in open_sheets(path, FileForm.model_construct(sheets="**/*"))]
    sheets = [sheet for sheet in opened if sheet.header]
    if not sheets and any(sheet.unread for sheet in opened):
        raise DataError("; ".join(said for sheet in opened for said in _unread(sheet)))
    return [Layout(sheet, Source(path, sheet.name), {}, sheet.header, _unread(sheet)) for sheet in sheets]


def _unread(sheet: Sheet) -> tuple[str, ...]:
    return (f"{sheet.path.name}{sheet.unread}".replace(";", ":", 1),) if sheet.unread else ()


def _of_text(source: Source, section: str = "") -> list[Layout]:
    lines, encoding, doubts = _beginning(source, section)
    signs = ("",) if source.sheet else DELIMITERS
    best = _best([found for sign in signs for found in _parted(lines, sign)])
    if best is None or _understood(best)[0] < QUANTITIES:
        best = next(_lying_across(source, encoding, signs), best)
    if best is None:
        return []
    form: TomlTable = ({"encoding": encoding} if encoding != "utf-8" else {}) | best.form
    form |= {"section": section} if section else {}
    more, said = ({}, "") if section else _between(source, form)
    first, *later = sheets = open_texts(source, FileForm.model_construct(**form, **more))
    for sheet in later:
        refuse_units(sheet.place(0), sheet.units, first.header, first.units)
    shown = {best.notation.unsure: "is read with a decimal comma; it may part thousands"}
    shown[best.notation.minus] = "has a sign that is no hyphen; it is read as a minus"
    doubts = (*doubts, *(f"{source.path.name}: {cell!r} {how}" for cell, how in shown.items() if cell))
    heads = best.headings.heads
    padded = [tuple([*heads, *sheet.header[len(heads) :]][: len(sheet.header)]) for sheet in sheets]
    return [Layout(sheet, source, form | more, own, doubts, said) for sheet, own in zip(sheets, padded, strict=True)]


def _beginning(source: Source, section: str = "") -> tuple[list[str], str, tuple[str, ...]]:
    """The first lines, without one that is cut, their encoding, and what is doubtful in it."""
    if section:
        part = section_in(source, FileForm.model_construct(section=section, header_row=0))
        return joined(_decoded(source, "utf-8", part.start, part.end)[:HEAD_ROWS]), "utf-8", ()
    if source.sheet:
        return _decoded(source, "utf-8", 0, HEAD_ROWS), "utf-8", ()
    try:
        with bytes_of(source.path) as file:
            head = file.read(HEAD_BYTES)
    except DAMAGE as error:
        raise unreadable(source.path, "text", error) from error
    if b"\r" in head and b"\n" not in head:
        raise DataError(f"{source}: its lines end as old Macs wrote them; save it with the line ends of today")
    encoding, doubts = encoding_of(head)
    if not encoding:
        raise DataError(f"{source}: its bytes are not those of a text; copy it again, or save it as CSV or xlsx")
    lines = head.decode(encoding, errors="replace").removeprefix("\ufeff").splitlines()[:HEAD_ROWS]
    whole = lines[:-1] if len(head) == HEAD_BYTES and len(lines) < HEAD_ROWS else lines
    return joined(whole), encoding, doubts


def _decoded(source: Source, encoding: str, start: int, end: int | None) -> list[str]:
    with lines_in(source, FileForm.model_construct(encoding=encoding)) as file:
        return [line.decode(errors="replace").rstrip("\r\n") for line in islice(file, start, end)]


def _lying_across(source: Source, encoding: str, signs: Sequence[str]) -> Iterator[Found]:
    """The table in the columns of a text of few lines, each of them a quantity."""
    lines = _decoded(source, encoding, 0, ACROSS_ROWS + 1)
    for sign in signs if len(lines) <= ACROSS_ROWS else ():
        turned = zip_longest(*(cells_of(line, sign) for line in lines), fillvalue="")
        found = _of_rows(list(islice(turned, HEAD_ROWS)), sign)
        if found is not None and _understood(found)[0] >= QUANTITIES:
            yield found._replace(form={**found.form, "across": True})


def _parted(lines: Sequence[str], sign: str) -> list[Found]:
    """The table that the lines hold where ``sign`` parts their cells, as they stand and freed of names and units."""
    plain = [cells_of(line, sign) for line in lines]
    found = _of_rows(plain, sign, lines)
    if found is not None and found.share == 1.0:
        return [found]
    loose = [loosened(line, sign) for line in lines]
    parted = [cells_of(line, sign) for line in loose]
    freed = _of_rows([[affixed(cell).number for cell in row] for row in parted], sign, loose, parted)
    return [item for item in (found, freed) if item is not None]


def _best(found: Sequence[Found]) -> Found | None:
    """The one in which most quantities are found, of those with the most numbers; blanks only where no sign does."""
    share = max((item.share for item in found), default=0.0)
    sure = [item for item in found if item.share >= SURE_SHARE * share]
    signs = [item for item in sure if item.form.get("delimiter") != " " and len(item.headings.heads) > 1]
    widest = max((len(item.headings.heads) for item in signs), default=0)
    kept = [item for item in sure if item in signs or len(item.headings.heads) > widest]
    return max(kept or sure, key=_understood, default=None)


def _between(source: Source, form: TomlTable) -> tuple[TomlTable, str]:
    """The keys for lines that are no rows of the table, unless they are many, and the doubt that says so."""
    found = interruptions_of(source, FileForm.model_construct(**form))
    if found.headers:
        said = f"its row of names comes {found.headers + 1} times; what stands below each is a recording of its own"
        said = f"{source.path.name}: {said}; if they are one, take repeats out"
        return {"repeats": True, "other_lines": "drop"}, said
    said = f"{found.text[:40]!r} is no row of the table, as {found.others} in all; they are left out"
    if found.gap and not (found.another or found.others):
        said = f"{source._replace(path=Path(source.path.name)).line(found.gap)}: rows go on below an empty line"
        return {}, f"{said}; if they are another table, save it as a file of its own"
    if found.another:
        said = f"{found.text[:40]!r} begins another table, which is not read; save it as a file of its own"
    elif not 0 < found.others <= OTHER_SHARE * found.lines:
        return {}, ""
    return {"other_lines": "drop"}, f"{source._replace(path=Path(source.path.name)).line(found.line)}: {said}"


def _understood(found: Found) -> tuple[int, int]:
    """How many quantities are found in it, and how many columns."""
    heads, units = found.headings.heads, found.headings.units
    return sum(bool(candidates(quantity, heads, units)) for quantity in WORDS), len(heads)


def _of_rows(
    rows: Sequence[Sequence[str]], delimiter: str, lines: Sequence[str] = (), affixed_rows: Sequence[Sequence[str]] = ()
) -> Found | None:
    """The longest run of rows with numbers and equally many cells, and what stands above it; None without one.

    ``lines`` are the rows of a text as they stand, ``affixed_rows`` their cells with names and units.
    """
    rows = with_comments(rows)
    kinds = [_kind(row, delimiter) for row in rows]
    longest, end = _longest(kinds)
    if end - longest < LEAST_ROWS:
        kinds = _labelled(rows)
        longest, end = _longest(kinds)
    if end - longest < LEAST_ROWS:
        return None
    start = _begins(rows, kinds, longest)
    data = [row for row, kind in zip(rows[start:end], kinds[start:end], strict=True) if kind == kinds[longest]]
    used = sorted(sum(map(bool, row)) for row in data)[len(data) // 2]
    above = [above_columns(line, delimiter, lines[start]) for line in lines[:start]] if lines else rows[:start]
    headings = headings_of(above, len(data[0]), used)
    at = headings.header_row - 1  # and its names may stand further above for the first time
    sooner = at - list(rows).index(rows[at]) if lines and at >= 0 else 0
    headings = headings.moved(-sooner)
    if affixed_rows:
        headings = _from_cells(headings, [affixed(cell) for cell in affixed_rows[start]])
    notation = notation_of(cell for row in data for cell in row)
    if notation.unsure and parts_thousands(zip(*data, strict=False)):
        notation = Notation(".", ",", minus=notation.minus)
    form: TomlTable = {"delimiter": delimiter} if delimiter else {}
    form |= {"affixes": True} if affixed_rows else {}
    form |= {"decimal": ","} if notation.decimal == "," else {}
    form |= {"thousands": notation.thousands} if notation.thousands else {}
    form |= {"exponent": "D"} if notation.exponent == "D" else {}
    form |= {"minus": "\u2212"} if notation.minus else {}
    place = {"header_row": headings.header_row, "unit_row": headings.unit_row}
    place |= {"first_row": start - sooner + 1} if start - sooner != max(place.values()) else {}
    return Found({**form, **place}, headings, notation, _share(data))


def _begins(rows: Sequence[Sequence[str]], kinds: Sequence[int], longest: int) -> int:
    """Where the table begins whose longest run of rows is known: above lines between its rows that are no names."""
    start = longest
    for at in range(longest - 1, -1, -1):
        if kinds[at] == kinds[longest]:
            start = at
        elif sum(map(bool, rows[at])) > 1 and any(map(knows, rows[at])):
            break
    return start


def _from_cells(headings: Headings, cells: Sequence[Affixed]) -> Headings:
    """With the names and units in the cells where none stand above them."""
    heads = [cell.name or head for cell, head in zip(cells, headings.heads, strict=True)]
    units = [unit or unit_in(cell.unit) for cell, unit in zip(cells, headings.units, strict=True)]
    return headings._replace(heads=headings.heads if headings.header_row else tuple(heads), units=tuple(units))


def _share(rows: Sequence[Sequence[str]]) -> float:
    """How many of the cells that say something are numbers or times."""
    filled = [cell for row in rows for cell in row if cell and cell.lower() not in NO_VALUE]
    return sum(map(is_value, filled)) / max(1, len(filled))


def _kind(row: Sequence[str], delimiter: str) -> int:
    """How many cells a row of data has; 0 for a row of anything else."""
    filled = [cell for cell in row if cell and cell.lower() not in NO_VALUE]
    least = 1 if delimiter == "" else min(2, len(row))
    numbers = sum(map(is_value, filled))
    return len(row) if numbers >= least and 2 * numbers >= len(filled) else 0


def _labelled(rows: Sequence[Sequence[str]]) -> list[int]:
    """As ``_kind`` for rows that say in words what they are of, with numbers in the places where most have them."""
    places = [tuple(at for at, cell in enumerate(row) if is_value(cell)) for row in rows]
    often = Counter((len(row), own) for row, own in zip(rows, places, strict=True) if len(own) > 1)
    (kind, times), *_ = often.most_common(1) or [((0, ()), 0)]
    alike = [(len(row), own) == kind for row, own in zip(rows, places, strict=True)]
    return [kind[0] if same and times >= LABELLED_ROWS else 0 for same in alike]


def _longest(kinds: Sequence[int]) -> tuple[int, int]:
    best, start = (0, 0), 0
    for at in range(len(kinds) + 1):
        if at == len(kinds) or kinds[at] != kinds[start]:
            best = max(best, (start, at), key=lambda span: span[1] - span[0] if kinds and kinds[span[0]] else 0)
            start = at
    return best if kinds and kinds[best[0]] else (0, 0)
