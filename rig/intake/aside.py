"""What of a folder nobody described is not read, and why."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from rig.errors import DataError
from rig.intake.families import ColumnGroup
from rig.intake.folder import below, listed
from rig.intake.measured import chosen
from rig.intake.readers import kind_of
from rig.intake.workbook import hidden_sheets, sheet_names

Group = Sequence[ColumnGroup]
WAYS = ("position", "velocity")
# Of tables and of files that were not read so many are named.
MOST_NAMED = 3


def nothing_found(folder: Path, files: Sequence[Path], groups: Sequence[Group], doubts: Sequence[str]) -> DataError:
    """The sentence that says what was looked at instead, and the next step."""
    tables = [group[0] for group in groups]
    seen = [f"{below(folder, table.path)} has columns {listed(list(map(repr, table.names)))}" for table in tables]
    held = {table.path for group in groups for table in group}
    texts = [below(folder, path) for path in files if kind_of(path) and path not in held]
    others = [below(folder, path) for path in files if not kind_of(path)]
    doubts = [*doubts, *dict.fromkeys(doubt for table in tables for doubt in table.layout.doubts)]
    why = [
        *doubts[:MOST_NAMED],
        *seen[:MOST_NAMED],
        *([f"no rows of numbers in {listed(texts)}"] if texts and not doubts else []),
        *([f"no reader for {listed(others)}: save as CSV, xlsx, MAT, HDF5 or Parquet"] if others else []),
    ]
    said = "; ".join(why) or "there is no file"
    return DataError(
        f"{folder}: no table with force and position was found in it ({said}); name their columns in a mapping, as "
        "docs/how-to/own-data.md shows, and give it with --mapping"
    )


def untimed(groups: Sequence[Group], taken: Sequence[ColumnGroup]) -> Iterator[str]:
    """Tables with force and a way beside those that are taken, whose time is not known."""
    places = {(table.layout.sheet.where, table.index) for table in taken}
    for group in groups:
        found = chosen(group[0])
        own = (group[0].layout.sheet.where, group[0].index)
        if own not in places and "force" in found and not found.keys().isdisjoint(WAYS):
            yield f"left aside, no time in it: {own[0]}" + (f", {own[1]}" if own[1] else "")


def left_aside(folder: Path, files: Sequence[Path], taken: Sequence[ColumnGroup]) -> Iterator[str]:
    """Which files and sheets are not read, and why."""
    used = dict.fromkeys(table.path for table in taken)
    unread = [path for path in files if path not in used]
    named = [below(folder, path) for path in unread if kind_of(path)]
    if named:
        yield f"left aside, no table with force and position: {listed(named)}"
    others = [below(folder, path) for path in unread if not kind_of(path)]
    if others:
        yield f"left aside, no reader for them: {listed(others)}"
    for path in (path for path in used if kind_of(path) == "workbook"):
        read = {table.layout.source.sheet for table in taken if table.path == path}
        hidden = hidden_sheets(path) - read
        sheets = [name for name in sheet_names(path) if name not in read | hidden]
        if sheets:
            yield f"left aside in {below(folder, path)}, no table with force and position: {listed(sheets)}"
        if hidden:
            yield f"left aside in {below(folder, path)}, hidden by its maker: {listed(sorted(hidden))}"
