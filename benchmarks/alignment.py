"""Whether the interval of a lag between two clocks holds it: ``python -m benchmarks.alignment [--runs 40]``.

Force on tissue of laws the estimator does not hold, two sensors, from the air and preloaded; and a camera behind a
frame that gives. A line a kind. Last line: one JSON object.
"""

import argparse
import json
from collections.abc import Callable
from functools import partial
from itertools import product

import numpy as np
from scipy.stats import binomtest

from mock_devices.testing.made.two_clocks import SENSORS, TISSUES, Seen, pressed, tracked
from rig.intake.lag import ClocksApart, Lag, TimedSignal, lag_of_force, lag_of_motion

Estimator = Callable[[TimedSignal, TimedSignal], Lag]


def main() -> None:
    """Prints a line a kind, then totals."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=40, help="of each kind")
    count = parser.parse_args().runs
    kinds: dict[str, tuple[Callable[[int], Seen], Estimator]] = {
        f"{name}, {tissue}, {'preload' if preload else 'air'}": (
            partial(pressed, tissue, SENSORS[name], preload=preload), lag_of_force
        )
        for name, tissue, preload in product(SENSORS, TISSUES, (False, True))
    } | {"camera": (tracked, lag_of_motion)}  # fmt: skip
    found = {kind: _row(kind, *made, count) for kind, made in kinds.items()}
    held, answered = (sum(row[at] for row in found.values()) for at in (0, 1))
    interval = binomtest(held, answered).proportion_ci(method="exact")
    print(json.dumps({
        "runs": count * len(found), "answered": answered, "held": held,
        "held_share_95": [round(interval.low, 4), round(interval.high, 4)],
        "least_held_of_a_kind": round(min(row[0] / row[1] for row in found.values()), 3),
    }))  # fmt: skip


def _row(kind: str, make: Callable[[int], Seen], estimate: Estimator, count: int) -> tuple[int, int]:
    """How many intervals held the truth all through the recording, and how many were given."""
    lags = [(seen, _lag(estimate, seen)) for seen in map(make, range(count))]
    known = [(seen, lag) for seen, lag in lags if lag is not None]
    errors_ms = 1e3 * np.array([seen.missed_s(lag).max() for seen, lag in known])
    within_ms = 1e3 * np.array([lag.anywhere_s for _, lag in known])
    held = int(np.sum(errors_ms <= within_ms))
    print(
        f"{kind:34s} answered {len(known):3d} of {count}, held {held / len(known):.3f}; within "
        f"{np.median(within_ms):.3g} ms (median), {within_ms.max():.3g} ms (most); error "
        f"{np.median(errors_ms):.3g} ms (median), {errors_ms.max():.3g} ms (most)",
        flush=True,
    )
    return held, len(known)


def _lag(estimate: Estimator, seen: Seen) -> Lag | None:
    try:
        return estimate(seen.follower, seen.motion)
    except ClocksApart:
        return None


if __name__ == "__main__":
    main()
