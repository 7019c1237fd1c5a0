"""Strokes seen on two clocks: tissue of laws that the estimator of the lag does not hold, a drive that accelerates."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.intake.lag import Lag, TimedSignal

Array = NDArray[np.float64]
STEP_S = 5e-4
TISSUES = ("elastic", "viscous", "power-law memory", "Hunt-Crossley")


class Sensor(NamedTuple):
    """Noise and rate of a force sensor."""

    noise_N: float
    rate_Hz: float


SENSORS = {"bota": Sensor(0.005, 1000.0), "ft300": Sensor(0.05, 100.0)}


class Seen(NamedTuple):
    """A follower on its own clock, the motion, and what is truly added to the follower's times: a line of them."""

    follower: TimedSignal
    motion: TimedSignal
    offset_s: float
    drift: float

    def missed_s(self, lag: Lag) -> Array:
        """How far the lag found is off, in its middle and at both ends of the follower."""
        at_s = np.array([lag.at_s, *self.follower.time_s[[0, -1]]])
        return np.abs(lag.offset_s + lag.drift * (at_s - lag.at_s) - (self.offset_s + self.drift * at_s))


def pressed(tissue: str, sensor: Sensor, seed: int, preload: bool = False) -> Seen:
    """Force and axis of one to four unlike cycles."""
    random = np.random.default_rng(seed)
    time_s, place_mm = strokes(random, preload)
    force_N = force_of(tissue, place_mm + (3.0 if preload else 0.0), random) * (4.0 if sensor.noise_N > 0.01 else 1.0)
    return _seen(time_s, place_mm, force_N, sensor.noise_N, sensor.rate_Hz, random)


def tracked(seed: int) -> Seen:
    """The tip by a camera, behind a frame that gives, and the axis, over one to four unlike cycles."""
    random = np.random.default_rng(seed)
    time_s, place_mm = strokes(random, preload=False)
    tip_mm = place_mm - force_of("viscous", place_mm, random) / random.uniform(10, 100)
    scale = random.choice([-1.0, 1.0]) * random.uniform(0.9, 1.1)
    noise_mm, rate_Hz = random.uniform(0.01, 0.1), random.choice([60.0, 120.0, 250.0])
    return _seen(time_s, place_mm, scale * tip_mm, noise_mm, rate_Hz, random)


def strokes(random: np.random.Generator, preload: bool) -> tuple[Array, Array]:
    """Times [s] and depths [mm] from the surface: rests, ramps with acceleration, holds, no two cycles alike."""
    parts = [np.zeros(round(random.uniform(0.5, 2.0) / STEP_S))]
    for _ in range(random.integers(1, 5)):
        way_mm, speed_mm_s = random.uniform(3, 10), random.uniform(3, 20)
        hold_s = random.choice([0.0, random.uniform(0.5, 3.0)])
        parts += [_moving(way_mm, speed_mm_s), np.zeros(round(hold_s / STEP_S)), -_moving(way_mm, speed_mm_s)]
        parts += [np.zeros(round(random.uniform(0.5, 2.0) / STEP_S))]
    speeds = np.concatenate(parts)
    ramp = max(round(random.uniform(0.01, 0.08) / STEP_S), 1)
    speeds = np.convolve(speeds, np.full(ramp, 1 / ramp), mode="same")
    air_mm = 0.0 if preload else random.uniform(0.5, 1.5)
    time_s: Array = STEP_S * np.arange(len(speeds), dtype=np.float64)
    return time_s, np.asarray(np.cumsum(speeds) * STEP_S - air_mm)


def _moving(way_mm: float, speed_mm_s: float) -> Array:
    return np.full(round(way_mm / speed_mm_s / STEP_S), speed_mm_s)


def force_of(tissue: str, place_mm: Array, random: np.random.Generator) -> Array:
    """Force [N] of the tissue, never a pull."""
    depth_mm = np.maximum(place_mm, 0.0)
    speed_mm_s = np.gradient(place_mm, STEP_S) * (place_mm > 0)
    stiffness, stiffening = random.uniform(0.1, 0.5), random.uniform(0.05, 0.3)
    elastic_N = stiffness * depth_mm * np.exp(stiffening * depth_mm)
    if tissue == "viscous":
        elastic_N = elastic_N + random.uniform(0.0, 0.02) * speed_mm_s
    if tissue == "Hunt-Crossley":
        elastic_N = elastic_N * (1 + random.uniform(0.0, 0.01) * speed_mm_s)
    if tissue == "power-law memory":
        elastic_N = _remembered(elastic_N, random.uniform(0.05, 0.25))
    return np.asarray(np.maximum(elastic_N, 0.0))


def _remembered(elastic_N: Array, power: float) -> Array:
    """Force that relaxes as (1 + t/10 ms) to the minus ``power``, by the convolution itself."""
    kernel = (1 + STEP_S * np.arange(len(elastic_N)) / 0.01) ** -power
    size = 2 * len(elastic_N)
    gains = np.diff(elastic_N, prepend=0.0)
    return np.asarray(np.fft.irfft(np.fft.rfft(kernel, size) * np.fft.rfft(gains, size), size)[: len(elastic_N)])


def _seen(
    time_s: Array, place_mm: Array, value: Array, noise: float, rate_Hz: float, random: np.random.Generator
) -> Seen:
    offset_s, drift = random.uniform(-50, 50), random.uniform(-80e-6, 80e-6)
    start_s, end_s = random.uniform(0, 0.4, 2)
    own_s = np.arange(start_s, time_s[-1] - end_s, 1 / rate_Hz)
    true_s = np.arange(random.uniform(0, 1e-3), time_s[-1], 1 / random.choice([200.0, 500.0, 1000.0]))
    axis_mm = np.round(np.interp(true_s, time_s, place_mm), 3)
    sensed = np.interp(own_s, time_s, value) + noise * random.standard_normal(len(own_s))
    # A time t of the follower is t + offset + drift t on the axis' clock.
    return Seen(TimedSignal((own_s - offset_s) / (1 + drift), sensed), TimedSignal(true_s, axis_mm), offset_s, drift)
