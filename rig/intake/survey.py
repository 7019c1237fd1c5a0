"""What the numbers of a column look like: how they run, what stands for none, where their sign is."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.intake.cells import NO_VALUE
from rig.intake.mapping import FileForm
from rig.intake.readers import kind_of
from rig.intake.sheet import Column, Sheet

Numbers = NDArray[np.float64]
# Numbers written for none, where they stand apart from all others; beyond FAR no force, way or time is meant (NDI
# writes -3.697314e28, SCPI 9.91e37, ParaView and VTK 1e30).
CODES = tuple(sign * (10.0**digits - 1) for sign in (-1, 1) for digits in (3, 4, 5, 6))
FAR = 1e25
# A code stands apart where it is this many times the range of the other numbers away from them.
APART = 3.0
# Where counters of 16, 24 and 32 bits begin anew, and those of 32 that count parts of the unit they are written in.
WRAPS = (2.0**16, 2.0**24, 2.0**32, 2.0**32 / 1e3, 2.0**32 / 1e6)
# Rows of steps that may differ from the usual one in an even clock: a lost row now and then is no other clock.
EVEN_SHARE = 0.9
# Fewer different numbers in a heap may be two states (a target here and there) and no sign.
HEAP_VALUES = 3


class Looks(NamedTuple):
    """The numbers of a column, NaN for none, and the words and numbers in it that stand for none."""

    values: Numbers
    missing: tuple[str, ...] = ()
    odd: tuple[int, str] | None = None

    @property
    def known(self) -> Numbers:
        """Without what is missing."""
        return self.values[np.isfinite(self.values)]

    @property
    def moves(self) -> bool:
        """Whether it is more than one number."""
        return self.known.size > 1 and float(np.ptp(self.known)) > 0

    @property
    def rises(self) -> bool:
        """Whether almost every number is above the one before, as of a clock."""
        steps, last = np.diff(self.known), int(np.flatnonzero(np.isfinite(self.values))[-1]) if self.known.size else 0
        return steps.size > 0 and self.known.size >= EVEN_SHARE * (last + 1) and float(np.mean(steps > 0)) >= EVEN_SHARE

    @property
    def even(self) -> bool:
        """Whether it rises by the same step again and again, within what rounding does to it."""
        steps = np.diff(self.known)
        usual = float(np.median(steps)) if steps.size else 0.0
        return usual > 0 and float(np.mean(np.abs(steps - usual) <= 0.5 * usual)) >= EVEN_SHARE

    @property
    def counts(self) -> bool:
        """Whether it counts the rows."""
        return self.even and float(np.median(np.diff(self.known))) == 1.0 and bool((self.known % 1 == 0).all())

    @property
    def span(self) -> str:
        """Its range in words."""
        return f"{self.known.min():g} to {self.known.max():g}" if self.known.size else "no number"


def looks_of(sheet: Sheet, form: FileForm) -> dict[int, Looks]:
    """The columns of a sheet that hold numbers, as its first piece has them, of those that are alike in length."""
    looked = {
        number: _of_texts(column, form) if isinstance(column, list) else _coded(np.asarray(column, np.float64))
        for number, column in _first(sheet).items()
    }
    found = {number: looks for number, looks in looked.items() if looks is not None and looks.known.size > 1}
    sizes = Counter(looks.values.size for looks in found.values())
    usual = max(sizes, key=lambda size: (sizes[size], size), default=0)
    return {number: looks for number, looks in found.items() if looks.values.size == usual}


def texts_of(sheet: Sheet, numbers: Sequence[int]) -> dict[int, list[str]]:
    """These columns as texts, of the first piece."""
    batch = next(iter(sheet.read(dict.fromkeys(numbers, True))), [[] for _ in numbers])
    return {number: list(map(str, column)) for number, column in zip(numbers, batch, strict=True)}


def _first(sheet: Sheet) -> Mapping[int, Column]:
    """The first piece of every column, as numbers where the file has numbers, else as texts."""
    if kind_of(sheet.path) != "arrays":
        return texts_of(sheet, range(len(sheet.header)))
    return {number: _column(sheet, number) for number in range(len(sheet.header))}


def _column(sheet: Sheet, number: int) -> Column:
    try:
        return next(iter(sheet.read({number: False})))[0]
    except DataError:
        return texts_of(sheet, [number])[number]


def _of_texts(texts: Sequence[str], form: FileForm) -> Looks | None:
    """The numbers; None where fewer than half of the cells that say something are numbers."""
    values = np.array([_number(text, form) for text in texts])
    others = [(row, text) for row, text in enumerate(texts) if text and math.isnan(values[row])]
    words = dict.fromkeys(text for _, text in others if text.lower() in NO_VALUE)
    if 2 * np.isfinite(values).sum() < np.isfinite(values).sum() + len(others) - sum(t in words for _, t in others):
        return None
    coded = _coded(values)
    odd = next(((row, text) for row, text in others if text not in words), None)
    return Looks(coded.values, (*words, *coded.missing), odd)


def _number(text: str, form: FileForm) -> float:
    try:
        return float(text.replace(form.thousands or "\0", "").replace(form.decimal, ".")) if text else math.nan
    except ValueError:
        return math.nan


def _coded(values: Numbers) -> Looks:
    """Without the numbers that stand for none: too far to be meant, or a code apart from all others."""
    said = np.where(np.isfinite(values), values, 0.0)
    far = np.unique(values[np.abs(said) >= FAR]).tolist()
    codes = [code for code in CODES if _stands_apart(values[np.abs(said) < FAR], code)]
    gone = np.isin(values, [*far, *codes])
    return Looks(np.where(gone, math.nan, values), tuple(f"{code:.15g}" for code in (*far, *codes)))


def _stands_apart(values: Numbers, code: float) -> bool:
    others = values[np.isfinite(values) & (values != code)]
    if others.size < 2 or others.size == np.isfinite(values).sum():
        return False
    away = max(code - others.max(), others.min() - code)
    return bool(away > APART * np.ptp(others))


def wraps_at(values: Numbers) -> float:
    """Where a counter that began anew did so, 0 of others: its steps there are then as long as its others."""
    steps = np.diff(values)
    on, back = steps[steps > 0], steps[steps < 0]
    if not on.size or not back.size or values.min() < 0:
        return 0.0
    fitting = (end for end in WRAPS if values.max() < end and (back + end).min() > 0)
    return next((end for end in fitting if (back + end).max() <= 1.5 * on.max()), 0.0)


def sign_of(values: Numbers) -> dict[str, int]:
    """Where the sign of unsigned whole numbers stands: ``sign_bit`` or ``bits`` as a mapping has them; else nothing.

    The numbers then lie in two heaps with nothing between them: small ones, and others just above half of the range
    (a sign bit) or just below its end (two's complement).
    """
    known = values[np.isfinite(values)]
    if known.size < 2 or (known < 0).any() or (known % 1 != 0).any():
        return {}
    for bits in (16, 32):
        if _two_heaps(known, 2.0**bits - known, 2.0 ** (bits - 1)):
            return {"bits": bits}
    for bit in (15, 11, 10):
        if _two_heaps(known, known - 2.0**bit, 2.0**bit):
            return {"sign_bit": bit}
    return {}


def with_sign(values: Numbers, sign_bit: int | None = None, bits: int | None = None) -> Numbers:
    """The numbers with the sign that stands in a bit, or in the upper half of their range."""
    if sign_bit is not None:
        values = np.where(values >= 2.0**sign_bit, 2.0**sign_bit - values, values)
    return values if bits is None else np.where(values >= 2.0 ** (bits - 1), values - 2.0**bits, values)


def _two_heaps(known: Numbers, turned: Numbers, half: float) -> bool:
    """Whether what is from ``half`` on is, turned, as small as the rest: within a quarter of half the range."""
    high = known >= half
    sizes = np.where(high, turned, known)
    if min(np.unique(known[high]).size, np.unique(known[~high]).size) < HEAP_VALUES:
        return False
    return bool(sizes.max() < half / 2 and sizes.min() >= 0)
