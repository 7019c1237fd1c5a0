"""A force calibration from rested readings under known loads along the tip, or one sentence why there is none.

The configuration says which channel lies along the tip and which sign compression has there. The readings must agree:
what they contradict is refused, and only what is left of gain (below 2 %) and cross-talk (below 3 %) goes into the
matrix.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from controller.commissioning.readings import Reading
from controller.commissioning.weights import Weights
from drivers.roles import Identity
from rig.config.calibration import ForceCalibration, Load, Uncertainty
from rig.config.force_map import CHANNELS, ForceMap, Matrix, Vector
from rig.config.products.roles import ForceProduct
from rig.errors import CheckFailed

FloatArray = NDArray[np.float64]

# The factory calibration says 1.00; makers state 0.5 to 2 % of full scale. A gain farther off is a damaged sensor, a
# wrong weight or a wrong unit, and must be understood, not corrected.
LARGEST_GAIN_ERROR = 0.02
# A tip 1.7 degrees out of the sensor's axis shows 3 % of its load across; beyond, load and channel do not belong
# together.
LARGEST_CROSSTALK = 0.03
# Half of the gain's bound, so that neither a bend nor a zero that moves hides in a gain that passes (of the largest
# load).
LARGEST_RESIDUAL = 0.01
LARGEST_DRIFT = 0.01
LEAST_CHANGE = 0.01  # a third of the crosstalk allowed: not even a channel beside the load answers
# Of the largest load: a mean over a second of such a swing at 1 Hz and more is still within a third of a per cent.
LARGEST_SWING = 0.02
# Of a mean: what lies within is not told from noise (1 in 15,000 for a normal distribution).
NOISE_SIGMAS = 4.0


@dataclass(frozen=True)
class Measured:
    """One load [N], positive in compression, and the reading under it."""

    load_N: float
    reading: Reading


def calibrate(
    sensor: Identity,
    config: ForceProduct,
    weights: Weights,
    apply: Callable[[float], None],
    read: Callable[[], Reading],
    now: datetime,
) -> ForceCalibration:
    """Asks for each load with ``apply`` and reads it; raises CheckFailed with the first thing that is wrong."""
    taken: list[Measured] = []
    for load_N in weights.sequence_N:
        apply(load_N)
        taken.append(Measured(load_N, read()))
        if load_N:
            _refuse_wrong_channel(taken[0].reading, taken[-1], config)
        _refuse_unsteady(taken[0].reading, taken[-1], max(map(abs, weights.loads_N)))
    return calibration_of(sensor, config, weights, taken, now)


def calibration_of(
    sensor: Identity, config: ForceProduct, weights: Weights, taken: Sequence[Measured], now: datetime
) -> ForceCalibration:
    """The calibration that readings under known loads give; the first and the last of them are unloaded."""
    loads = np.array([one.load_N for one in taken])
    readings = np.array([one.reading.mean for one in taken])
    slopes, zeros = np.polyfit(loads, readings, 1)
    at = CHANNELS.index(config.axis)
    sign = ForceMap(config.axis, config.compression).sign
    gain = sign * float(slopes[at])
    residuals_N = readings[:, at] - slopes[at] * loads - zeros[at]
    _refuse_drift(taken, loads)
    _refuse_bent(taken, loads, residuals_N, at)
    _refuse_gain(gain, config)
    _refuse_crosstalk(slopes, at)
    zero = (readings[0] + readings[-1]) / 2
    noise = np.sqrt((np.array(taken[0].reading.rms) ** 2 + np.array(taken[-1].reading.rms) ** 2) / 2)
    return ForceCalibration(
        product=sensor.product,
        serial=sensor.serial,
        date=now,
        channel=config.axis,
        compression=config.compression,
        matrix=_matrix(slopes, at, sign),
        zero_N=_three(zero[:3]),
        zero_N_m=_three(zero[3:]),
        noise_N=_three(noise[:3]),
        noise_N_m=_three(noise[3:]),
        loads=tuple(_load(one) for one in taken),
        uncertainty=_uncertainty(weights, loads, residuals_N, gain),
    )


def _matrix(slopes: FloatArray, at: int, sign: float) -> Matrix:
    """Inverse of the sensitivity, whose column of the loaded channel is measured and whose others are the factory's."""
    sensitivity = np.eye(3)
    sensitivity[:, at] = sign * slopes[:3]
    x, y, z = (_three(row) for row in np.linalg.inv(sensitivity))
    return x, y, z


def _three(values: Iterable[float]) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _uncertainty(weights: Weights, loads: FloatArray, residuals_N: FloatArray, gain: float) -> Uncertainty:
    """Type A from the scatter about the line, type B from the weights and the largest residual."""
    spread_N = float(np.sqrt(np.sum((loads - loads.mean()) ** 2)))
    scatter_N = float(np.sqrt(np.sum(residuals_N**2) / (len(loads) - 2)))
    repeatability = scatter_N / spread_N / gain
    linearity = float(np.abs(residuals_N).max()) / gain / float(np.abs(loads).max()) / math.sqrt(3)
    combined = math.sqrt(repeatability**2 + weights.uncertainty**2 + linearity**2)
    return Uncertainty(combined=combined, repeatability=repeatability, weights=weights.uncertainty, linearity=linearity)


