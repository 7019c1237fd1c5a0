"""Which column is what, by the words laboratories write above it and the unit beside them."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from rig.intake.units import LINEAR, ROTARY

# What a column of the quantity is called, the surest words first; whole words of a name, in any case.
WORDS: dict[str, tuple[str, ...]] = {
    "time": ("time", "timestamp", "t", "temps", "zeit", "tiempo", "时间", "時間", "시간"),
    "force": ("force", "kraft", "fuerza", "力", "负荷", "荷重", "힘", "load", "charge", "last", "fz", "f", "effort"),
    "position": (
        "position", "displacement", "extension", "depth", "stroke", "travel", "crosshead", "位移", "変位", "변위",
        "allongement", "déplacement", "deplacement", "weg", "traverse", "desplazamiento", "pos", "gap", "z", "x",
    ),
    "label": ("recording", "sample", "specimen", "trial", "test", "run", "échantillon", "probe"),
}  # fmt: skip


class Candidate(NamedTuple):
    """A column that may be the quantity; the smaller ``rank`` the likelier."""

    column: int
    rank: tuple[int, int]


def knows(word: str) -> bool:
    """Whether the word names a quantity."""
    return any(word.lower() in words for words in WORDS.values())


def candidates(quantity: str, header: Sequence[str], units: Sequence[str]) -> list[Candidate]:
    """The columns that may be the quantity, the likeliest first: by the unit, and by the words in the name."""
    fitting = {**LINEAR.get(quantity, {}), **ROTARY.get(quantity, {})}
    found = []
    for number, (name, unit) in enumerate(zip(header, units, strict=True)):
        words = [word for word in re.split(r"[\W_\d]+", name.lower()) if word]
        places = [WORDS[quantity].index(word) for word in words if word in WORDS[quantity]]
        if places and (not unit or unit in fitting or quantity == "label"):
            found.append(Candidate(number, (0 if unit else 1, min(places))))
        elif unit in fitting and quantity in ("time", "force"):
            found.append(Candidate(number, (2, 0)))
    return sorted(found, key=lambda item: (item.rank, item.column))
