"""Which tables of which files in a folder are of which recording."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from rig.errors import DataError
from rig.intake.mapping import RESTART, DataMapping, FileForm
from rig.intake.pattern import filled, matched
from rig.intake.readers import kind_of, open_sheets
from rig.intake.sheet import Sheet, unreadable

# Hidden files, and those by which Excel keeps others from a workbook that is open.
OF_PROGRAMS = (".", "~$")


class FoundTable(NamedTuple):
    """One table of the folder: its sheet, how it is read, and what tells it apart."""

    sheet: Sheet
    form: FileForm
    labels: Mapping[str, str]


def files_in(folder: Path) -> list[Path]:
    """Every file below ``folder``, or the one file it is, in natural order, but hidden ones; raises DataError."""
    try:
        if folder.is_file():
            return [folder]
        if not folder.is_dir():
            raise DataError(f"{folder}: no such file or folder; give the one that holds the data")
        found = [path for path in _below_all(folder) if path.is_file() and not path.name.startswith(OF_PROGRAMS)]
    except PermissionError as error:
        raise unreadable(Path(error.filename), "a folder", error) from error
    return sorted(found, key=lambda path: natural(path.relative_to(folder).as_posix()))


def _below_all(folder: Path) -> Iterator[Path]:
    """Everything below the folder; raises PermissionError where `Path.rglob` would leave out a folder silently."""

    def refuse(error: OSError) -> None:
        raise error

    return (Path(place, name) for place, _, names in os.walk(folder, onerror=refuse) for name in names)


def natural(text: str) -> list[tuple[int, str]]:
    """A key that sorts 2 before 10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", text)]


def tables_in(folder: Path, mapping: DataMapping) -> Iterator[FoundTable]:
    """Every table the mapping names; raises DataError where one of its patterns names no file."""
    files = files_in(folder)
    for form in mapping.tables:
        chosen = [(path, matched(form.files, below(folder, path))) for path in files]
        named = [(path, labels) for path, labels in chosen if labels is not None]
        if not named:
            there = listed([below(folder, path) for path in files]) or "none at all"
            raise DataError(f"{folder}: no file is of the pattern {form.files!r}; there are {there}")
        for path, labels in named:
            own = {"file": path.name.removesuffix(".gz").rpartition(".")[0], "folder": path.parent.name}
            for more, sheet in open_sheets(path, form):
                facts = {name: _fact(sheet, fact) for name, fact in form.facts.items()}
                yield FoundTable(sheet, form, {**own, "sheet": sheet.name, **form.labels, **facts, **labels, **more})


def _fact(sheet: Sheet, name: str) -> str:
    if name not in sheet.facts:
        there = listed(list(sheet.facts)) or "nothing at all"
        raise DataError(f"{sheet.where}: nothing states its {name!r}, as `facts` of the mapping says; there is {there}")
    return sheet.facts[name]


def unnamed_in(folder: Path, mapping: DataMapping) -> list[str]:
    """Data files that no pattern of the mapping names."""
    names = [below(folder, path) for path in files_in(folder) if kind_of(path)]
    return [name for name in names if all(matched(form.files, name) is None for form in mapping.tables)]


def below(folder: Path, path: Path) -> str:
    """The file as patterns name it: its path below the folder."""
    return path.name if path == folder else path.relative_to(folder).as_posix()


def listed(names: Sequence[str]) -> str:
    """The first five, and how many more there are."""
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")


def labels_of(table: FoundTable, labels: Mapping[str, str], mapping: DataMapping) -> dict[str, str]:
    """The labels of rows that have these, what their recording is called, and its specimen, site and cycle."""
    known, where = {**table.labels, **labels}, table.sheet.where
    sheets = "-{sheet}" if table.sheet.name else ""
    name = mapping.recording or ("{label}" if "label" in labels else "{file}" + sheets)
    name += "-{restart}" if RESTART in labels and "{restart}" not in name else ""
    templates = {"recording": name, "specimen": mapping.specimen, "site": mapping.site, "cycle": mapping.cycle}
    return known | {key: filled(template, known, where) for key, template in templates.items() if template}


def file_name(recording: str) -> str:
    """The recording's name as that of a file, on any system."""
    return re.sub(r"[^\w.+-]+", "_", recording).strip("._-") or "recording"
