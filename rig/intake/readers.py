"""Which reader a file has."""

from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path

from rig.errors import DataError
from rig.intake.long import by_channel
from rig.intake.mapping import FileForm
from rig.intake.pattern import matched
from rig.intake.sheet import Sheet, Source
from rig.intake.text import open_texts
from rig.intake.workbook import sheet_names

WORKBOOKS = (".xls", ".xlsx", ".xlsm", ".xlsb", ".ods")
# Besides plain ones: LabVIEW (lvm), Zwick (tra), MTS and Instron (raw), Windows printing to a file (prn).
TEXTS = (".csv", ".txt", ".tsv", ".dat", ".asc", ".tab", ".log", ".lvm", ".tra", ".raw", ".prn", ".ascii", ".out")
# Texts without a table; one may stand in those of any other ending.
NO_TABLES = (".json", ".xml", ".html", ".htm", ".md", ".py", ".m", ".r", ".toml", ".yaml", ".yml", ".svg", ".tex")
# By the name of their function in `rig.intake.arrays`, whose libraries take as long to load as a small text to import.
ARRAYS = {
    **dict.fromkeys((".h5", ".hdf5", ".hdf", ".nc"), "open_hdf5"), ".mat": "open_mat", ".parquet": "open_parquet",
    ".mcap": "open_mcap", ".jsonl": "open_json_lines", ".ndjson": "open_json_lines",
}  # fmt: skip


def kind_of(path: Path) -> str:
    """``text``, ``workbook``, ``arrays``, or empty where no reader takes the file."""
    suffix = _suffix(path)
    if suffix in (*TEXTS, *ARRAYS, *NO_TABLES):
        packed = path.suffix == ".gz" and ARRAYS.get(suffix) != "open_json_lines"
        return "text" if suffix in TEXTS else "arrays" if suffix in ARRAYS and not packed else ""
    return "text" if _is_text(path) else "workbook" if suffix in WORKBOOKS else ""


def _suffix(path: Path) -> str:
    return (path.with_suffix("") if path.suffix == ".gz" else path).suffix.lower()


def _is_text(path: Path) -> bool:
    """Whether what is no text by its name is one, as many programs write tabs for spreadsheets to open."""
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError:
        return False
    return head.startswith((b"\xff\xfe", b"\xfe\xff")) or (b"\n" in head and b"\0" not in head and head[:1] != b"<")


def open_sheets(path: Path, form: FileForm) -> Iterable[tuple[dict[str, str], Sheet]]:
    """The sheets that ``form`` names, with what stands in the places of its pattern; raises DataError."""
    kind = kind_of(path)
    if form.long is not None:
        whole = open_sheets(path, form.model_copy(update={"long": None, "sheets": "**/*"}))
        sheets = [long for _, sheet in whole for long in by_channel(sheet, form.long)]
        chosen = _named(form, sheets)
    elif kind == "text":
        chosen = _named(form, open_texts(Source(path), form))
    elif kind == "workbook":
        names = [(name, matched(form.sheets, name)) for name in sheet_names(path)]
        books = [(Source(path, name), labels) for name, labels in names if labels is not None]
        chosen = [(labels, sheet) for source, labels in books for sheet in open_texts(source, form)]
    elif kind == "arrays":
        found = [(matched(form.sheets, sheet.name), sheet) for sheet in _array_sheets(path)]
        chosen = [(labels, sheet) for labels, sheet in found if labels is not None]
    else:
        raise DataError(f"{path}: no reader for {path.suffix or 'this'}; leave it out of the pattern or unpack it")
    if not chosen:
        raise DataError(f"{path}: none of its sheets is of the pattern {form.sheets!r}")
    yield from chosen


def _named(form: FileForm, sheets: Iterable[Sheet]) -> list[tuple[dict[str, str], Sheet]]:
    """Those that ``form`` names; one without a name is all that there is."""
    found = [(matched(form.sheets, sheet.name) if sheet.name else {}, sheet) for sheet in sheets]
    return [(labels, sheet) for labels, sheet in found if labels is not None]


def _array_sheets(path: Path) -> list[Sheet]:
    read: Callable[[Path], list[Sheet]] = vars(import_module("rig.intake.arrays"))[ARRAYS[_suffix(path)]]
    return read(path)
