"""Whether contact's interval holds the surface, from air or pressed, however sampled: ``python -m benchmarks.preload``.

Tissue of seven laws and of five others, most of which the estimator does not contain, and three sensors. A line a
sensor and group of laws, of answered loadings: the share held, its exact 95 % interval (Clopper and Pearson 1934), the
median width of contact's interval, and which laws were missed. Ends with 1 where they hold the surface less often than
they say: all together, or a line by more than chance. Last line: one JSON object.
"""

import argparse
import json
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest

from benchmarks.contact import SAID_SHARE
from mock_devices.testing.made.preloaded import (
    LAWS,
    OTHER_LAWS,
    SENSORS,
    SURFACE_MM,
    Sensor,
    preloaded,
    stepped,
    uneven,
)
from rig.errors import DataError
from rig.trials.curves import loading_curve
from rig.trials.cycles import IndentationCycle

TISSUES: Mapping[str, Collection[str]] = {"seven laws": LAWS, "five others": OTHER_LAWS}

STROKES: Mapping[str, Callable[[str, Sensor, int], IndentationCycle]] = {
    "no air": preloaded,
    "3 mm of air": partial(preloaded, air_mm=3.0),
    "3 mm of air, uneven": uneven,
    "3 mm of air, in steps": stepped,
}


class Answer(NamedTuple):
    """Of one loading: law, whether contact's interval held the surface (None: refused), and how wide it was [mm]."""

    law: str
    held: bool | None
    width_mm: float = float("nan")


def main() -> int:
    """Prints a line a kind of stroke, group of laws and sensor; 1 where something was missed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--loadings", type=int, default=60, help="of each sensor and law")
    parser.add_argument("--seed", type=int, default=0, help="of the first one")
    parser.add_argument("--strokes", nargs="+", choices=STROKES, default=list(STROKES))
    asked, found = parser.parse_args(), {}
    for stroke, tissue, sensor in product(asked.strokes, TISSUES, SENSORS):
        seeds = range(asked.seed, asked.seed + asked.loadings)
        answers = [_answer(law, sensor, seed, stroke) for law, seed in product(TISSUES[tissue], seeds)]
        found[f"{sensor}, {tissue}, {stroke}"] = _row(answers)
        print(f"{sensor:6s} {tissue:11s} {stroke:21s}: {_said(answers)}", flush=True)
    lacking = missed(found)
    print("missed: " + ("; ".join(lacking) or "nothing"))
    print(json.dumps(found))
    return int(bool(lacking))


def missed(found: Mapping[str, Mapping[str, float]]) -> list[str]:
    """What held less often than it says, a sentence each; ``found`` by line, as ``_row`` has it."""
    held, answered = (sum(row[name] for row in found.values()) for name in ("held", "answered"))
    share = held / answered if answered else float("nan")
    every = [] if share >= SAID_SHARE else [f"all: {share:.3f} held the surface, not {SAID_SHARE:g}"]
    return every + [
        f"{name}: {row['low']:.3f} to {row['high']:.3f} held the surface, not {SAID_SHARE:g}"
        for name, row in found.items()
        if not row["high"] >= SAID_SHARE
    ]


def _answer(law: str, sensor: str, seed: int, stroke: str) -> Answer:
    try:
        contact = loading_curve(STROKES[stroke](law, SENSORS[sensor], seed)).contact
    except DataError:
        return Answer(law, None)
    return Answer(law, contact.low_mm <= SURFACE_MM <= contact.high_mm, contact.high_mm - contact.low_mm)


def _row(answers: Sequence[Answer]) -> dict[str, float | int]:
    held = [answer.held for answer in answers if answer.held is not None]
    low, high = binomtest(sum(held), len(held)).proportion_ci(method="exact")
    width_mm = float(np.nanmedian([answer.width_mm for answer in answers]))
    return {
        "held": sum(held), "answered": len(held), "of": len(answers), "share": round(sum(held) / len(held), 4),
        "low": round(low, 4), "high": round(high, 4), "median_width_mm": round(width_mm, 4),
    }  # fmt: skip


def _said(answers: Sequence[Answer]) -> str:
    row = _row(answers)
    missed = [answer.law for answer in answers if answer.held is False]
    return (
        f"answered {row['answered']:4d} of {row['of']}, held {row['share']:.3f} (95 %: {row['low']:.3f} to "
        f"{row['high']:.3f}), median width {row['median_width_mm']:.3f} mm"
        + "".join(f"; missed {missed.count(law)} of {law}" for law in dict.fromkeys(missed))
    )


if __name__ == "__main__":
    sys.exit(main())
