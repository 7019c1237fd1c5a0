"""Rested readings of the force sensor: six means and six noises out of the samples of a short while."""

import time
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from drivers.roles import ForceSensor
from rig.channels import ForceSample
from rig.config.products.registry import FORCE_SENSORS
from rig.errors import CheckFailed, DeviceError

# Fewer would not tell noise from a swinging weight.
FEWEST_SAMPLES = 8
PERIOD_S = 0.001
# A loaded computer was seen to hold a process up for 0.4 s; a sensor that says nothing for a second is silent.
LATEST_NS = 1_000_000_000
Six = tuple[float, float, float, float, float, float]


class Reading(NamedTuple):
    """Means and rms about them of Fx Fy Fz [N], Mx My Mz [N m]."""

    mean: Six
    rms: Six
    samples: int


def read(
    sensor: ForceSensor,
    product: str,
    seconds: float,
    settle_s: float,
    now: Callable[[], int] = time.monotonic_ns,
    sleep: Callable[[float], None] = time.sleep,
) -> Reading:
    """Rests ``settle_s``, then reads for ``seconds``; CheckFailed where saturated, DeviceError where silent.

    Both are times of the samples, so that a busy computer neither cuts a reading short nor reads what was before it.
    """
    begin_ns = now() + round(settle_s * 1e9)
    end_ns = begin_ns + round(seconds * 1e9)
    found = list[ForceSample]()
    while (at_ns := now()) < end_ns + LATEST_NS and not (found and found[-1].capture_ns >= end_ns):
        found.extend(sensor.poll(at_ns))
        sleep(PERIOD_S)
    return reading_of([sample for sample in found if begin_ns <= sample.capture_ns < end_ns], product)


def reading_of(samples: Sequence[ForceSample], product: str) -> Reading:
    """Means and noise; raises CheckFailed where a sample is not vouched for or at the end of the product's range.

    ``product`` is that of the configuration, ``force.product``.
    """
    if len(samples) < FEWEST_SAMPLES:
        raise DeviceError(f"{product} gave {len(samples)} samples, {FEWEST_SAMPLES} are needed; run `rig doctor`")
    values = np.array([sample[4:10] for sample in samples])
    at_end = np.abs(values[:, :3]).max(axis=1) >= FORCE_SENSORS[product].range_N
    spoilt = int(np.count_nonzero(at_end | ~np.array([bool(sample.valid) for sample in samples])))
    if spoilt:
        raise CheckFailed(
            f"{product} is saturated, or does not vouch for its readings: {spoilt} of {len(samples)} samples, largest"
            f" {np.nanmax(np.abs(values[:, :3])):.2f} N; unload it and use lighter weights"
        )
    return Reading(_six(values.mean(axis=0)), _six(values.std(axis=0, ddof=1)), len(samples))


def _six(values: Iterable[float]) -> Six:
    fx, fy, fz, mx, my, mz = (float(value) for value in values)
    return fx, fy, fz, mx, my, mz
