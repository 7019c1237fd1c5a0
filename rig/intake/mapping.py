"""A mapping: what the files of a laboratory hold, as a TOML table that is proposed, edited and used again."""

import datetime
import math
import re
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, model_validator

from rig.config.table import Table, TomlTable

# Stands in a line of a mapping for what nobody has said yet: no number, so that it cannot be taken for an answer.
UNSAID = "?"


def _said(value: object) -> object:
    if value == UNSAID:
        raise ValueError(f"this is still open: write what is true in place of {UNSAID!r}")
    return value


Said = BeforeValidator(_said)
Place = Annotated[Annotated[str, Field(min_length=1)] | Annotated[int, Field(ge=1)], Said]
"""A column by its name in the header, or by its number counted from 1."""
Positive = Annotated[float, Field(gt=0)]
Facts = TomlTable | str
RESTART = "restart"
MAPPING_FILE = "mapping.toml"
Quantity = Literal[
    "force", "position", "velocity", "current", "temperature", "x", "y", "z", "tool", "arrival", "sync",
    "setpoint", "excitation", "load_position",
]  # fmt: skip
_FORCE_WORDS = {1: ("compression", "compressive", "push", "pushing"), -1: ("tension", "tensile", "pull", "pulling")}
_POSITION_WORDS = {
    1: ("into", "in", "inward", "inwards", "into tissue", "down", "downward", "downwards"),
    -1: ("out", "outward", "outwards", "out of tissue", "away", "away from tissue", "up", "upward", "upwards"),
}
_LABEL = re.compile(r"\{\w+\}")
_NUMBER = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?")


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


def _stated(value: object) -> float | str:
    if isinstance(value, str) and _LABEL.search(value):
        return value
    if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    raise ValueError("write a number, or a text with labels in it, as in '{speed} mm/min'")


def _above_zero(value: float | str) -> float | str:
    if not isinstance(value, str) and value <= 0:
        raise ValueError("it should be greater than 0")
    return value


Stated = Annotated[float | str, PlainValidator(_stated, json_schema_input_type=float | str)]
"""A number, or a text with labels in it, as in ``{speed} mm/min``; without a unit in the project's own."""
StatedPositive = Annotated[Stated, AfterValidator(_above_zero)]


class TimeColumn(Table):
    """Where time is: a column of numbers in ``unit``, of ISO texts, of days, or a counter at a rate.

    Days are a spreadsheet's, or MATLAB's from year 0 (``datenum``). ``form`` may be how texts are written instead, as
    `strptime` has it (``%H:%M:%S.%f``, ``%d.%m.%Y %H:%M:%S``).
    Without ``column`` rows are counted, at ``rate_Hz``. ``finer`` is a column of what ``column`` leaves out, in
    ``finer_unit``, as nanoseconds beside whole seconds; a counter that begins anew does so at ``wraps_at``.
    """

    column: Place | None = None
    finer: Place | None = None
    finer_unit: Literal["ms", "us", "ns"] = "ns"
    wraps_at: Positive | None = None
    form: Literal["number", "iso", "spreadsheet", "datenum", "counter"] | Annotated[str, Field(pattern="%")] = "number"
    unit: str = ""
    rate_Hz: Annotated[Positive | None, Said] = None

    @model_validator(mode="after")
    def _counted(self) -> "TimeColumn":
        if (self.column is None or self.form == "counter") and self.rate_Hz is None:
            raise ValueError("rows and counters need their rate, for example rate_Hz = 1000.0")
        return self


class ValueColumn(Table):
    """A column of numbers. In the project's unit it is ``positive * (scale * number + offset)``.

    ``unit`` gives the scale where it is a unit of the quantity, and is read from the file where it is not given;
    ``sign_bit`` is of numbers whose sign stands in that bit, ``bits`` of numbers of so many bits that are negative from
    half of their range on (65535 is -1 of 16), ``sign`` a column whose texts have the signs that ``signs`` says; at and
    beyond ``saturates`` the number is not valid.
    """

    column: Place
    unit: Annotated[str, Said] = ""
    scale: Annotated[float | None, Said] = None
    offset: float = 0.0
    positive: Sense = 1
    sign_bit: int | None = Field(default=None, ge=1, le=52)
    bits: int | None = Field(default=None, ge=2, le=52)
    sign: Place | None = None
    signs: dict[str, Literal[1, -1]] = Field(default_factory=dict)
    saturates: tuple[float, float] | None = None


class LongForm(Table):
    """A table with a row for each value: which column says of what it is, which holds it, which its unit."""

    channel: Place
    value: Place
    unit: Place | None = None


