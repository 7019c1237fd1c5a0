"""Which column is what, by the words laboratories write above it and the unit beside them."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from rig.intake.units import LINEAR, ROTARY, SIGNALS

# What a column of the quantity is called, the surest words first; whole words of a name, in any case.
WORDS: dict[str, tuple[str, ...]] = {
    "time": (
        "time", "timestamp", "zeit", "temps", "tiempo", "tempo", "时间", "時間", "시간", "время", "czas", "čas", "tijd",
        "zeitstempel", "elapsed", "stamp", "datenum", "seconds", "sec", "secs", "ms", "msec", "millis", "micros", "t",
    ),
    "force": (
        "force", "kraft", "standardkraft", "fuerza", "forza", "力", "负荷", "荷重", "载荷", "하중", "힘", "load",
        "сила", "усилие", "нагрузка", "siła", "síla", "kracht", "força", "kuvvet", "loadcell", "charge", "last", "fz",
        "fn", "f", "torque", "drehmoment", "moment", "effort", "tau", "fy", "fx",
    ),
    "position": (
        "position", "displacement", "extension", "depth", "stroke", "travel", "crosshead", "traverse", "standardweg",
        "位移", "変位", "변위", "ストローク", "行程", "变形", "перемещение", "przemieszczenie", "dráha", "verplaatsing",
        "allongement", "déplacement", "deplacement", "weg", "desplazamiento", "deslocamento", "spostamento",
        "deformation", "verformung", "distance", "deflection", "indentation", "penetration", "eindringtiefe",
        "enfoncement", "lvdt", "disp", "displ", "pos", "gap", "height", "hub", "pose", "z", "pz", "q", "angle",
        "winkel", "y", "x", "py", "px",
    ),
    "velocity": ("velocity", "speed", "geschwindigkeit", "vitesse", "速度", "vel", "dq", "qd"),
    "label": (
        "recording", "sample", "specimen", "trial", "test", "run", "échantillon", "probe", "试样", "試験片", "subject",
        "patient", "participant", "setname", "cycle", "operator", "material", "condition", "site", "id", "temperature",
        "speed", "repetition", "rep",
    ),
    "counter": ("frame", "sample", "index", "counter", "seq", "sequence", "point", "scan", "row", "no", "nr", "n"),
}  # fmt: skip
_COUNTERS = frozenset(("sequence", "seq", "frame", "counter", "value"))
# Endings of German and run-together words (Standardkraft, Traversenweg, axialforce).
_ENDINGS = ("kraft", "zeit", "weg", "force", "displacement", "position", "extension", "stroke")
# A column with such a word is not what was measured: somebody's wish, a bound, a derived number.
OTHER = frozenset((
    "target", "setpoint", "set", "command", "commanded", "cmd", "desired", "demand", "reference", "ref", "goal", "soll",
    "limit", "max", "peak", "error", "err", "rate", "offset", "raw", "std", "mean", "strain", "stress", "area",
    "width", "thickness", "diameter", "length", "energy", "work", "acceleration", "accel", "acc", "gyro", "orientation",
))  # fmt: skip
UNIT_ALONE = 2  # in the rank of a candidate


class Candidate(NamedTuple):
    """By ``rank``, smaller is likelier: a word against it; word and unit, word, unit (0 to 2); the word's place."""

    column: int
    rank: tuple[bool, int, int]


def knows(word: str) -> bool:
    """Whether the word names a quantity."""
    return any(_place(quantity, word) is not None for quantity in WORDS)


def quantities_of(name: str) -> set[str]:
    """Which of time, force and position a word in the name is of."""
    return {quantity for quantity in ("time", "force", "position") if _place(quantity, name) is not None}


def words_of(name: str) -> list[str]:
    """The words of a name in small letters: ``ActualForce_N (cell 1)`` has actual, force, n, cell."""
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return [word for word in re.split(r"[\W_\d]+", parted.lower()) if word]


def _place(quantity: str, name: str) -> int | None:
    """Where in the list of words the surest one of the name stands; None without one."""
    said = words_of(name)
    found = {*said, *(word[:-1] for word in said if word.endswith("s") and len(word) > 4)}  # and of a plural the one
    places = [
        place for place, known in enumerate(WORDS[quantity]) if known in found
        or (not known.isascii() and known in name.lower())
        or (known in _ENDINGS and any(word.endswith(known) for word in found))
    ]  # fmt: skip
    return min(places, default=None)


def _is_letter_of_another(quantity: str, name: str, word: str) -> bool:
    """Whether a letter in the name is a direction (``force.x``), or part of a counter's (``F/T Sequence``)."""
    if len(word) > 1 or quantity in ("counter", "label"):
        return False
    of_another = quantity == "position" and any(_place(other, name) is not None for other in ("force", "velocity"))
    return of_another or not _COUNTERS.isdisjoint(words_of(name))


def candidates(quantity: str, header: Sequence[str], units: Sequence[str]) -> list[Candidate]:
    """The columns that may be the quantity, the likeliest first: by the unit, and by the words in the name."""
    fitting = {**LINEAR.get(quantity, {}), **ROTARY.get(quantity, {})}
    found = []
    for number, (name, unit) in enumerate(zip(header, units, strict=True)):
        place, spoiled = _place(quantity, name), not OTHER.isdisjoint(words_of(name))
        if place is not None and _is_letter_of_another(quantity, name, WORDS[quantity][place]):
            continue
        if place is not None and (not unit or unit in fitting or unit in SIGNALS or quantity in ("label", "counter")):
            found.append(Candidate(number, (spoiled, 0 if unit in fitting else 1, place)))
        elif unit in fitting and quantity in ("time", "force", "position"):
            found.append(Candidate(number, (spoiled, UNIT_ALONE, 0)))
    return sorted(found, key=lambda item: (item.rank, item.column))
