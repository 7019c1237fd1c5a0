"""Forces to follow over time: step, ramp, stairs, sine, a CSV file, and massage techniques on this axis.

A reference is written ``kind:key=value,key=value``; the kind's first key may be given without its name, as in
``step:5``. Each becomes straight lines between (seconds, newtons), a periodic one a single period with its number.
"""

import csv
import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from rig.config.table import Table, parse
from rig.errors import DataError, UsageError

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
POINTS_A_PERIOD = 100
MOST_POINTS = 4000  # half of the largest message to the loop (`rig.channel.MESSAGE_BYTES`), which reads it at rest


@dataclass(frozen=True)
class Reference:
    """Straight lines between points, played ``repeats`` times; two points at one time are a jump."""

    name: str
    times_s: tuple[float, ...]
    forces_N: tuple[float, ...]
    repeats: int = 1
    frequency_Hz: float = 0.0

    @property
    def duration_s(self) -> float:
        """Length of all repeats."""
        return self.times_s[-1] * self.repeats


class Step(Table):
    """Rests at ``base_N`` for a second, then jumps to ``force_N``."""

    kind: ClassVar[str] = "step"
    force_N: Positive
    base_N: Positive = 0.5
    duration_s: Positive = 3.0

    def reference(self) -> Reference:
        """Points of it."""
        times = (0.0, 1.0, 1.0, 1.0 + self.duration_s)
        return Reference(f"step to {self.force_N:g} N", times, (self.base_N, self.base_N, self.force_N, self.force_N))


class Ramp(Table):
    """From ``base_N`` to ``force_N`` at ``rate_N_s``, then holds."""

    kind: ClassVar[str] = "ramp"
    force_N: Positive
    base_N: Positive = 0.5
    rate_N_s: Positive = 1.0
    hold_s: NotNegative = 1.0

    def reference(self) -> Reference:
        """Points of it."""
        ramp_s = abs(self.force_N - self.base_N) / self.rate_N_s
        times = (0.0, ramp_s, ramp_s + self.hold_s)
        return Reference(f"ramp to {self.force_N:g} N", times, (self.base_N, self.force_N, self.force_N))


class Stairs(Table):
    """From ``from_N`` to ``to_N`` in jumps of ``step_N``, ``each_s`` on each."""

    kind: ClassVar[str] = "stairs"
    to_N: Positive
    from_N: Positive = 1.0
    step_N: Positive = 1.0
    each_s: Positive = 1.5

    def reference(self) -> Reference:
        """Points of it."""
        count = math.floor(abs(self.to_N - self.from_N) / self.step_N + 1e-9) + 1
        sign = 1 if self.to_N >= self.from_N else -1
        levels = [self.from_N + sign * i * self.step_N for i in range(count)]
        times = [t * self.each_s for i in range(count) for t in (i, i + 1)]
        forces = [force for level in levels for force in (level, level)]
        return Reference(f"stairs {self.from_N:g} to {levels[-1]:g} N", tuple(times), tuple(forces))


class Sine(Table):
    """A sine about ``mean_N``; also the massage technique of vibrating."""

    kind: ClassVar[str] = "sine"
    amplitude_N: Positive
    mean_N: Positive = 2.0
    frequency_Hz: Positive = 5.0
    duration_s: Positive = 3.0

    @model_validator(mode="after")
    def _presses(self) -> Self:
        if self.amplitude_N >= self.mean_N:
            raise ValueError(
                f"amplitude_N {self.amplitude_N:g} must stay below mean_N {self.mean_N:g}, or contact ends"
            )
        return self

    def reference(self) -> Reference:
        """One period of it and their number."""
        shape = [math.sin(2 * math.pi * i / POINTS_A_PERIOD) for i in range(POINTS_A_PERIOD + 1)]
        name = f"{self.kind} {self.mean_N:g} +- {self.amplitude_N:g} N at {self.frequency_Hz:g} Hz"
        return _periodic(name, self.mean_N, self.amplitude_N, shape, self.frequency_Hz, self.duration_s)


class Vibrate(Sine):
    """Massage: a small fast sine about a mean."""

    kind: ClassVar[str] = "vibrate"
    amplitude_N: Positive = 0.5
    frequency_Hz: Positive = 6.0
    duration_s: Positive = 10.0


class Press(Table):
    """Massage: slow presses from ``base_N`` to ``base_N + amplitude_N``, without rest."""

    kind: ClassVar[str] = "press"
    amplitude_N: Positive
    base_N: Positive = 0.5
    frequency_Hz: Positive = 0.5
    duration_s: Positive = 10.0

    def reference(self) -> Reference:
        """One period of it and their number."""
        shape = [0.5 - 0.5 * math.cos(2 * math.pi * i / POINTS_A_PERIOD) for i in range(POINTS_A_PERIOD + 1)]
        name = f"press {self.base_N:g} to {self.base_N + self.amplitude_N:g} N at {self.frequency_Hz:g} Hz"
        return _periodic(name, self.base_N, self.amplitude_N, shape, self.frequency_Hz, self.duration_s)


