"""What is stated of a recording, its templates filled with the labels of its file names and columns."""

import math
import re
from collections.abc import Mapping
from typing import NamedTuple

from rig.config.table import TomlTable
from rig.errors import DataError
from rig.intake.mapping import Facts, RecordingFacts
from rig.intake.pattern import filled
from rig.intake.units import factor_of, unit_in

# What each stated number is a measure of, and so which units it may have.
QUANTITIES = {
    "speed_mm_s": "velocity", "depth_mm": "position", "surface_mm": "position", "temperature_C": "temperature",
}  # fmt: skip
_NAMES = re.compile(r"\{(\w+)")
_MEASURE = re.compile(r"([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(.*)")


class StatedFacts(NamedTuple):
    """Numbers in the project's units, NaN where nobody states one, ``surface_mm`` as the files count; and texts."""

    speed_mm_s: float
    depth_mm: float
    surface_mm: float
    temperature_C: float
    operator: str
    outcome: str
    notes: Facts

    @property
    def more(self) -> TomlTable:
        """What has no place of its own in a recording, where it is stated."""
        found = {"temperature_C": self.temperature_C, "outcome": self.outcome, "notes": self.notes}
        usual = (math.isnan(self.temperature_C), self.outcome == "imported", not self.notes)
        return {name: value for (name, value), left_out in zip(found.items(), usual, strict=True) if not left_out}


def stated_of(facts: RecordingFacts, labels: Mapping[str, str], where: str) -> StatedFacts:
    """The facts of a recording with these labels; raises DataError or UsageError naming ``where`` and the key."""
    speed_mm_s, depth_mm, surface_mm, temperature_C = (
        _number(key, getattr(facts, key), labels, where) for key in QUANTITIES
    )
    for key, value in (("speed_mm_s", speed_mm_s), ("depth_mm", depth_mm)):
        if value <= 0:
            raise DataError(f"{where}: {key} = {getattr(facts, key)!r} says {value:g} here; it must be above 0")
    operator = filled(facts.operator, labels, where)
    return StatedFacts(speed_mm_s, depth_mm, surface_mm, temperature_C, operator, facts.outcome, facts.notes)


def _number(key: str, said: float | str | None, labels: Mapping[str, str], where: str) -> float:
    """In the project's unit; NaN where nothing is said, or labels leave the template empty."""
    if said is None:
        return math.nan
    if not isinstance(said, str):
        return said
    if any(labels.get(name) == "" for name in _NAMES.findall(said)):
        return math.nan
    return _measure(key, said, filled(said, labels, where).strip(), where)


def _measure(key: str, said: str, text: str, where: str) -> float:
    found = _MEASURE.fullmatch(text)
    unit = unit_in(found[2]) if found and found[2] else ""
    if found is None or (found[2] and not unit):
        told = f"{where}: {key} = {said!r} says {text!r} here, which is no number with a unit"
        raise DataError(f"{told}; mend the name, or state the unit in the mapping, as in '{{speed}} mm/min'")
    try:
        factor = factor_of(QUANTITIES[key], unit) if unit else 1.0
    except DataError as error:
        raise DataError(f"{where}: {key} = {said!r}: {error}") from error
    return float(found[1].replace(",", ".")) * factor
