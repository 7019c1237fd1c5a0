"""Tables of a folder that are written alike, and tables side by side in one sheet."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from rig.errors import DataError
from rig.intake.layout import Layout, layouts_of
from rig.intake.mapping import FileForm
from rig.intake.pulling import PULLS, said_of_test
from rig.intake.rates import named_rate_Hz, stated_rate_Hz
from rig.intake.readers import kind_of
from rig.intake.roles import candidates, quantities_of
from rig.intake.survey import Looks, looks_of, texts_of
from rig.intake.units import Meant, meant, unit_in, unit_of

_BRACKETED = re.compile(r"[(\[{][^)\]}]*[^\W\d_][^)\]}]*[)\]}]")
_PARTS = re.compile(r"\d+|[^\W\d_]+")

# Keys of a form that one file of a kind needs, with lines below its table, and that harm no other.
INTERRUPTED = ("other_lines", "repeats")
# What counts the directions of a vector, and of a position with its rotation, from 0.
COMPONENTS = [set("012"), set("012345")]
DIRECTIONS = frozenset("xyz")


class UnitTold(NamedTuple):
    """What is said of a column beside its file: its unit, empty where that is not clear, by whom, and one to ask of."""

    unit: str
    said: str
    example: str


@dataclass(frozen=True)
class ColumnGroup:
    """Columns of a sheet that belong together, by their numbers.

    ``index`` tells it from others beside it, ``called`` is what its place says it is, ``force`` another table's,
    ``said`` what that says of the test, ``told`` by column what is said beside the file.
    """

    path: Path
    layout: Layout
    columns: tuple[int, ...]
    names: tuple[str, ...]
    index: str = ""
    called: str = ""
    force: Looks | None = None
    said: Mapping[str, str] = field(default_factory=dict)
    told: Mapping[int, UnitTold] = field(default_factory=dict)

    @property
    def units(self) -> tuple[str, ...]:
        """The unit of each of its columns, empty where none is stated."""
        return tuple(map(self.unit, self.columns))

    @cached_property
    def looks(self) -> Mapping[int, Looks]:
        """What the numbers of its columns look like, by the numbers of the columns."""
        form = FileForm.model_construct(**self.layout.form)
        found = looks_of(self.layout.sheet, form)
        return {number: looks for number, looks in found.items() if number in self.columns}

    @cached_property
    def texts(self) -> Mapping[int, list[str]]:
        """The columns that hold no numbers, as texts."""
        others = [number for number in self.columns if number not in self.looks]
        return texts_of(self.layout.sheet, others) if others else {}

    @property
    def said_of_test(self) -> dict[str, str]:
        """By what is done in the test, compression or tension, the text that says so, but names of columns."""
        sheet = self.layout.sheet
        return {**said_of_test((self.path.name, sheet.name), sheet.facts), **self.said}

    @property
    def rows(self) -> int:
        """How many it has, of those that were looked at."""
        return max((looks.values.size for looks in self.looks.values()), default=0)

    def fitting(self, quantity: str) -> list[int]:
        """Columns that may be the quantity by word and unit, the likeliest first."""
        return [self.columns[item.column] for item in candidates(quantity, self.names, self.units)]

    def unit(self, column: int) -> str:
        """The unit of a column, by its own words or by those of its place; empty where none is stated."""
        if column in self.told:
            return self.told[column].unit
        sheet = self.layout.sheet  # whose units are empty where a name and the row of units differ
        return sheet.units[column] or ("" if unit_of(sheet.header[column]) else unit_of(self.name(column)))

    def meant(self, quantity: str, column: int, unit: str = "") -> Meant:
        """The units that may be meant by all that is written of a column; none where name and row of units differ."""
        unit = self.unit(column) or unit
        differ = not unit and unit_of(self.layout.sheet.header[column])
        return Meant([], False) if differ else meant(quantity, self.name(column), unit)

    def told_of(self, column: int) -> list[str]:
        """The doubt that says by whom a column's unit is known, or that it is not clear."""
        said = self.told.get(column)
        return [f"{self.path.name}: {self.layout.sheet.header[column]!r} is {said.said}"] if said else []

    def name(self, column: int) -> str:
        """All the words of a column, those of its place as well."""
        return self.names[self.columns.index(column)] if column in self.columns else self.layout.heads[column]

    def place(self, column: int) -> str | int:
        """The column's name where it stands there once, else its number from 1."""
        header = self.layout.sheet.header
        name = header[column]
        return name if header.count(name) == 1 and name != str(column + 1) else column + 1


