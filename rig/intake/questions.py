"""What the data cannot say: the question, its candidates, and the line of a mapping that answers it."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from rig.config.table import TomlTable
from rig.errors import UsageError
from rig.intake.mapping import UNSAID
from rig.intake.units import LINEAR, ROTARY, unit_in


class Choice(NamedTuple):
    """A column that may be meant: what a person types, what the mapping then says of it, and why it is possible."""

    name: str
    known: TomlTable
    why: str = ""

    @property
    def whole(self) -> bool:
        """Whether a unit or a scale is known."""
        return not {"unit", "scale", "form"}.isdisjoint(self.known)


@dataclass(frozen=True)
class OpenQuestion:
    """What the data cannot say of a ``quantity`` in the tables of these numbers.

    Without ``choices`` it is the rate of the rows [Hz], whose ``known`` column counts them. ``usual`` is what `--yes`
    answers, empty where nothing is clearly the best answer; ``example`` is one that the data suggest, or empty.
    """

    text: str
    tables: tuple[int, ...]
    quantity: str
    choices: tuple[Choice, ...] = ()
    usual: str = ""
    example: str = ""
    known: TomlTable = field(default_factory=dict)

    @property
    def line(self) -> str:
        """The line of the mapping that answers it; what the data cannot say is open in it, and refused until said."""
        place = "time" if self.quantity == "time" else f"columns.{self.quantity}"
        suggested = self.usual or self.example
        return f"{place} = {inline(self.value(suggested) if suggested else self._unsaid())}"

    @property
    def form(self) -> str:
        """An answer, or what one looks like."""
        return self.usual or self.example or ("COLUMN UNIT" if len(self.choices) > 1 else "NUMBER")

    def _unsaid(self) -> TomlTable:
        if self._is_rate:
            return {**self.known, "rate_Hz": UNSAID}
        one = len(self.choices) == 1
        lacking = "unit" if self.quantity == "time" else "scale"
        return {**self.choices[0].known, lacking: UNSAID} if one else {"column": UNSAID, "unit": UNSAID}

    @property
    def _is_rate(self) -> bool:
        return self.quantity == "time" and not self.choices

    def answer(self, tree: TomlTable, said: str) -> None:
        """Puts the answer into every table where it is open; raises UsageError where it is none."""
        value = self.value(said)
        for number in self.tables:
            table = tree["tables"][number]
            columns = table if self.quantity == "time" else table["columns"]
            columns[self.quantity] = {**value, **columns.get(self.quantity, {})}

    def value(self, said: str) -> TomlTable:
        """What the mapping says of the quantity after the answer; raises UsageError where it is none."""
        if self._is_rate:
            return {**self.known, "rate_Hz": self._number(said)}
        named = [choice for choice in self.choices if f"{said} ".startswith(f"{choice.name} ")]
        if not named and len(self.choices) != 1:
            raise UsageError(f"{said!r} is none of the columns; {self.text}")
        choice = max(named or self.choices, key=lambda item: len(item.name))
        rest = said[len(choice.name) :].strip() if named else said.strip()
        return dict(choice.known) if choice.whole and not rest else {**choice.known, **self._measured(rest)}

    def _measured(self, said: str) -> TomlTable:
        """A unit of the quantity, or how much of ours one of the file's is."""
        unit = unit_in(said) or said
        if unit in LINEAR[self.quantity] or unit in ROTARY.get(self.quantity, {}):
            return {"unit": unit}
        if self.quantity == "time":
            raise UsageError(f"{said!r} is no unit of time; {self.text}")
        return {"scale": self._number(said)}

    def _number(self, said: str) -> float:
        try:
            return float(said)
        except ValueError as error:
            raise UsageError(f"{said!r} is no answer; {self.text}") from error


@dataclass(frozen=True)
class JointQuestion:
    """Questions that are asked as one, answered in their order with a semicolon between."""

    parts: tuple[OpenQuestion, ...]

    @property
    def text(self) -> str:
        """All of them, and how they are answered."""
        said = "; and ".join(part.text for part in self.parts)
        return f"{said}; answer them together, with a semicolon between, as {self.form!r}"

    @property
    def usual(self) -> str:
        """What `--yes` answers, empty where one of them has no clear answer."""
        return "; ".join(part.usual for part in self.parts) if all(part.usual for part in self.parts) else ""

    @property
    def form(self) -> str:
        """An answer, or what one looks like."""
        return "; ".join(part.form for part in self.parts)

    @property
    def line(self) -> str:
        """The lines of the mapping that answer it."""
        return " and ".join(part.line for part in self.parts)

    def answer(self, tree: TomlTable, said: str) -> None:
        """Puts the answers into every table where they are open; raises UsageError where one is none."""
        for part, own in zip(self.parts, self._parted(said), strict=True):
            part.answer(tree, own)

    def value(self, said: str) -> TomlTable:
        """What the mapping says of each quantity after the answer; raises UsageError where one is none."""
        return {part.quantity: part.value(own) for part, own in zip(self.parts, self._parted(said), strict=True)}

    def _parted(self, said: str) -> list[str]:
        found = [own.strip() for own in said.split(";")]
        if len(found) != len(self.parts):
            raise UsageError(f"{said!r} is not {len(self.parts)} answers with a semicolon between, as {self.form!r}")
        return found


@dataclass(frozen=True)
class AxisQuestion:
    """Whether tables with the columns ``by`` are of a drive axis alone, or of tissue that it presses."""

    by: str
    usual: str = ""
    form: str = "axis or tissue"
    line: str = "axis = {} for a drive alone, no such line for tissue"

    @property
    def text(self) -> str:
        """The question."""
        return f"{self.by} may be of a drive axis alone or of tissue that it presses; which is it, {self.form}?"

    def answer(self, tree: TomlTable, said: str) -> None:
        """Puts `axis` into the mapping or takes it out; raises UsageError where the answer is neither."""
        tree.pop("axis", None)
        tree.update(self.value(said))

    def value(self, said: str) -> TomlTable:
        """What the mapping says after the answer; raises UsageError where it is none."""
        if said not in ("axis", "tissue"):
            raise UsageError(f"{said!r} is neither axis nor tissue; {self.text}")
        return {"axis": {}} if said == "axis" else {}


Question = OpenQuestion | JointQuestion | AxisQuestion


def inline(value: object) -> str:
    """A value as TOML has it in one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(str(key))} = {inline(item)}" for key, item in value.items()) + " }"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(map(inline, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def _key(name: str) -> str:
    plain = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if plain else json.dumps(name, ensure_ascii=False)
