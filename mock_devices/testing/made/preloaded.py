"""Loadings that begin in contact or at the surface, on tissue of laws that no estimator of contact knows."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.trials.cycles import IndentationCycle

Column = NDArray[np.float64]
SURFACE_MM, STROKE_MM, STEP_S = 20.0, 6.0, 1e-3
LAWS: Mapping[str, Callable[[Column], Column]] = {
    "linear": lambda x: 0.3 * x,
    "sphere (Hertz)": lambda x: 0.15 * x**1.5,
    "cone (Sneddon)": lambda x: 0.06 * x**2,
    "Fung": lambda x: 0.25 * np.expm1(0.45 * x),
    "index": lambda x: 0.12 * x * np.exp(0.22 * x),
    "Ogden": lambda x: 0.48 * ((1 - x / 20) ** -5 - 1),
    "two layers": lambda x: 0.1 * x + 0.5 * np.maximum(x - 2.5, 0) ** 1.3,
}
# Between and beyond the powers that the estimator knows, of falling stiffness, and with a toe and layers.
OTHER_LAWS: Mapping[str, Callable[[Column], Column]] = {
    "power 1.25": lambda x: 0.2 * x**1.25,
    "power 2.25": lambda x: 0.04 * x**2.25,
    "yielding": lambda x: 0.6 * np.log1p(x),
    "toe and skin": lambda x: 0.05 * x + 0.4 * (np.sqrt(1 + (x / 1.5) ** 2) - 1),
    "three layers": lambda x: 0.06 * x + 0.15 * np.maximum(x - 1, 0) + 0.5 * np.maximum(x - 3, 0),
}


class Sensor(NamedTuple):
    """Noise and rate of a force sensor, how much stiffer the tissue is that it is used on, and at what speeds."""

    noise_N: float
    rate_Hz: float
    stiffer: float
    speeds_mm_s: tuple[float, ...] = (1.0, 5.0, 10.0)


SENSORS = {
    "bota": Sensor(0.005, 1000.0, 1.0),
    "ft300": Sensor(0.05, 100.0, 10.0),
    "cell": Sensor(0.002, 10.0, 1.0, (0.5, 1.0)),
}


def preloaded(law: str, sensor: Sensor, seed: int, air_mm: float = 0.0) -> IndentationCycle:
    """A stroke of 6 mm from a preload held until it has relaxed, or from the air; every other lifts out at the end."""
    random = np.random.default_rng([seed, [*LAWS, *OTHER_LAWS].index(law)])
    lost, tau_s = random.uniform(0, 0.5), 10 ** random.uniform(-0.7, 1)
    damping_N_s_mm, speed_mm_s = random.uniform(0, 0.004) * sensor.stiffer, random.choice(sensor.speeds_mm_s)
    stiffness = {**LAWS, **OTHER_LAWS}[law]
    depths_mm = np.linspace(0, 12, 4000)
    preload_N = random.choice([0.0, 1.0]) * 10 ** random.uniform(-3, -1.3) * float(stiffness(depths_mm)[2000])
    start_mm = float(np.interp(preload_N / (1 - lost), stiffness(depths_mm), depths_mm))
    start_mm = -air_mm if air_mm else start_mm
    way_mm = np.arange(0, STROKE_MM + air_mm, speed_mm_s * STEP_S)
    parts = [np.full(600, 0.0), way_mm, np.full(500, way_mm[-1])]
    if seed % 2:
        parts += [np.arange(way_mm[-1], -start_mm - 1.5, -speed_mm_s * STEP_S), np.full(300, -start_mm - 1.5)]
    depth_mm = start_mm + np.concatenate(parts)
    elastic_N = stiffness(np.maximum(depth_mm, 0))
    force_N = (1 - lost) * elastic_N + lost * _recent(elastic_N, tau_s)
    force_N += damping_N_s_mm * np.gradient(depth_mm, STEP_S) * (depth_mm > 0)
    time_s = STEP_S * np.arange(len(depth_mm))
    taken_s = np.arange(0, time_s[-1], 1 / sensor.rate_Hz)
    sensed_N = sensor.stiffer * np.maximum(np.interp(taken_s, time_s, force_N), 0)
    sensed_N += sensor.noise_N * random.standard_normal(len(taken_s))
    position_mm = SURFACE_MM + np.interp(taken_s, time_s, depth_mm)
    return IndentationCycle(f"{law} {seed}", float("nan"), taken_s, sensed_N, position_mm)


def uneven(law: str, sensor: Sensor, seed: int) -> IndentationCycle:
    """A stroke from 3 mm of air of which three samples in ten have come, at random."""
    cycle = preloaded(law, sensor, seed, air_mm=3.0)
    count = len(cycle.time_s)
    kept = np.sort(np.random.default_rng([seed, 7]).choice(count, int(0.3 * count), replace=False))
    return replace(
        cycle, time_s=cycle.time_s[kept], force_N=cycle.force_N[kept], position_mm=cycle.position_mm[kept]
    )  # fmt: skip


def stepped(law: str, sensor: Sensor, seed: int, step_mm: float = 0.25) -> IndentationCycle:
    """A stroke from 3 mm of air in steps of 50 ms, each followed by a rest of 250 ms in which tissue relaxes."""
    random = np.random.default_rng([seed, 99])
    lost, tau_s, first_mm = random.uniform(0, 0.5), 10 ** random.uniform(-0.7, 1), -3.0 - random.uniform(0, step_mm)
    marks_mm = first_mm + step_mm * np.arange(int((STROKE_MM + 3.0) / step_mm))
    steps = [(np.linspace(mark, mark + step_mm, 50, endpoint=False), np.full(250, mark + step_mm)) for mark in marks_mm]
    depth_mm = np.concatenate([np.full(600, first_mm), *(part for step in steps for part in step)])
    elastic_N = {**LAWS, **OTHER_LAWS}[law](np.maximum(depth_mm, 0))
    force_N = (1 - lost) * elastic_N + lost * _recent(elastic_N, tau_s)
    time_s = STEP_S * np.arange(len(depth_mm))
    taken_s = np.arange(0, time_s[-1], 1 / sensor.rate_Hz)
    sensed_N = sensor.stiffer * np.interp(taken_s, time_s, force_N)
    sensed_N += sensor.noise_N * random.standard_normal(len(taken_s))
    position_mm = SURFACE_MM + np.interp(taken_s, time_s, depth_mm)
    return IndentationCycle(f"{law} {seed}", float("nan"), taken_s, sensed_N, position_mm)


def _recent(elastic_N: Column, tau_s: float) -> Column:
    """What of the force is not yet relaxed, from a start at which all was."""
    kept, recent = np.exp(-STEP_S / tau_s), np.zeros_like(elastic_N)
    for i, gain in enumerate(np.diff(elastic_N), start=1):
        recent[i] = kept * recent[i - 1] + gain
    return recent
