"""The surface as the loop finds it, over hundreds of approaches: ``python -m benchmarks.contact [--approaches 100]``.

Both sensors' noise and rate, limbs from 0.05 to 5 N/mm, on a clock of its own; with ``--others`` a round tip, under
which force begins without slope. Ends with 1 where either sensor is off by more than depth is promised to on the mock
bench's limb, or on any where it calls the surface known so well, or where its intervals hold the surface less often
than they say. Prints the head and the table of a page in docs/validation. Last line: one JSON object.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from benchmarks.about import head
from controller.loop.paired_samples import Touch
from mock_devices.testing.limb_bench import BOTA, FT300, Limb, LimbBench, approached
from mock_devices.testing.spring_bench import SURFACE_MM
from rig.config.wiring import TipShape, Wiring

# What the mock bench has; depth into it is the same with either sensor.
PHANTOM = Limb()
LIMBS = (
    PHANTOM, Limb(0.05, 0.0, 0.0), Limb(0.05, 0.3, 0.01), Limb(0.5, 0.2, 0.0),
    Limb(0.5, 0.0, 0.05), Limb(1.0, 0.3, 0.05), Limb(5.0, 0.0, 0.02),
)  # fmt: skip


@dataclass(frozen=True)
class Onset(Limb):
    """Force that grows as a power of depth, 1.5 under a sphere and 2 under a cone; its ``b_per_mm`` is that power."""

    def force_N(self, depth_mm: float, speed_mm_s: float) -> float:
        """Zero in the air."""
        if depth_mm <= 0:
            return 0.0
        return float(self.a_N_mm * depth_mm**self.b_per_mm + self.damping_N_s_mm * speed_mm_s)


ROUND = Wiring(tip=TipShape(round=True))
OTHERS = (Onset(0.15, 1.5, 0.0), Onset(0.75, 1.5, 0.0), Onset(0.3, 2.0, 0.0))
SENSORS = {"bota-sensone": BOTA, "robotiq-ft300": FT300}
# What depth is promised to, and what a trial has to say itself where it is not known so well.
PROMISED_MM = 0.2
TITLES = (
    "| sensor | limb (a, b, B) | mean error, mm | sd, mm | largest, mm "
    "| held | within, mm | known | touches | seconds |\n"
    "|---|---|---|---|---|---|---|---|---|---|"
)
# How often an interval of the surface holds it, by what it says of itself.
SAID_SHARE = 0.95


@dataclass(frozen=True)
class Row:
    """Approaches of one sensor to one limb: errors, whether the interval held the surface, and its half; (count,)."""

    sensor: str
    limb: Limb
    errors_mm: NDArray[np.float64]
    held: NDArray[np.bool_]
    within_mm: NDArray[np.float64]

    @property
    def known(self) -> NDArray[np.bool_]:
        """Whether the interval was as narrow as is promised."""
        return self.within_mm <= PROMISED_MM

    @property
    def worst_mm(self) -> float:
        """The largest error where it was, and on the mock bench's limb anyway."""
        judged = self.errors_mm[self.known | (self.limb == PHANTOM)]
        return float(np.abs(judged).max(initial=0.0))


def main() -> int:
    """Prints a line a sensor and limb, then totals; 1 where something was missed."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.contact", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--approaches", type=int, default=40, help="of each sensor and limb")
    parser.add_argument("--others", action="store_true", help="a sphere on soft and on firm tissue, and a cone")
    asked = parser.parse_args()
    print(head("contact"))
    print(TITLES)
    limbs = OTHERS if asked.others else LIMBS
    rows = [approaches(name, limb, asked.approaches) for name, limb in product(SENSORS, limbs)]
    found = missed(rows)
    print("missed: " + ("; ".join(found) or "nothing"))
    print(json.dumps({"ok": not found, "missed": found, **totals(rows)}))
    return int(bool(found))


def missed(rows: Sequence[Row]) -> list[str]:
    """What was not reached, a sentence each."""
    lacking = [f"{sensor}: made no approach" for sensor in SENSORS if sensor not in {row.sensor for row in rows}]
    return lacking + [
        said for sensor in SENSORS for said in _missed_by(sensor, [r for r in rows if r.sensor == sensor])
    ]


def _missed_by(sensor: str, rows: Sequence[Row]) -> Iterator[str]:
    for row in rows:
        limb = f"{row.limb.a_N_mm:g}, {row.limb.b_per_mm:g}, {row.limb.damping_N_s_mm:g}"
        if not row.worst_mm <= PROMISED_MM:
            yield f"{sensor} on {limb}: off by {row.worst_mm:.3f} mm, not by {PROMISED_MM:g} mm at most"
    held = np.concatenate([row.held for row in rows]) if rows else np.ones(1)
    if not held.mean() >= SAID_SHARE:
        yield f"{sensor}: {held.mean():.3f} of the intervals held the surface, not {SAID_SHARE:g} as they say"


def totals(rows: Sequence[Row]) -> dict[str, float]:
    """Over both sensors and all limbs."""
    errors_mm, known = np.concatenate([row.errors_mm for row in rows]), np.concatenate([row.known for row in rows])
    held = np.concatenate([row.held for row in rows])
    low, high = binomtest(int(held.sum()), len(held)).proportion_ci(method="exact")
    sizes_mm = np.abs(errors_mm)
    return {
        "approaches": len(errors_mm),
        "interval_holds": round(float(held.mean()), 4),
        "low": round(low, 4),
        "high": round(high, 4),
        "known": int(known.sum()),
        "largest_error_known_mm": round(float(sizes_mm[known].max(initial=0.0)), 4),
        "p95_error_known_mm": round(float(np.quantile(sizes_mm[known], 0.95)), 4) if known.any() else 0.0,
        "largest_error_mm": round(float(sizes_mm.max()), 4),
    }


def approaches(name: str, limb: Limb, count: int) -> Row:
    """So many approaches of a sensor to a limb, and a line about them."""
    runs = [
        approached(limb, SENSORS[name], seed, wiring=ROUND if isinstance(limb, Onset) else None)
        for seed in range(count)
    ]
    touches = [_touch(bench) for bench in runs]
    row = Row(
        name, limb,
        np.array([touch.surface_mm - SURFACE_MM for touch in touches]),
        np.array([touch.low_mm <= SURFACE_MM <= touch.high_mm for touch in touches]),
        np.array([touch.within_mm for touch in touches]),
    )  # fmt: skip
    errors_mm = row.errors_mm
    print(
        f"| {name} | {limb.a_N_mm:g}, {limb.b_per_mm:g}, {limb.damping_N_s_mm:g}"
        f" | {errors_mm.mean():+.3f} | {errors_mm.std():.3f} | {np.abs(errors_mm).max():.3f}"
        f" | {int(row.held.sum())} of {count} | {row.within_mm.mean():.2f} | {int(row.known.sum())} of {count}"
        f" | {np.mean([touch.touches for touch in touches]):.1f}"
        f" | {1e-9 * np.mean([b.state.now_ns for b in runs]):.1f} |",
        flush=True,
    )
    return row


def _touch(bench: LimbBench) -> Touch:
    assert bench.state.touch, bench.ended
    return bench.state.touch


if __name__ == "__main__":
    sys.exit(main())
