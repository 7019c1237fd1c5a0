"""The sign of a force where another column says it row by row: words, plus and minus, a bit."""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from rig.config.table import TomlTable
from rig.intake.families import ColumnGroup
from rig.intake.notation import hyphened, is_number
from rig.intake.pulling import PRESSES, PULLS, kinds_in
from rig.intake.questions import inline
from rig.intake.roles import words_of
from rig.intake.survey import Looks, texts_of

# Names of a column of signs, in which 1 beside 0 is a minus; and of one of which only its maker knows.
SIGN = frozenset(("sign", "signbit", "negative", "vorzeichen", "signe", "signo", "符号"))
DIRECTION = frozenset(("direction", "dir", "richtung", "sense", "polarity", "方向"))
# What stands in single rows and nowhere else for the two.
_ROWS = {"press": PRESSES, "c": PRESSES, "d": PRESSES, "t": PULLS, "z": PULLS}
# A force that turns round is small there; a word for the motion (press, release) changes where it is largest.
TURN_SHARE = 0.5

Kind = Literal["words", "signs", "unsure"]


class Signs(NamedTuple):
    """The column, the sign of each of its texts, how that is known, and the sign of each row."""

    column: int
    signs: Mapping[str, int]
    kind: Kind
    rows: Sequence[int]

    def keys(self, table: ColumnGroup) -> TomlTable:
        """What a mapping says of them beside the column of the force."""
        return {"sign": table.place(self.column), "signs": dict(self.signs)}


def signs_of(table: ColumnGroup, force: int) -> Signs | None:
    """The column that says the signs of the numbers in ``force``, none of which has one; None without one."""
    looks = table.looks[force]
    if (looks.known < 0).any():
        return None
    for number in (number for number in table.columns if number != force):
        named = set(words_of(table.layout.sheet.header[number]))
        if number not in table.texts and not named & (SIGN | DIRECTION):
            continue
        texts = table.texts.get(number) or texts_of(table.layout.sheet, [number])[number]
        signs, kind = _said(sorted({*texts} - {""}), named)
        rows = [signs.get(text, 1) for text in texts]
        turns = len(rows) == looks.values.size and _turns(looks, rows)
        if signs and (turns or kind == "words"):
            return Signs(number, signs, kind if turns else "unsure", rows)
    return None


def _said(texts: Sequence[str], named: set[str]) -> tuple[dict[str, int], Kind]:
    """The sign of each text, and by what; nothing where they say none."""
    kinds = [kinds_in(text) or {_ROWS.get(text.lower(), "")} for text in texts]
    if {*map(frozenset, kinds)} == {frozenset({PRESSES}), frozenset({PULLS})}:
        return {text: 1 if PRESSES in kind else -1 for text, kind in zip(texts, kinds, strict=True)}, "words"
    if len(texts) == 2 and set(texts) <= {"+", "-", "\u2212"}:
        return {text: 1 if text == "+" else -1 for text in texts}, "signs"
    numbers = {text: float(hyphened(text).replace(",", ".")) for text in texts if is_number(text)}
    if set(numbers.values()) in ({-1.0, 1.0}, {-1.0, 0.0, 1.0}) and named & (SIGN | DIRECTION):
        return {text: -1 if own < 0 else 1 for text, own in numbers.items()}, "signs"
    if len(texts) == 2 and named & (SIGN | DIRECTION):
        bit = set(numbers.values()) == {0.0, 1.0} or {*map(str.lower, texts)} == {"false", "true"}
        return dict(zip(texts, (1, -1), strict=True)), "signs" if bit and named & SIGN else "unsure"
    return {}, "unsure"


def _turns(looks: Looks, rows: Sequence[int]) -> bool:
    """Whether the force is small wherever its sign would change."""
    size, sign = np.nan_to_num(looks.values), np.array(rows)
    return bool((np.minimum(size[1:], size[:-1])[sign[1:] != sign[:-1]] <= TURN_SHARE * size.max()).all())


def doubt_of(table: ColumnGroup, force: int, found: Signs) -> str:
    """That signs are read, or may be, and the keys that say so."""
    name, keys = f"{table.path.name}: {table.layout.sheet.header[force]!r} has no sign", found.keys(table)
    said = ", ".join(f"{key} = {inline(value)}" for key, value in keys.items())
    if found.kind == "unsure":
        return f"{name} and is read alike throughout; if {keys['sign']!r} says it, add to columns.force: {said}"
    return f"{name}, {keys['sign']!r} says it ({said}); if not, take both keys out"
