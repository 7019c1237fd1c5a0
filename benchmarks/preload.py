"""Whether contact's interval holds the surface, with air before the loading or none: ``python -m benchmarks.preload``.

Tissue of seven laws, most of which the estimator does not know, and three sensors. A line a sensor, of answered
loadings: the share held and its exact 95 % interval. Last line: one JSON object.
"""

import argparse
import json
from itertools import product

from scipy.stats import binomtest

from rig.errors import DataError
from rig.trials.curves import loading_curve
from tests.rig.trials.preloaded import LAWS, SENSORS, SURFACE_MM, preloaded


def main() -> None:
    """Prints a line a sensor, without air and with 3 mm of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--loadings", type=int, default=60, help="of each sensor and law")
    count = parser.parse_args().loadings
    found = {
        f"{sensor}, {air_mm:g} mm of air": _row(sensor, air_mm, count) for air_mm in (0.0, 3.0) for sensor in SENSORS
    }
    for name, (held, answered) in found.items():
        low, high = binomtest(held, answered).proportion_ci(method="exact")
        print(
            f"{name:24s} answered {answered:4d} of {count * len(LAWS)}, held {held / answered:.3f} "
            f"(95 %: {low:.3f} to {high:.3f})"
        )
    print(json.dumps({name: {"held": held, "answered": answered} for name, (held, answered) in found.items()}))


def _row(sensor: str, air_mm: float, count: int) -> tuple[int, int]:
    """How many loadings were answered with an interval that held the surface, and how many were answered."""
    held = [_held(law, sensor, seed, air_mm) for law, seed in product(LAWS, range(count))]
    return held.count(True), held.count(True) + held.count(False)


def _held(law: str, sensor: str, seed: int, air_mm: float) -> bool | None:
    try:
        contact = loading_curve(preloaded(law, SENSORS[sensor], seed, air_mm)).contact
    except DataError:
        return None
    return contact.low_mm <= SURFACE_MM <= contact.high_mm


if __name__ == "__main__":
    main()
