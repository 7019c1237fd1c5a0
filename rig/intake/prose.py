"""Units that a README beside the data, or a sheet that explains the others of a workbook, says of columns."""

import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from rig.intake.encodings import encoding_of
from rig.intake.families import ColumnGroup, UnitTold
from rig.intake.mapping import FileForm
from rig.intake.measured import chosen
from rig.intake.readers import kind_of, open_sheets
from rig.intake.roles import OTHER, candidates, words_of
from rig.intake.text import lines_in
from rig.intake.units import LINEAR, ROTARY, SIGNALS, UNIT_WORDS, unit_in, unknown_unit
from rig.intake.workbook import sheet_names, sheet_text

MOST_BYTES = 65_536  # what explains columns is read by people
SHORT = 2  # a name of so few letters stands in sentences by chance
MOST_PLACES = 3
QUANTITIES = ("time", "force", "position", "velocity")
# With one of these in it what is said is of the device, and not of what it measured.
_OF_DEVICES = OTHER | {"maximum", "resolution", "range", "accuracy", "capacity", "sensitivity", "noise", "constant"}
_NAMES = r"read.?me|lies.?mich|legend|units?|einheit\w*|info|about|descri\w*|codebook|dict\w*|variables?|columns|notes?"
_TITLE = re.compile(rf"(?<![^\W_])({_NAMES})(?![^\W_])", re.I)
_ENDINGS = ("", ".txt", ".md", ".rst", ".csv", ".tsv")
_TOKEN = re.compile(r"[^\s()\[\]{}<>|;:=,`\"'*]+|[(\[{|;:=,]")
# Between a name and its unit; behind any other word, or a number, what looks like a unit says nothing of a column.
_BEFORE = frozenset(("(", "[", "{", "|", ":", "=", ",", "in", "is", "are", "and", "unit", "units", "as"))
# Beside a column's name, or a quantity's word, these make no other thing of it.
_FILLERS = frozenset(("and", "in", "the", "of", "all", "is", "are", "as", "given", "for", "column", *UNIT_WORDS))


class UnitSaid(NamedTuple):
    """A unit, the words before it since the last one and in the whole line, and where it stands."""

    own: str
    line: str
    unit: str
    place: str

    def names(self, name: str, begins: bool) -> bool:
        """Whether it is said of the column of that name, with which it ``begins``, or which it is."""
        start = self.own.lstrip("-+#.0123456789 ")
        if begins or len(name) <= SHORT:
            return start == name or start.startswith(f"{name} ")
        return _bare(start) == _bare(name)

    def measures(self, quantity: str, alone: bool) -> bool:
        """Whether it is of all that is the quantity, by word or of whatever has a unit; ``alone``: by no other word."""
        said = self.own if len(words_of(self.own)) > self.own.split().count("and") else self.line
        others = [word for word in _bare(said) if alone and not unit_in(word)]
        is_other = not all(any(candidates(each, [word], [""]) for each in QUANTITIES) for word in others)
        by_word = bool(candidates(quantity, [said], [""]) or UNIT_WORDS & set(words_of(self.line)))
        return self.unit in _units(quantity) and by_word and not is_other


def _bare(text: str) -> list[str]:
    words = re.findall(r"[^\W_]+", text.lower())
    return [word for word in words if word not in _FILLERS] or words


def with_prose(tables: Iterable[ColumnGroup], top: Path) -> Iterator[ColumnGroup]:
    """The tables with the units that are said of their columns beside them, in the nearest folder up to ``top``."""
    tables = list(tables)
    measured = {table.path for table in tables if _TITLE.search(table.path.stem) and chosen(table)}
    read, own = cache(partial(_in_folder, measured)), cache(_in_file)
    for table in tables:
        folder, found = table.path.parent, dict[int, UnitTold]()
        folders = [each for each in (folder, *folder.parents) if each == folder or each.is_relative_to(top)]
        for statements in (_above(table), own(table.path), *map(read, folders)):
            found = {**dict(_told(table, statements)), **found}
        yield replace(table, told=found) if found else table


def _told(table: ColumnGroup, statements: Sequence[UnitSaid]) -> Iterator[tuple[int, UnitTold]]:
    """By column the unit that is said of it, none where two are said, or another than its own."""
    for number in table.columns if statements else ():
        own = table.unit(number)
        fitting = [quantity for quantity in QUANTITIES if candidates(quantity, [table.name(number)], [own])]
        sizes = {unit: size for quantity in fitting or QUANTITIES for unit, size in _units(quantity).items()}
        found, loose = _said_of(table, number, fitting, [one for one in statements if one.unit in (*sizes, *SIGNALS)])
        units = [*filter(None, [own]), *(one.unit for one in found)]
        is_clear = len({sizes.get(unit, unit) for unit in units}) == 1
        if (found or loose) and (not own or not (is_clear or "time" in fitting)):
            yield number, _worded(own, found, loose, units[0] if is_clear else "")