def tables_of(path: Path) -> list[ColumnGroup]:
    """The tables in the file; raises DataError where it cannot be read."""
    layouts = layouts_of(path) if kind_of(path) else []
    return [_called_by_place(table) for layout in layouts for table in _beside(path, layout)]


def _called_by_place(table: ColumnGroup) -> ColumnGroup:
    """Where the one column beside time has no known word, by its sheet or file: `force.csv` with a `value`."""
    times = [*table.fitting("time"), *table.fitting("counter")]
    values = [number for number in table.columns if number not in times]
    if table.fitting("force") or table.fitting("position") or len(values) != 1:
        return table
    place = re.split(r"[/.]", table.layout.sheet.name)[-1] or table.path.name.partition(".")[0]
    at = table.columns.index(values[0])
    found = replace(table, names=(*table.names[:at], f"{table.names[at]} {place}", *table.names[at + 1 :]))
    return replace(found, called=next((name for name in ("force", "position") if found.fitting(name)), ""))


def _beside(path: Path, layout: Layout) -> list[ColumnGroup]:
    """The tables that stand side by side in a sheet, by what tells their names apart, or names that come again."""
    whole = ColumnGroup(path, layout, tuple(range(len(layout.heads))), layout.heads)
    for parted in (_told_apart(whole), _repeated(layout.sheet.header), _by_quantity(layout.sheet.header)):
        indices = list(dict.fromkeys(index for _, index in parted if index))
        tables = [_part(whole, parted, index) for index in indices]
        full = [table for table in tables if table.fitting("position") and table.fitting("force")]
        if len(full) > 1:
            return full
        if _is_split(tables, parted):
            return tables
    return [whole]


def _by_quantity(header: Sequence[str]) -> list[tuple[str, str]]:
    """Of which quantity each column is by its words, where each has a time so called, as `Time Force`; else of none."""
    said = [quantities_of(name) for name in header]
    timed = all({"time", own} in said for own in ("force", "position"))
    return [(name, "".join(own - {"time"}) if timed else "") for name, own in zip(header, said, strict=True)]


def _is_split(tables: Sequence[ColumnGroup], parted: Sequence[tuple[str, str]]) -> bool:
    """Whether one is a force and the other a position, each with times of its own."""
    held = [[name for name in ("force", "position") if table.fitting(name)] for table in tables]
    return sorted(held) == [["force"], ["position"]] and all(
        any(parted[number][1] for number in (*table.fitting("time"), *_clocks(table))) for table in tables
    )


def _clocks(table: ColumnGroup) -> list[int]:
    """The columns that run like a clock, whatever they are called, as LabVIEW's `X_Value`."""
    return [number for number, looks in table.looks.items() if looks.even]


def _told_apart(whole: ColumnGroup) -> list[tuple[str, str]]:
    """By which number or letter one force and one position differ from others; 0 of names that others number."""
    header = whole.layout.sheet.header
    own = [_own_parts(whole, quantity) for quantity in ("force", "position")]
    indices = set(own[0].values())
    if len(indices) < 2 or len(own[0]) != len(indices) or sorted(own[0].values()) != sorted(own[1].values()):
        return [(name, "") for name in header]
    named = [own[0].get(number) or own[1].get(number) for number in range(len(header))]
    others = [next((index for index in indices if index in parts_of(name)), "") for name in header]
    return [(name, index or other) for name, index, other in zip(header, named, others, strict=True)]


