"""A mapping: what the files of a laboratory hold, as a TOML table that is proposed, edited and used again."""

import datetime
import re
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from rig.config.table import Table, TomlTable

Place = Annotated[str, Field(min_length=1)] | Annotated[int, Field(ge=1)]
"""A column by its name in the header, or by its number counted from 1."""
Positive = Annotated[float, Field(gt=0)]
Facts = TomlTable | str
MAPPING_FILE = "mapping.toml"
Quantity = Literal["force", "position", "velocity", "current", "temperature", "x", "y", "z", "tool", "arrival"]
_FORCE_WORDS = {
    1: ("compression", "compressive", "push", "pushing"),
    -1: ("tension", "tensile", "pull", "pulling"),
}
_POSITION_WORDS = {
    1: ("into", "in", "inward", "inwards", "into tissue", "down", "downward", "downwards"),
    -1: ("out", "outward", "outwards", "out of tissue", "away", "away from tissue", "up", "upward", "upwards"),
}


def _sense(value: object) -> int:
    """``value`` as 1 (our convention) or -1: one of the words, or 1, -1, true, false."""
    if isinstance(value, bool | int) and value in (True, False, 1, -1):
        return 1 if value == 1 else -1
    said = " ".join(word for word in re.split(r"[\s_-]+", str(value).lower()) if word != "the")
    for sense in (1, -1):
        if said in (*_FORCE_WORDS[sense], *_POSITION_WORDS[sense]):
            return sense
    raise ValueError("write compression or tension of a force, into or out of a position")


Sense = Annotated[Literal[1, -1], BeforeValidator(_sense)]


class TimeColumn(Table):
    """Where time is: a column of numbers in ``unit``, of ISO texts, of spreadsheet days, or a counter at a rate.

    Without ``column`` rows are counted, at ``rate_Hz``.
    """

    column: Place | None = None
    form: Literal["number", "iso", "spreadsheet", "counter"] = "number"
    unit: str = ""
    rate_Hz: Positive | None = None

    @model_validator(mode="after")
    def _counted(self) -> "TimeColumn":
        if (self.column is None or self.form == "counter") and self.rate_Hz is None:
            raise ValueError("rows and counters need their rate, for example rate_Hz = 1000.0")
        return self


class ValueColumn(Table):
    """A column of numbers. In the project's unit it is ``positive * (scale * number + offset)``.

    ``unit`` gives the scale where it is a unit of the quantity, and is read from the file where it is not given;
    ``sign_bit`` is of numbers whose sign stands in that bit; at and beyond ``saturates`` the number is not valid.
    """

    column: Place
    unit: str = ""
    scale: float | None = None
    offset: float = 0.0
    positive: Sense = 1
    sign_bit: int | None = Field(default=None, ge=1, le=52)
    saturates: tuple[float, float] | None = None


class FileForm(Table):
    """Files of one kind: which, and how their rows are written.

    ``files`` is a pattern, or several, below the folder; ``{name}`` in it names what tells them apart. ``sheets`` is
    one of the sheets of a workbook, the groups of an HDF5 file, the structs of a MAT file, the topics of an MCAP file.
    ``header_row`` and ``unit_row`` count from 1; 0 where there is none. ``label`` is a column whose text tells
    recordings apart, ``labels`` adds names to those of the patterns.
    ``disorder = "drop"`` leaves out rows whose time is not after all before it.
    """

    files: str | tuple[str, ...]
    sheets: str | tuple[str, ...] = "*"
    encoding: str = "utf-8"
    delimiter: str = Field(default=",", min_length=1, max_length=1)
    decimal: Literal[".", ","] = "."
    thousands: str = Field(default="", max_length=1)
    header_row: int = Field(default=1, ge=0)
    unit_row: int = Field(default=0, ge=0)
    missing: tuple[str, ...] = ("", "nan", "NaN", "NAN", "MISSING")
    label: Place | None = None
    labels: dict[str, str] = Field(default_factory=dict)
    disorder: Literal["refuse", "drop"] = "refuse"
    lever_mm: Positive | None = None
    time: TimeColumn
    columns: dict[Quantity, ValueColumn] = Field(min_length=1)


class RecordingFacts(Table):
    """What somebody states of a recording."""

    speed_mm_s: Positive | None = None
    depth_mm: Positive | None = None
    surface_mm: float | None = Field(default=None, description="as the files count positions, in mm")
    temperature_C: float | None = None
    outcome: str = "imported"
    notes: Facts = Field(default_factory=dict)


class SessionFacts(Table):
    """What somebody states of the whole. What is no key here belongs under ``subject`` or ``notes``."""

    id: str = ""
    name: str = ""
    description: str = ""
    operator: str = ""
    site: str = ""
    date: datetime.date | datetime.datetime | str = ""
    temperature_C: float | None = None
    tip_diameter_mm: Positive | None = None
    subject: Facts = Field(default_factory=dict)
    notes: Facts = Field(default_factory=dict)


class DataMapping(Table):
    """How a folder becomes a session.

    ``recording``, ``specimen``, ``site`` and ``cycle`` are templates over the names in the patterns and ``{file}``,
    ``{folder}``, ``{sheet}``, ``{label}``; what tables share a recording's name is one recording. ``recordings`` holds
    facts by name, ``stated`` those of all others.
    """

    recording: str = ""
    specimen: str = ""
    site: str = ""
    cycle: str = ""
    session: SessionFacts = SessionFacts()
    stated: RecordingFacts = RecordingFacts()
    recordings: dict[str, RecordingFacts] = Field(default_factory=dict)
    tables: tuple[FileForm, ...] = Field(min_length=1)

    def facts_of(self, recording: str) -> RecordingFacts:
        """What is stated of the recording, and of all where nothing is stated of it."""
        own = self.recordings.get(recording, RecordingFacts())
        return self.stated.model_copy(update={name: getattr(own, name) for name in own.model_fields_set})

    def sense(self, quantity: Quantity) -> int:
        """1 where the files count the quantity as we do, -1 where the other way."""
        return next((form.columns[quantity].positive for form in self.tables if quantity in form.columns), 1)

    def surface_of(self, facts: RecordingFacts) -> float | None:
        """Position of the surface [mm] into the tissue, where somebody stated it."""
        return None if facts.surface_mm is None else self.sense("position") * facts.surface_mm