def _refuse_wrong_channel(unloaded: Reading, now: Measured, config: ForceProduct) -> None:
    """Dead, another channel, or the other direction: seen with the first weight, before heavier ones are asked for."""
    change_N = np.array(now.reading.mean[:3]) - np.array(unloaded.mean[:3])
    at, load_N = CHANNELS.index(config.axis), abs(now.load_N)
    largest = int(np.argmax(np.abs(change_N)))
    noise_N = NOISE_SIGMAS * _noise_N(unloaded, now.reading, largest)
    if abs(change_N[largest]) < max(LEAST_CHANGE * load_N, noise_N):
        raise CheckFailed(
            f"{load_N:g} N change no force channel by more than {abs(change_N[largest]):.3g} N, less than"
            f" {100 * LEAST_CHANGE:g} % or than noise: is the weight on the tip, and the channel alive?"
        )
    if largest != at:
        raise CheckFailed(
            f"{load_N:g} N change {CHANNELS[largest]} most, by {change_N[largest]:+.3g} N, and {config.axis} by"
            f" {change_N[at]:+.3g} N: force.axis is {config.axis}; correct it, or how the sensor is mounted"
        )
    compressed_N = math.copysign(1.0, now.load_N) * float(change_N[at])
    shown = "positive" if compressed_N > 0 else "negative"
    if shown != config.compression:
        raise CheckFailed(
            f"compression is {shown} on {config.axis}, and force.compression is {config.compression}: correct it, or"
            " say whether the weights press on the tip or hang from it"
        )


def _refuse_unsteady(unloaded: Reading, now: Measured, largest_N: float) -> None:
    limit_N = max(LARGEST_SWING * largest_N, NOISE_SIGMAS * max(unloaded.rms[:3]))
    swing_N = max(now.reading.rms[:3])
    if swing_N > limit_N:
        raise CheckFailed(
            f"the reading under {abs(now.load_N):g} N moves by {swing_N:.2g} N rms (limit {limit_N:.2g} N): let the"
            " weight come to rest, and keep the bench quiet"
        )


def _refuse_drift(taken: Sequence[Measured], loads: FloatArray) -> None:
    first, last = taken[0].reading, taken[-1].reading
    for at, name in enumerate(CHANNELS):
        moved_N, noise_N = last.mean[at] - first.mean[at], NOISE_SIGMAS * _noise_N(first, last, at)
        limit_N = max(LARGEST_DRIFT * float(np.abs(loads).max()), noise_N)
        if abs(moved_N) > limit_N:
            raise CheckFailed(
                f"the zero of {name} moved by {moved_N:+.3g} N between beginning and end (limit {limit_N:.2g} N):"
                " let the sensor warm up, check that nothing touches the tip, calibrate again"
            )


def _refuse_bent(taken: Sequence[Measured], loads: FloatArray, residuals_N: FloatArray, at: int) -> None:
    worst = int(np.argmax(np.abs(residuals_N)))
    noise_N = NOISE_SIGMAS * _noise_N(taken[worst].reading, taken[0].reading, at)
    limit_N = max(LARGEST_RESIDUAL * float(np.abs(loads).max()), noise_N)
    if abs(residuals_N[worst]) > limit_N:
        raise CheckFailed(
            f"the reading under {abs(loads[worst]):g} N lies {residuals_N[worst]:+.3g} N off a straight line (limit"
            f" {limit_N:.2g} N): is each weight what it says, put on alone and at rest?"
        )


def _refuse_gain(gain: float, config: ForceProduct) -> None:
    if abs(gain - 1) > LARGEST_GAIN_ERROR:
        raise CheckFailed(
            f"{config.axis} shows {gain:.3f} N a newton (limit 1 +- {LARGEST_GAIN_ERROR:g}): check weights, units and"
            " how the tip is fastened; a sensor that is off by so much goes to its maker"
        )


def _refuse_crosstalk(slopes: FloatArray, at: int) -> None:
    for other, name in enumerate(CHANNELS):
        share = abs(float(slopes[other] / slopes[at]))
        if other != at and share > LARGEST_CROSSTALK:
            raise CheckFailed(
                f"{name} shows {100 * share:.1f} % of a load along {CHANNELS[at]} (limit"
                f" {100 * LARGEST_CROSSTALK:g} %): is the load along the tip, and the sensor not tilted or overloaded?"
            )


def _noise_N(one: Reading, other: Reading, at: int) -> float:
    """Standard deviation of the difference of two means."""
    return math.hypot(one.rms[at] / math.sqrt(one.samples), other.rms[at] / math.sqrt(other.samples))


def _load(one: Measured) -> Load:
    return Load(load_N=one.load_N, force_N=_three(one.reading.mean[:3]), torque_N_m=_three(one.reading.mean[3:]))