def _own_parts(whole: ColumnGroup, quantity: str) -> dict[int, str]:
    """What the name of each column that may be the quantity has besides what they all have; nothing of directions."""
    header = whole.layout.sheet.header
    found = [item.column for item in candidates(quantity, header, whole.units) if not item.rank[0]]
    parted = {number: parts_of(header[number]) for number in found}
    shared = set(next(iter(parted.values()), [])).intersection(*parted.values())
    own = {number: "".join(part for part in parts if part not in shared) for number, parts in parted.items()}
    indices = set(own.values())
    told = all(index.isdigit() or len(index) < 2 for index in indices)
    vector = indices in COMPONENTS or indices <= DIRECTIONS
    return {number: index or "0" for number, index in own.items()} if told and not vector else {}


def parts_of(name: str) -> list[str]:
    """The words and numbers of a name in small letters, without the unit that it ends in."""
    parts = _PARTS.findall(_BRACKETED.sub(" ", name))
    unit = len(parts) > 1 and not _BRACKETED.search(name) and unit_in(parts[-1]) not in ("", "1")
    return [part.lower() for part in (parts[:-1] if unit else parts)]


def _repeated(header: Sequence[str]) -> list[tuple[str, str]]:
    """Which time a name stands there, and a name that stands there once behind others with those."""
    names, index, found = list(header), "", list[tuple[str, str]]()
    for at, name in enumerate(names):
        index = str(names[: at + 1].count(name)) if names.count(name) > 1 else index
        found.append((name, index))
    return found


def _part(whole: ColumnGroup, parted: Sequence[tuple[str, str]], index: str) -> ColumnGroup:
    """The columns of one index, and those before all of them that have none."""
    columns = tuple(number for number, (_, own) in enumerate(parted) if own in (index, ""))
    return replace(whole, columns=columns, names=tuple(parted[number][0] for number in columns), index=index)


def groups_of(tables: Sequence[ColumnGroup]) -> list[list[ColumnGroup]]:
    """Tables that are written alike and have the same columns, or most of them, together."""
    groups = list[list[ColumnGroup]]()
    for table in tables:
        group = next((group for group in groups if _alike(group[0], table)), None)
        if group is None:
            groups.append([table])
        else:
            group.append(table)
    return [list(_common(group)) for group in groups]


def _alike(one: ColumnGroup, other: ColumnGroup) -> bool:
    ours, theirs = set(_keys(one)), set(_keys(other))
    most_shared = 2 * len(ours & theirs) > max(len(ours), len(theirs))
    same = ours == theirs or (kind_of(one.path) == "arrays" and most_shared)
    return same and _form(one) == _form(other)


def _form(table: ColumnGroup) -> str:
    """How it is written, and what tells it from others of the same columns."""
    form = {key: value for key, value in table.layout.form.items() if key not in INTERRUPTED}
    rates_Hz = stated_rate_Hz(table.layout.sheet.facts), named_rate_Hz(table.path.name)
    told = table.said_of_test.keys() == {PULLS}, () if table.fitting("time") else rates_Hz
    return json.dumps([kind_of(table.path), form, table.index, table.called, told])


def _keys(table: ColumnGroup) -> list[tuple[str, str]]:
    """The name and unit of each column, without what stands above all of them."""
    header = [table.layout.sheet.header[number] for number in table.columns]
    return list(zip(table.names if table.index else header, table.units, strict=True))


def _common(group: Sequence[ColumnGroup]) -> Iterator[ColumnGroup]:
    """The tables with the columns that all of them have."""
    shared = set.intersection(*(set(_keys(table)) for table in group))
    for table in group:
        kept = [at for at, own in enumerate(_keys(table)) if own in shared]
        yield replace(table, columns=tuple(table.columns[k] for k in kept), names=tuple(table.names[k] for k in kept))


def all_tables(paths: Sequence[Path], doubts: list[str]) -> Iterator[ColumnGroup]:
    """The tables of all the files; what cannot be read is a doubt."""
    for path in paths:
        try:
            yield from tables_of(path)
        except DataError as error:
            doubts.append(str(error))
