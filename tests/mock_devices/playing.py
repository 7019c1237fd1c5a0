"""Plays a motion on the bench faster than real time and writes down what happened, one row a millisecond."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from mock_devices.bench import Bench
from mock_devices.parameters import Parameters, Sensor

MS_NS = 1_000_000
QUIET = Sensor(noise_N=0, noise_N_m=0, quantum_N=0, quantum_N_m=0, filter_s=0)
SURFACE_MM = 20.0

Motion = Callable[[float], float]


class Trace:
    """Columns by name; the force is read from the sensor's fz, positive in compression, zero subtracted."""

    def __init__(self, rows: list[tuple[float, ...]]) -> None:
        columns = np.array(rows).T
        self.time_s, self.axis_mm, self.tip_mm, self.speed_mm_s, self.force_N, self.contact_N, self.current_A = columns

    def at(self, time_s: float) -> int:
        """Row number of a time since the start of the trace."""
        return round((time_s - float(self.time_s[0])) * 1000)


def quiet_bench(hide: Mapping[str, Mapping[str, float]] | None = None, **tables: object) -> Bench:
    """A bench whose sensor has no noise, with these effects hidden."""
    return Bench(Parameters.model_validate({"force": QUIET, "hide": hide or {}, **tables}))


def play(bench: Bench, motion: Motion, seconds: float) -> Trace:
    """Commands ``motion(time since now)`` every millisecond for ``seconds``."""
    bench.axis.power(True)
    start_ns = bench.now_ns
    rows: list[tuple[float, ...]] = []
    for tick in range(round(seconds * 1000)):
        bench.axis.target(motion(tick * 1e-3))
        bench.advance(start_ns + (tick + 1) * MS_NS)
        force_N = bench.force.zero[2] - bench.force.wrench()[2]
        rows.append(
            (bench.time_s, bench.axis.position_mm, bench.tip_mm, bench.axis.velocity_mm_s, force_N, bench.contact_N,
             bench.axis.current_A)
        )  # fmt: skip
    return Trace(rows)


def settle(bench: Bench, position_mm: float, seconds: float = 2.0) -> Trace:
    """Goes to ``position_mm`` at 20 mm/s and waits there."""
    start_mm = bench.axis.position_mm
    side = 1.0 if position_mm > start_mm else -1.0
    return play(bench, lambda t: side * min(side * start_mm + 20 * t, side * position_mm), seconds)


def stroke(speed_mm_s: float, depth_mm: float, hold_s: float = 0.5, start_mm: float = 15.0) -> Motion:
    """From ``start_mm`` to ``depth_mm`` below the nominal surface, a hold, and back at the same speed."""
    deepest_mm = SURFACE_MM + depth_mm
    there_s = (deepest_mm - start_mm) / speed_mm_s

    def motion(t: float) -> float:
        if t < there_s + hold_s:
            return min(start_mm + speed_mm_s * t, deepest_mm)
        return max(deepest_mm - speed_mm_s * (t - there_s - hold_s), start_mm)

    return motion


def crossing(values: NDArray[np.float64], level: float) -> int:
    """First row at which ``values`` have reached ``level``."""
    return int(np.argmax(values >= level))