def _said_of(
    table: ColumnGroup, number: int, fitting: Sequence[str], statements: Sequence[UnitSaid]
) -> tuple[list[UnitSaid], list[UnitSaid]]:
    """What is said of a column by its name, or else of all that measures its quantity; and what may be said of that."""
    own, heads = table.unit(number), table.layout.sheet.header[number]
    name = " ".join(token for token in _TOKEN.findall(heads) if token[1:] or token.isalnum())
    name = name.removesuffix(own).rstrip(" _") if own else name
    found = [one for one in statements if name and one.names(name, not fitting)]
    if found or own or unknown_unit(table.layout.heads[number]):
        return found, []
    loose = [one for one in statements if any(one.measures(each, alone=False) for each in fitting)]
    return [one for one in loose if any(one.measures(each, alone=True) for each in fitting)], loose


def _worded(own: str, found: Sequence[UnitSaid], loose: Sequence[UnitSaid], unit: str) -> UnitTold:
    """The ``own`` unit of a column or the one ``unit`` that is said of it, with the words for what is said."""
    said = list(dict.fromkeys(f"{one.unit} by {one.place}" for one in found or loose))[:MOST_PLACES]
    said = [f"{own} by its header", *said] if own else said
    how = "taken to be " if own or unit else "" if found else "perhaps "
    return UnitTold(own or unit, f"{how}in {' and in '.join(said)}", "" if found else loose[0].unit)


def _units(quantity: str) -> Mapping[str, tuple[bool, float]]:
    """What each unit of the quantity comes to, and whether it turns."""
    kinds = (LINEAR[quantity], ROTARY.get(quantity, {}))
    return {unit: (bool(turns), size) for turns, known in enumerate(kinds) for unit, size in known.items()}


def _in_folder(measured: Container[Path], folder: Path) -> tuple[UnitSaid, ...]:
    found = list[UnitSaid]()
    for path in sorted(folder.iterdir()):
        is_named = _TITLE.search(path.stem) and path.suffix.lower() in _ENDINGS and path not in measured
        with suppress(OSError):  # what nobody may read explains nothing
            if is_named and path.is_file() and path.stat().st_size <= MOST_BYTES:
                found += _in_text(path.name, path.read_bytes())
    return tuple(found)


def _above(table: ColumnGroup) -> tuple[UnitSaid, ...]:
    """What comments above the table say of columns that carry no unit; settings of units there are asked about."""
    form, source = FileForm.model_construct(**table.layout.form), table.layout.source
    if kind_of(table.path) != "text" or form.section or all(table.units):
        return ()
    with lines_in(source, form) as file:
        above = b"".join(islice(file, max(form.header_row - 1, 0)))
    said = b"\n".join(line if line.startswith((b"#", b"%", b"//")) else b"" for line in above.splitlines())
    return tuple(one for one in _in_text(table.path.name, said) if UNIT_WORDS.isdisjoint(words_of(one.line)))


def _in_file(path: Path) -> tuple[UnitSaid, ...]:
    """What sheets of a workbook, or a struct of texts in a file of arrays, say of the others."""
    if kind_of(path) == "arrays" and path.suffix.lower() == ".mat":
        sheets = [sheet for _, sheet in open_sheets(path, FileForm.model_construct(sheets="**/*"))]
        facts = [
            (sheet.name, fact) for sheet in sheets if sheet.name.lower() in UNIT_WORDS for fact in sheet.facts.items()
        ]
        return tuple(UnitSaid(name, name, unit_in(said), f"{path.name}, {at}") for at, (name, said) in facts)
    if kind_of(path) != "workbook":
        return ()
    titles = [name for name in sheet_names(path) if _TITLE.search(name)]
    return tuple(said for name in titles for said in _in_text(f"{path.name}, {name}", sheet_text(path, name, ".")))


def _in_text(place: str, content: bytes) -> Iterator[UnitSaid]:
    text = content[:MOST_BYTES].decode(encoding_of(content[:MOST_BYTES])[0] or "utf-8", errors="replace")
    for number, line in enumerate(text.splitlines(), 1):
        yield from _in_line(f"{place} line {number}", _TOKEN.findall(line))


def _in_line(place: str, tokens: Sequence[str]) -> Iterator[UnitSaid]:
    start = 0
    for at in range(1, len(tokens)):
        counts = tokens[at + 1 : at + 2] == ["="]
        unit = unit_in(" ".join(tokens[at : at + 2])) or unit_in(tokens[at])
        between = tokens[at] in _BEFORE and tokens[at - 1] not in ("(", "[")
        if unit in ("", "1", "%") or between or counts or tokens[at - 1].lower() not in _BEFORE:
            continue
        words = " ".join(token for token in tokens[start:at] if token[1:] or token.isalnum())
        if _OF_DEVICES.isdisjoint(words_of(words)):
            yield UnitSaid(words, " ".join(tokens[:at]), unit, place)
        start = at + 1
