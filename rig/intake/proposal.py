"""A mapping proposed for a folder nobody described, with what is doubtful in it and what cannot be known."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rig.config.table import TomlTable, parse
from rig.errors import DataError, UsageError
from rig.intake.folder import files_in
from rig.intake.layout import Layout, layouts_of
from rig.intake.mapping import FileForm
from rig.intake.readers import kind_of, open_sheets
from rig.intake.roles import candidates
from rig.intake.rows import pieces
from rig.intake.units import LINEAR

USUAL = {"time": "s", "force": "N", "position": "mm"}
Group = list[tuple[Path, Layout]]


@dataclass(frozen=True)
class OpenQuestion:
    """What the data cannot say. ``key`` is where the answer stands in the mapping, ``usual`` the likeliest answer."""

    text: str
    key: tuple[str | int, ...]
    usual: str | float

    @property
    def line(self) -> str:
        """The line of the mapping that answers it."""
        place = ".".join(str(part) for part in self.key if not isinstance(part, int))
        return f"{place} = {json.dumps(self.usual)}"

    def answer(self, tree: TomlTable, said: str) -> None:
        """Puts the answer into the mapping; raises UsageError where a number is needed and none was said."""
        table: Any = tree
        for part in self.key[:-1]:
            table = table[part]
        try:
            table[self.key[-1]] = type(self.usual)(said)
        except ValueError as error:
            raise UsageError(f"{said!r} is no number; {self.text}") from error


@dataclass(frozen=True)
class Proposal:
    """A mapping as a table of TOML, what is doubtful in it, and what is still to be answered."""

    tree: TomlTable
    doubts: tuple[str, ...]
    questions: tuple[OpenQuestion, ...]

    @property
    def text(self) -> str:
        """The mapping as a file."""
        head = [f"# doubtful: {doubt}" for doubt in self.doubts]
        head += [f"# open: {question.text}; {question.line}" for question in self.questions]
        session = "\n".join(f"{key} = {_inline(value)}" for key, value in self.tree.items() if key != "tables")
        tables = [_table(table) for table in self.tree["tables"]]
        return "\n".join([*head, session, *tables])


def propose(folder: Path) -> Proposal:
    """What the folder seems to hold; raises DataError where nothing in it has a force and a position in one table."""
    groups, doubts = _groups(folder)
    if not groups:
        raise DataError(f"{folder}: no table with force and position was found in it; write a mapping by hand")
    tables, questions = list[TomlTable](), list[OpenQuestion]()
    for number, group in enumerate(groups):
        table, said, asked = _proposed(folder, group, number)
        tables.append(table)
        doubts += said
        questions += asked
    stems = [path.name for group in groups for path in {path for path, _ in group}]
    tree: TomlTable = {} if len(stems) == len(set(stems)) else {"recording": "{folder}-{file}"}
    return Proposal({**tree, "tables": tables}, tuple(doubts), tuple(questions))


def _groups(folder: Path) -> tuple[list[Group], list[str]]:
    """Sheets that are written alike, together; those without force and position are left out and said."""
    groups: dict[str, Group] = {}
    doubts = list[str]()
    for path in files_in(folder):
        layouts = _layouts(path, doubts) if kind_of(path) else []
        for layout in layouts:
            if _columns(layout).keys() >= {"force", "position"}:
                key = json.dumps([kind_of(path), layout.form, layout.header, layout.units])
                groups.setdefault(key, []).append((path, layout))
    timed = [group for group in groups.values() if "time" in _columns(group[0][1])]
    return timed or list(groups.values()), doubts


def _layouts(path: Path, doubts: list[str]) -> list[Layout]:
    try:
        return layouts_of(path)
    except DataError as error:
        doubts.append(str(error))
        return []


def _columns(layout: Layout) -> dict[str, int]:
    found = {
        quantity: candidates(quantity, layout.header, layout.units)
        for quantity in ("time", "force", "position", "label")
    }
    return {quantity: items[0].column for quantity, items in found.items() if items}


def _proposed(folder: Path, group: Group, number: int) -> tuple[TomlTable, list[str], list[OpenQuestion]]:
    layout = group[0][1]
    columns = _columns(layout)
    table: TomlTable = {"files": _files(folder, group), **_sheets(group), **layout.form}
    table["time"] = _time(layout, columns)
    if "label" in columns:
        table["label"] = _named(layout, columns["label"])
    table["columns"] = {key: _value(layout, columns[key]) for key in ("force", "position")}
    path = group[0][0]
    senses = _senses(path, table)
    for key, sense in senses.items():
        table["columns"][key]["positive"] = sense
    return table, [*layout.doubts, *_doubts(layout, path, senses)], list(_questions(layout, columns, table, number))


def _files(folder: Path, group: Group) -> str | list[str]:
    """A pattern that names these files and no others of the folder, or their list."""
    chosen = {path for path, _ in group}
    suffixes = {"".join(path.suffixes[-2:]) if path.suffix == ".gz" else path.suffix for path in chosen}
    if folder.is_dir() and len(suffixes) == 1:
        (suffix,) = suffixes
        if {path for path in files_in(folder) if path.name.endswith(suffix)} == chosen:
            return f"**/*{suffix}"
    return sorted(path.name if folder.is_file() else path.relative_to(folder).as_posix() for path in chosen)


def _sheets(group: Group) -> TomlTable:
    names = list(dict.fromkeys(layout.sheet for _, layout in group if layout.sheet))
    return {"sheets": names} if names else {}


def _named(layout: Layout, column: int) -> str | int:
    name = layout.header[column]
    return name if layout.header.count(name) == 1 and name != str(column + 1) else column + 1


def _value(layout: Layout, column: int) -> TomlTable:
    unit = layout.units[column]
    return {"column": _named(layout, column), **({"unit": unit} if unit else {})}


def _time(layout: Layout, columns: Mapping[str, int]) -> TomlTable:
    if "time" not in columns:
        return {}
    first = layout.first[columns["time"]] if layout.first else ""
    iso = len(first) > 10 and first[:4].isdigit() and first[4] == "-"
    found = _value(layout, columns["time"])
    return {"column": found["column"], "form": "iso"} if iso else found


def _doubts(layout: Layout, path: Path, senses: Mapping[str, str]) -> Iterator[str]:
    for quantity in ("time", "force", "position"):
        found = candidates(quantity, layout.header, layout.units)
        rivals = [layout.header[item.column] for item in found[1:] if item.rank[0] == found[0].rank[0]]
        if rivals:
            taken = layout.header[found[0].column]
            yield f"{path.name}: {quantity} is taken to be {taken!r}; it may be {', '.join(map(repr, rivals))}"
    said = ", ".join(f"positive {quantity} as {sense}" for quantity, sense in senses.items())
    yield f"{path.name}: {said}, as if pressed; pulled, write the other of compression and tension, into and out"


def _senses(path: Path, table: TomlTable) -> dict[str, str]:
    """The senses in which the largest force is compression and lies deeper than the start; ours where none is seen."""
    try:
        _, sheet = next(iter(open_sheets(path, parse(FileForm, table, path.name))))
        values = next(pieces(sheet, parse(FileForm, table, path.name))).values
    except UsageError:
        return {"force": "compression", "position": "into"}
    force, position = (np.nan_to_num(values[quantity]) for quantity in ("force", "position"))
    risen = force - np.median(force[: max(1, force.size // 10)])
    most = int(np.argmax(np.abs(risen)))
    return {
        "force": "tension" if risen[most] < 0 else "compression",
        "position": "out" if position[most] < position[0] else "into",
    }


def _questions(layout: Layout, columns: Mapping[str, int], table: TomlTable, number: int) -> Iterator[OpenQuestion]:
    if "time" not in columns:
        yield OpenQuestion(
            "no column of time; at what rate are the rows, in Hz?", ("tables", number, "time", "rate_Hz"), 0.0
        )
    for quantity in ("time", "force", "position"):
        iso = quantity == "time" and table["time"].get("form") == "iso"
        if quantity in columns and not layout.units[columns[quantity]] and not iso:
            place: tuple[str | int, ...] = ("time",) if quantity == "time" else ("columns", quantity)
            units = ", ".join(LINEAR[quantity])
            text = f"nothing says the unit of {quantity} ({layout.header[columns[quantity]]!r}); one of {units}"
            yield OpenQuestion(text, ("tables", number, *place, "unit"), USUAL[quantity])


def _table(table: TomlTable) -> str:
    return "\n".join(["\n[[tables]]", *(f"{key} = {_inline(value)}" for key, value in table.items())]) + "\n"


def _inline(value: object) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_inline(item)}" for key, item in value.items()) + " }"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(map(_inline, value)) + "]"
    return json.dumps(value, ensure_ascii=False)
