"""What an import folder may say: the keys of ``session.toml`` and ``trial.toml``, and the columns of the CSV files."""

import datetime
import re
from collections.abc import Iterable
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from rig.config.table import Table, TomlTable
from rig.errors import UsageError
from rig.recording.csv_columns import TIME, TOOL

FIELDS = {
    "force": (TIME, "force_N"),
    "axis": (TIME, "position_mm"),
    "marker": (TIME, "x_mm", "y_mm", "z_mm"),
}
OPTIONAL = ("marker",)
# Columns of a file that `rig export` wrote; read where all of a stream's are there.
EXPORTED = {"force": ("capture_ns", "arrival_ns"), "axis": ("capture_ns", "arrival_ns"), "marker": (TOOL,)}
_FORCE_WORDS = {
    1: ("compression", "compressive", "push", "pushing"),
    -1: ("tension", "tensile", "pull", "pulling"),
}
_POSITION_WORDS = {
    1: ("into", "in", "inward", "inwards", "into tissue", "down", "downward", "downwards"),
    -1: ("out", "outward", "outwards", "out of tissue", "away", "away from tissue", "up", "upward", "upwards"),
}


def _sense(words: dict[int, tuple[str, ...]], value: object) -> int:
    """``value`` as 1 (our convention) or -1: one of ``words``, or 1, -1, true, false."""
    if isinstance(value, bool | int) and value in (True, False, 1, -1):
        return 1 if value == 1 else -1
    said = " ".join(word for word in re.split(r"[\s_-]+", str(value).lower()) if word != "the")
    for sense, accepted in words.items():
        if said in accepted:
            return sense
    raise ValueError(f"write {words[1][0]!r} (the default) or {words[-1][0]!r}")


ForceSense = Annotated[Literal[1, -1], BeforeValidator(lambda value: _sense(_FORCE_WORDS, value))]
PositionSense = Annotated[Literal[1, -1], BeforeValidator(lambda value: _sense(_POSITION_WORDS, value))]
Positive = Annotated[float, Field(gt=0)]
Facts = TomlTable | str


class SessionTable(Table):
    """``session.toml``. What is no key here belongs under ``[subject]`` or ``[notes]``, where any key may stand."""

    id: str = ""
    name: str = ""
    description: str = ""
    operator: str = ""
    site: str = ""
    date: datetime.date | datetime.datetime | str = ""
    temperature_C: float | None = None
    tip_diameter_mm: Positive | None = None
    force_positive: ForceSense = 1
    position_positive: PositionSense = 1
    surface_mm: float | None = Field(default=None, description="position of the surface, as the files count positions")
    subject: Facts = Field(default_factory=dict)
    notes: Facts = Field(default_factory=dict)


class TrialTable(Table):
    """``trial.toml``."""

    speed_mm_s: Positive
    depth_mm: Positive
    name: str = ""
    index: int | None = None
    outcome: str = "imported"
    surface_mm: float | None = None
    temperature_C: float | None = None
    notes: Facts = Field(default_factory=dict)


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
