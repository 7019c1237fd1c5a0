"""Which tables of which files in a folder are of which recording."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from rig.errors import DataError
from rig.intake.mapping import DataMapping, FileForm
from rig.intake.pattern import filled, matched
from rig.intake.readers import kind_of, open_sheets
from rig.intake.sheet import Sheet


class FoundTable(NamedTuple):
    """One table of the folder: its sheet, how it is read, and what tells it apart."""

    sheet: Sheet
    form: FileForm
    labels: Mapping[str, str]


def files_in(folder: Path) -> list[Path]:
    """Every file below ``folder``, or the one file it is, in natural order, but hidden ones; raises DataError."""
    if folder.is_file():
        return [folder]
    if not folder.is_dir():
        raise DataError(f"{folder}: no such folder; give the folder, or the file, that holds the data")
    found = (path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))
    return sorted(found, key=lambda path: natural(path.relative_to(folder).as_posix()))


def natural(text: str) -> list[tuple[int, str]]:
    """A key that sorts 2 before 10."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", text)]


def tables_in(folder: Path, mapping: DataMapping) -> Iterator[FoundTable]:
    """Every table the mapping names; raises DataError where one of its patterns names no file."""
    files = files_in(folder)
    for form in mapping.tables:
        chosen = [(path, matched(form.files, _below(folder, path))) for path in files]
        named = [(path, labels) for path, labels in chosen if labels is not None]
        if not named:
            raise DataError(f"{folder}: no file is of the pattern {form.files!r}; there are {_shown(folder, files)}")
        for path, labels in named:
            own = {"file": path.name.removesuffix(".gz").rpartition(".")[0], "folder": path.parent.name}
            for more, sheet in open_sheets(path, form):
                yield FoundTable(sheet, form, {**own, "sheet": sheet.name, **form.labels, **labels, **more})


def unnamed_in(folder: Path, mapping: DataMapping) -> list[str]:
    """Data files that no pattern of the mapping names."""
    names = [_below(folder, path) for path in files_in(folder) if kind_of(path)]
    return [name for name in names if all(matched(form.files, name) is None for form in mapping.tables)]


def _below(folder: Path, path: Path) -> str:
    return path.name if path == folder else path.relative_to(folder).as_posix()


def _shown(folder: Path, files: list[Path]) -> str:
    names = [_below(folder, path) for path in files]
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "") or "none at all"


def labels_of(table: FoundTable, label: str, mapping: DataMapping) -> dict[str, str]:
    """What the recording of these rows is called, and its specimen, site and cycle where the mapping says them."""
    known, where = {**table.labels, "label": label}, table.sheet.where
    sheets = "-{sheet}" if table.sheet.name else ""
    name = mapping.recording or ("{label}" if table.form.label is not None else "{file}" + sheets)
    found = {"recording": filled(name, known, where)}
    for key in ("specimen", "site", "cycle"):
        template = getattr(mapping, key)
        if template:
            found[key] = filled(template, known, where)
    return found


def file_name(recording: str) -> str:
    """The recording's name as that of a file, on any system."""
    return re.sub(r"[^\w.+-]+", "_", recording).strip("._") or "recording"
