"""Which reader a file has."""

from collections.abc import Iterable
from pathlib import Path

from rig.errors import DataError
from rig.intake.arrays import open_hdf5, open_mat, open_mcap, open_parquet
from rig.intake.mapping import FileForm
from rig.intake.pattern import matched
from rig.intake.sheet import Sheet
from rig.intake.text import open_text
from rig.intake.workbook import open_sheet, sheet_names

WORKBOOKS = (".xls", ".xlsx", ".xlsm", ".xlsb", ".ods")
TEXTS = (".csv", ".txt", ".tsv", ".dat", ".asc", ".tab", ".log")
ARRAYS = {
    ".mat": open_mat, ".h5": open_hdf5, ".hdf5": open_hdf5, ".hdf": open_hdf5, ".parquet": open_parquet,
    ".mcap": open_mcap,
}  # fmt: skip


def kind_of(path: Path) -> str:
    """``text``, ``workbook``, ``arrays``, or empty where no reader takes the file."""
    suffix = (path.with_suffix("") if path.suffix == ".gz" else path).suffix.lower()
    return "text" if suffix in TEXTS else "workbook" if suffix in WORKBOOKS else "arrays" if suffix in ARRAYS else ""


def open_sheets(path: Path, form: FileForm) -> Iterable[tuple[dict[str, str], Sheet]]:
    """The sheets that ``form`` names, with what stands in the places of its pattern; raises DataError."""
    kind = kind_of(path)
    if kind == "text":
        yield {}, open_text(path, form)
        return
    if kind == "workbook":
        names = [(name, matched(form.sheets, name)) for name in sheet_names(path)]
        chosen = [(labels, open_sheet(path, name, form)) for name, labels in names if labels is not None]
    elif kind == "arrays":
        sheets = ARRAYS[path.suffix.lower()](path)
        found = [(matched(form.sheets, sheet.name), sheet) for sheet in sheets]
        chosen = [(labels, sheet) for labels, sheet in found if labels is not None]
    else:
        raise DataError(
            f"{path}: no reader for {path.suffix or 'a file without a suffix'}; leave it out of the pattern"
        )
    if not chosen:
        raise DataError(f"{path}: none of its sheets is of the pattern {form.sheets!r}")
    yield from chosen
