"""A pain glove against known weights: each finger under each, up and down again, and what keeps it from being used."""

import time
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from controller.commissioning.readings import FEWEST_SAMPLES, LATEST_NS
from controller.commissioning.weights import Weights
from drivers.input_role import Input
from drivers.roles import Identity
from rig.config.glove import SATURATED, FingerCalibration, GloveCalibration
from rig.errors import CheckFailed, DeviceError
from rig.input_streams import InputSample

# Of 1023: less is a step or two of noise, and the finger's wire or the weight is not where it should be.
LEAST_RISE = 20.0
# Of the finger's own range. Force-sensing resistors have a tenth of hysteresis by their data sheets.
LARGEST_DIFFERENCE = 0.15
# A weight that shows on another finger by half as much lies on both.
LARGEST_CROSS_TALK = 0.5
PERIOD_S = 0.005
Counts = Mapping[str, float]


class FingerReading(NamedTuple):
    """Means of all fingers' counts, and rms of each about its mean."""

    mean: Counts
    rms: Counts


def read(
    glove: Input,
    fingers: Sequence[str],
    seconds: float,
    settle_s: float,
    now: Callable[[], int] = time.monotonic_ns,
    sleep: Callable[[float], None] = time.sleep,
) -> FingerReading:
    """Rests ``settle_s``, then reads for ``seconds`` by the times of the samples."""
    begin_ns = now() + round(settle_s * 1e9)
    end_ns = begin_ns + round(seconds * 1e9)
    found = list[InputSample]()
    while (at_ns := now()) < end_ns + LATEST_NS and not (found and found[-1].capture_ns >= end_ns):
        found.extend(glove.poll(at_ns))
        sleep(PERIOD_S)
    inside = [sample for sample in found if begin_ns <= sample.capture_ns < end_ns]
    if len(inside) < FEWEST_SAMPLES:
        raise DeviceError(f"the glove gave {len(inside)} samples, {FEWEST_SAMPLES} are needed; run `rig doctor`")
    counts = np.array([sample.values[-len(fingers) :] for sample in inside])
    return FingerReading(_by(fingers, counts.mean(axis=0)), _by(fingers, counts.std(axis=0)))


def _by(fingers: Sequence[str], values: Sequence[float]) -> Counts:
    return {finger: float(value) for finger, value in zip(fingers, values, strict=True)}


def calibrate(
    identity: Identity,
    fingers: Sequence[str],
    weights: Weights,
    put_on: Callable[[str, float], object],
    look: Callable[[], FingerReading],
    date: datetime,
) -> GloveCalibration:
    """The calibration, each load [N] put on a finger by ``put_on``; raises CheckFailed with what is wrong."""
    return GloveCalibration(
        product=identity.product,
        firmware=identity.firmware,
        date=date,
        fingers={finger: _of_finger(finger, weights, put_on, look) for finger in fingers},
    )


def _of_finger(
    finger: str, weights: Weights, put_on: Callable[[str, float], object], look: Callable[[], FingerReading]
) -> FingerCalibration:
    found: list[tuple[float, FingerReading]] = []
    for load_N in weights.sequence_N:
        put_on(finger, load_N)
        found.append((load_N, look()))
    _refuse_elsewhere(finger, found)
    loads_N = (0.0, *weights.loads_N)
    counts = [[reading.mean[finger] for load_N, reading in found if load_N == wanted_N] for wanted_N in loads_N]
    means = [float(np.mean(each)) for each in counts]
    rise = means[-1] - means[0]
    differences = [max(each) - min(each) for each in counts]
    _refuse(finger, loads_N[-1], means, max(differences) / rise if rise > 0 else 0.0)
    return FingerCalibration(
        loads_N=loads_N,
        counts=tuple(means),
        noise_counts=found[0][1].rms[finger],
        repeatability=max(differences) / rise,
    )


def _refuse(finger: str, heaviest_N: float, means: Sequence[float], difference: float) -> None:
    rise = means[-1] - means[0]
    if rise < LEAST_RISE:
        raise CheckFailed(
            f"{finger}: its reading rose by {rise:.0f} counts under {heaviest_N:.3g} N (at least {LEAST_RISE:g});"
            " look at its wire and pin, and put the weight on its sensor"
        )
    if means[-1] >= SATURATED:
        raise CheckFailed(f"{finger}: its converter is at its end under {heaviest_N:.3g} N; use lighter weights")
    if any(after <= before for before, after in pairwise(means)):
        raise CheckFailed(f"{finger}: its reading does not rise from weight to weight; put each on its sensor, alone")
    if difference > LARGEST_DIFFERENCE:
        raise CheckFailed(
            f"{finger}: its readings up and down differ by {difference:.0%} of its range (at most"
            f" {LARGEST_DIFFERENCE:.0%}); let each weight rest, or use another sensor"
        )


def _refuse_elsewhere(finger: str, found: Sequence[tuple[float, FingerReading]]) -> None:
    """A weight on the wrong finger is the mistake that is made."""
    empty = found[0][1].mean
    heaviest = max(found, key=lambda one: one[0])[1].mean
    rises = {name: heaviest[name] - empty[name] for name in empty}
    other = max((name for name in rises if name != finger), key=lambda name: rises[name], default=finger)
    if other != finger and rises[other] > max(LARGEST_CROSS_TALK * rises[finger], LEAST_RISE):
        raise CheckFailed(f"{finger}: the weight lay on {other} (its reading rose by {rises[other]:.0f} counts)")
