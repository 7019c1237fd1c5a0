"""The columns of a folder of CSV files as `rig export` writes them and a diagnosis reads them."""

from collections.abc import Iterable

from rig.errors import UsageError

TIME, TOOL = "time_s", "tool"
FIELDS = {
    "force": (TIME, "force_N"),
    "axis": (TIME, "position_mm"),
    "marker": (TIME, "x_mm", "y_mm", "z_mm"),
}
OPTIONAL = ("marker",)
# Columns of a file that `rig export` wrote; read where all of a stream's are there.
EXPORTED = {"force": ("capture_ns", "arrival_ns"), "axis": ("capture_ns", "arrival_ns"), "marker": (TOOL,)}


def column_names(columns: Iterable[str]) -> dict[str, dict[str, str]]:
    """Header name by stream and field, from ``[STREAM.]FIELD=HEADER``."""
    names = {stream: {field: field for field in fields} for stream, fields in FIELDS.items()}
    for column in columns:
        key, separator, header = column.partition("=")
        stream, dot, field = key.strip().rpartition(".")
        chosen = [name for name, fields in FIELDS.items() if field in fields and stream in (name, "")]
        if not separator or not header.strip() or not chosen or (dot and not stream):
            valid = ", ".join(f"{name}.{item}" for name, fields in FIELDS.items() for item in fields)
            raise UsageError(f"--columns {column}: write FIELD=HEADER with one of {valid}, or {TIME}=HEADER for all")
        for name in chosen:
            names[name][field] = header.strip()
    return names
