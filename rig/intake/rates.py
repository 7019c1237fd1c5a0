"""The rate of rows without a time, where it stands above them or in the name of their file."""

import re
from collections.abc import Mapping

from rig.intake.units import TIME_NS, unit_of

# No bench presses tissue so often in a second: a rate in a file's name from here on is that of the rows.
MOST_STROKES_HZ = 100.0
_RATE = re.compile(r"rate|freq|abtast|采样|サンプリング|\bfs\b", re.IGNORECASE)
_SAMPLED = re.compile(
    r"sampl|scan|acqui|frame|data|collect|log|abtast|采样|サンプリング|update|hz|\bfs\b", re.IGNORECASE
)
# What is in Hz may be a filter's or a test's; with one of these words it is how often the rows come.
_SAMPLES = re.compile(r"sampl|scan|acqui|采样|サンプリング|abtast", re.IGNORECASE)
_HERTZ = re.compile(r"\bk?hz\b|\bk?s/s\b|\bsps\b|samples?/s", re.IGNORECASE)
_STEP = re.compile(r"interval|period|delta_x|time step|sample time|\bdt\b|increment|schrittweite", re.IGNORECASE)
_NAMED = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?)[ _-]?(k?)(?:hz|sps|s/s)(?![^\W\d_])", re.IGNORECASE)
_FIRST = re.compile(r"[+-]?\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?")


def named_rate_Hz(name: str) -> float:
    """The rate in the name of a file (``creep_1kHz.csv``), the highest where there are several; 0 without one."""
    return max((float(number) * (1e3 if kilo else 1.0) for number, kilo in _NAMED.findall(name)), default=0.0)


def stated_rate_Hz(facts: Mapping[str, str]) -> float | None:
    """The rate of the rows where a line above the table states it, or the time between them."""
    for name, value in facts.items():
        number = _FIRST.search(value)
        if not number or ":" in value:
            continue
        amount = float(number[0].replace(",", "."))
        unit = unit_of(name) or unit_of(value)
        if amount > 0 and _STEP.search(name):
            return 1e9 / (amount * TIME_NS.get(unit, TIME_NS["s"]))
        said = f"{name} {value}"
        rate = _RATE.search(name) and _SAMPLED.search(said)
        if amount > 0 and (rate or (_SAMPLES.search(name) and _HERTZ.search(said))):
            return amount * (1e3 if re.search("khz|ks/s", said, re.IGNORECASE) else 1.0)
    return None