class Knead(Table):
    """Massage: presses that stay for the share ``dwell`` of each period, and as long below."""

    kind: ClassVar[str] = "knead"
    amplitude_N: Positive
    base_N: Positive = 0.5
    frequency_Hz: Positive = 0.7
    dwell: float = Field(default=0.3, gt=0, lt=0.5)
    duration_s: Positive = 10.0

    def reference(self) -> Reference:
        """One period of it and their number."""
        shape = [_dwelling(i / POINTS_A_PERIOD, self.dwell) for i in range(POINTS_A_PERIOD + 1)]
        name = f"knead {self.base_N:g} to {self.base_N + self.amplitude_N:g} N at {self.frequency_Hz:g} Hz"
        return _periodic(name, self.base_N, self.amplitude_N, shape, self.frequency_Hz, self.duration_s)


KINDS: dict[str, type[Step | Ramp | Stairs | Sine | Press | Knead]] = {
    kind.kind: kind for kind in (Step, Ramp, Stairs, Sine, Press, Vibrate, Knead)
}


def _dwelling(turn: float, dwell: float) -> float:
    """0 to 1 and back: rise, dwell, fall, rest, with smooth edges; ``turn`` is 0..1 of a period."""
    edge = 0.5 - dwell
    if turn < edge:
        return 0.5 - 0.5 * math.cos(math.pi * turn / edge)
    if turn < edge + dwell:
        return 1.0
    if turn < 2 * edge + dwell:
        return 0.5 + 0.5 * math.cos(math.pi * (turn - edge - dwell) / edge)
    return 0.0


def _periodic(
    name: str, base_N: float, amplitude_N: float, shape: list[float], frequency_Hz: float, duration_s: float
) -> Reference:
    times = tuple(round(i / POINTS_A_PERIOD / frequency_Hz, 7) for i in range(len(shape)))
    forces = tuple(round(base_N + amplitude_N * value, 6) for value in shape)
    return Reference(name, times, forces, max(1, math.ceil(duration_s * frequency_Hz - 1e-9)), frequency_Hz)


def parse_reference(text: str) -> Reference:
    """The reference written ``kind:key=value,...`` or ``csv:FILE``; raises UsageError naming key and bound."""
    kind, _, rest = text.partition(":")
    if kind == "csv":
        return from_csv(Path(rest))
    if kind not in KINDS:
        raise UsageError(f"--reference {text}: {kind!r} is none of {', '.join([*KINDS, 'csv'])}; for example step:5")
    shape = KINDS[kind]
    values: dict[str, float] = {}
    for at, part in enumerate(part for part in rest.split(",") if part):
        key, separator, number = part.partition("=")
        name = key.strip() if separator else (next(iter(shape.model_fields)) if at == 0 else "")
        values[name or part] = _number(number if separator else key, text)
    return parse(shape, values, f"--reference {text}").reference()


def _number(text: str, where: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise UsageError(f"--reference {where}: {text!r} is not a number") from error


def from_csv(path: Path) -> Reference:
    """Columns ``time_s`` and ``force_N`` of a CSV file; raises DataError with line and bound where they cannot be."""
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text"
        raise DataError(f"{path}: cannot be read: {why}") from error
    table = csv.DictReader(lines)
    if not {"time_s", "force_N"} <= set(table.fieldnames or ()):
        found = ", ".join(table.fieldnames or ()) or "none"
        raise DataError(f"{path}: needs columns time_s and force_N in its first line; it has {found}")
    points = [(_cell(path, at, row, "time_s"), _cell(path, at, row, "force_N")) for at, row in enumerate(table, 2)]
    if not 2 <= len(points) <= MOST_POINTS:
        raise DataError(f"{path}: has {len(points)} points; a reference has 2 to {MOST_POINTS}")
    for line, (before, after) in enumerate(pairwise(points), 3):
        if after[0] <= before[0]:
            raise DataError(f"{path}: line {line}: time_s {after[0]:g} does not come after {before[0]:g}; it must grow")
    start_s = points[0][0]
    return Reference(path.name, tuple(t - start_s for t, _ in points), tuple(force for _, force in points))


def _cell(path: Path, line: int, row: dict[str, str | None], name: str) -> float:
    text = row.get(name) or ""
    try:
        value = float(text)
    except ValueError as error:
        raise DataError(f"{path}: line {line}: {name} {text!r} is not a number") from error
    if not math.isfinite(value):
        raise DataError(f"{path}: line {line}: {name} is {text.strip()}; it must be finite")
    return value
