"""The surface as the loop finds it, over hundreds of approaches: ``python -m benchmarks.contact [--approaches 100]``.

Both sensors' noise and rate, limbs from 0.05 to 5 N/mm, on a clock of its own; with ``--others`` what is touched is no
limb, and begins without slope. Last line: one JSON object.
"""

import argparse
import json
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from controller.loop.paired_samples import Touch
from mock_devices.testing.limb_bench import BOTA, FT300, Limb, LimbBench, Sensor, approached
from mock_devices.testing.spring_bench import SURFACE_MM

LIMBS = (
    Limb(0.12, 0.22, 0.01), Limb(0.05, 0.0, 0.0), Limb(0.05, 0.3, 0.01), Limb(0.5, 0.2, 0.0),
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


OTHERS = (Onset(0.15, 1.5, 0.0), Onset(0.75, 1.5, 0.0), Onset(0.3, 2.0, 0.0))
SENSORS = {"bota-sensone": BOTA, "robotiq-ft300": FT300}
# What depth is promised to, and what a trial has to say itself where it is not known so well.
PROMISED_MM = 0.2


def main() -> None:
    """Prints a line a sensor and limb, then totals."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--approaches", type=int, default=40, help="of each sensor and limb")
    parser.add_argument("--others", action="store_true", help="a sphere on soft and on firm tissue, and a cone")
    asked = parser.parse_args()
    print("sensor         limb (a, b, B)      error mean, sd, largest mm  held  within  known  touches  seconds")
    limbs = OTHERS if asked.others else LIMBS
    found = [_row(name, SENSORS[name], limb, asked.approaches) for name, limb in product(SENSORS, limbs)]
    errors, known = np.concatenate([row[0] for row in found]), np.concatenate([row[2] for row in found])
    held = np.concatenate([row[1] for row in found])
    low, high = binomtest(int(held.sum()), len(held)).proportion_ci(method="exact")
    print(json.dumps({
        "approaches": len(errors),
        "interval_holds": round(float(held.mean()), 4),
        "low": round(low, 4),
        "high": round(high, 4),
        "known": int(known.sum()),
        "largest_error_known_mm": round(float(np.abs(errors[known]).max()), 4),
        "p95_error_known_mm": round(float(np.quantile(np.abs(errors[known]), 0.95)), 4),
        "largest_error_mm": round(float(np.abs(errors).max()), 4),
    }))  # fmt: skip


def _row(
    name: str, sensor: Sensor, limb: Limb, count: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Errors, whether the interval held the surface, and whether it was as narrow as is promised; each (count,)."""
    runs = [approached(limb, sensor, seed) for seed in range(count)]
    touches = [_touch(bench) for bench in runs]
    errors = np.array([touch.surface_mm - SURFACE_MM for touch in touches])
    held = np.array([touch.low_mm <= SURFACE_MM <= touch.high_mm for touch in touches])
    within = np.array([touch.within_mm for touch in touches])
    print(
        f"{name:14s} {limb.a_N_mm:5g} {limb.b_per_mm:5g} {limb.damping_N_s_mm:6g}"
        f"  {errors.mean():+8.3f} {errors.std():6.3f} {np.abs(errors).max():7.3f}"
        f"  {100 * held.mean():9.0f} % {within.mean():6.2f} {100 * np.mean(within <= PROMISED_MM):5.0f} %"
        f" {np.mean([touch.touches for touch in touches]):6.1f} {np.mean([b.state.now_ns for b in runs]) * 1e-9:9.1f}",
        flush=True,
    )
    return errors, held, within <= PROMISED_MM


def _touch(bench: LimbBench) -> Touch:
    assert bench.state.touch, bench.ended
    return bench.state.touch


if __name__ == "__main__":
    main()