class FileForm(Table):
    """Files of one kind: which, and how their rows are written.

    ``files`` is a pattern, or several, below the folder; ``{name}`` in it names what tells them apart. ``sheets`` is
    one of the sheets of a workbook, the groups of an HDF5 file, the structs of a MAT file, the topics of an MCAP file.
    ``header_row`` and ``unit_row`` count from 1; 0 where there is none; the data begin in
    ``first_row``, or below both. ``across`` turns rows into columns before they are counted.
    ``label`` is a column whose text tells recordings apart, or several by what they are called in templates; ``labels``
    adds names to those of the patterns, ``facts`` what stands above a table or beside its vectors under these names.
    ``missing`` are texts, and numbers, that stand for none.
    ``disorder = "drop"`` leaves out rows whose time is not after all before it, with ``"restart"`` another recording
    begins there, whose number ``{restart}`` ends its name; ``other_lines = "drop"`` lines of a
    text that are no rows, between them and below. With ``repeats`` a table begins wherever the row of names comes
    again, called by its number in ``{sheet}``; with ``affixes`` cells have a name before or a unit behind their number
    (``F:1.2 N``), rows brackets around them or an arrow in them. With ``section`` the table stands below the line that
    is this text, from which rows are counted, and ends at an empty line; with ``long`` it has a row for each value.
    ``exponent = "D"`` is as Fortran writes, ``minus = "−"`` with another sign than a hyphen. ``clock = "own"`` says
    that times are another clock's than those of the recording's other tables: they are brought onto it where the data
    say how, within ``clock_within_ms`` where that is given, and else kept apart.
    """

    files: str | tuple[str, ...]
    sheets: str | tuple[str, ...] = "*"
    encoding: str = "utf-8"
    delimiter: str = Field(default=",", min_length=1, max_length=1)
    decimal: Literal[".", ","] = "."
    thousands: str = Field(default="", max_length=1)
    exponent: Literal["E", "D"] = "E"
    minus: Literal["-", "\u2212"] = "-"
    header_row: int = Field(default=1, ge=0)
    unit_row: int = Field(default=0, ge=0)
    first_row: int = Field(default=0, ge=0)
    across: bool = False
    missing: tuple[str, ...] = ("", "nan", "NaN", "NAN", "MISSING")
    label: Place | dict[str, Place] | None = None
    labels: dict[str, str] = Field(default_factory=dict)
    facts: dict[str, str] = Field(default_factory=dict)
    disorder: Literal["refuse", "drop", "restart"] = "refuse"
    other_lines: Literal["refuse", "drop"] = "refuse"
    repeats: bool = False
    affixes: bool = False
    section: str = ""
    long: LongForm | None = None
    lever_mm: Positive | None = None
    clock: Literal["shared", "own"] = "shared"
    clock_within_ms: Positive | None = None
    time: TimeColumn
    columns: dict[Quantity, ValueColumn] = Field(min_length=1)

    @property
    def rows_above(self) -> int:
        """How many rows stand above the data."""
        return self.first_row - 1 if self.first_row else max(self.header_row, self.unit_row)

    @property
    def label_columns(self) -> dict[str, Place]:
        """The columns of labels, by what they are called."""
        if isinstance(self.label, dict):
            return self.label
        return {} if self.label is None else {"label": self.label}

    @property
    def row_labels(self) -> tuple[str, ...]:
        """What tells rows of a table apart: columns of labels, and where time begins anew."""
        return (*self.label_columns, *((RESTART,) if self.disorder == RESTART else ()))

    @property
    def missing_numbers(self) -> list[float]:
        """The numbers that stand for none."""
        return [float(text) for text in self.missing if _NUMBER.fullmatch(text)]


class RecordingFacts(Table):
    """What somebody states of a recording: numbers, or templates over its labels, with a unit where it is another."""

    speed_mm_s: StatedPositive | None = None
    depth_mm: StatedPositive | None = None
    surface_mm: Stated | None = Field(default=None, description="as the files count positions, in mm")
    temperature_C: Stated | None = None
    operator: str = Field(default="", description="a name, or a template")
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


class Controller(Table):
    """The drive's own loop, in the units of the axis and of its control signal.

    Velocity wanted is ``position_gain_per_s`` times what lacks to the set-point; the control signal is
    ``velocity_gain`` times what lacks to that velocity, and the excitation, within plus and minus ``limit``; the effort
    is ``effort_per_control`` times it. Velocity is the backward difference over ``velocity_samples`` samples.
    """

    position_gain_per_s: Positive
    velocity_gain: Positive
    effort_per_control: Positive = 1.0
    limit: Positive | None = None
    velocity_samples: int = Field(default=1, ge=1, le=100)


class AxisFacts(Table):
    """What makes of a folder that of a drive axis, without tissue.

    ``effort`` is the quantity that drives it, in ``effort_unit`` where its column states none. ``known`` are the causes
    that the simulation has in it already. Recordings whose names match ``left_out`` are predicted and never fitted.
    """

    effort: Literal["force", "current"] = "force"
    effort_unit: str = ""
    known: tuple[str, ...] = ()
    left_out: str | tuple[str, ...] = ()
    controller: Controller | None = None


class DataMapping(Table):
    """How a folder becomes a session.

    ``recording``, ``specimen``, ``site`` and ``cycle`` are templates over the names in the patterns and ``{file}``,
    ``{folder}``, ``{sheet}``, ``{label}``; what tables share a recording's name is one recording. ``recordings`` holds
    facts by name, ``stated`` those of all others. ``axis`` is there where `rig diagnose` is to judge a drive axis.
    """

    recording: str = ""
    specimen: str = ""
    site: str = ""
    cycle: str = ""
    session: SessionFacts = SessionFacts()
    stated: RecordingFacts = RecordingFacts()
    recordings: dict[str, RecordingFacts] = Field(default_factory=dict)
    axis: Annotated[AxisFacts | None, Said] = None
    tables: tuple[FileForm, ...] = Field(min_length=1)

    def facts_of(self, recording: str) -> RecordingFacts:
        """What is stated of the recording, and of all where nothing is stated of it."""
        own = self.recordings.get(recording, RecordingFacts())
        return self.stated.model_copy(update={name: getattr(own, name) for name in own.model_fields_set})

    def sense(self, quantity: Quantity) -> int:
        """1 where the files count the quantity as we do, -1 where the other way."""
        return next((form.columns[quantity].positive for form in self.tables if quantity in form.columns), 1)
