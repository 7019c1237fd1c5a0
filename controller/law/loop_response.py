"""The force loop over frequency: the law as it is computed, the axis as it was identified, tissue as it may be.

From commanded to sensed force, at one depth, with s = j w, the sample period t and the loop's period T,

    L = wc lead^2 (1 + wd t / (1 - 1/z)) t / ((B' + k t) - B' / z) hold T / (1 - 1/Z) axis (k_true + B_true s)
    lead = 1 + ta (1 - 1/z) / t,  hold = (1 - 1/z) / (1 - 1/Z) T / t,  z = exp(s t), Z = exp(s T)
    axis = exp(-s D) / ((1 + s lag1) (1 + s lag2))

k and B' are the law's, k_true and B_true the tissue's. Only ratios count: the corner k / B', k_true / k, B_true / B'.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.config.axis_response import AxisResponse

Column = NDArray[np.float64]
Complex = NDArray[np.complex128]

LOWEST_RAD_S = 0.3  # a hundredth of the second integral's usual corner
POINTS = 300  # the grid's step is then 3 %, and crossings are interpolated


class Constants(NamedTuple):
    """The three numbers of the law: crossover on tissue that is as the model says, lead, corner of the integral."""

    crossover_rad_s: float
    lead_s: float
    drift_rad_s: float


class Rates(NamedTuple):
    """How often the loop turns, and how often it learns of a new force."""

    cycle_s: float
    sample_s: float

    @property
    def every_cycles(self) -> int:
        """Cycles for which a sample stands."""
        return round(self.sample_s / self.cycle_s)


class TrueTissue(NamedTuple):
    """The tissue at one depth against what the law takes it for; arrays broadcast.

    ``corner_rad_s`` is k / B of the law, ``stiffness`` and ``damping`` are true over law's.
    """

    corner_rad_s: float | Column
    stiffness: float | Column
    damping: float | Column


class Margins(NamedTuple):
    """How far a loop is from instability; of several loops each of shape (loops,)."""

    crossover_rad_s: Column
    phase_deg: Column
    gain: Column


def grid(rates: Rates, points: int = POINTS) -> Column:
    """Frequencies up to half of the loop's rate or the sensor's, whichever is less [rad/s], shape (points,)."""
    return np.geomspace(LOWEST_RAD_S, np.pi / max(rates), points)


def common(axis: AxisResponse, rates: Rates, lead_s: float, omega: Column) -> Complex:
    """What is the same for every tissue, with wc 1 and without the second integral, shape of ``omega``."""
    s, t = 1j * omega, rates.sample_s
    back, cycle_back = np.exp(-s * t), np.exp(-s * rates.cycle_s)
    lead = 1 + lead_s * (1 - back) / t
    hold = (1 - back) / (1 - cycle_back) * rates.cycle_s / t
    axis_there = np.exp(-s * axis.delay_s) / ((1 + s * axis.lag1_s) * (1 + s * axis.lag2_s))
    return np.asarray(lead**2 * hold * rates.cycle_s / (1 - cycle_back) * axis_there)


def tissue_ratio(tissue: TrueTissue, rates: Rates, omega: Column) -> Complex:
    """True tissue over the law's, 1 where they agree and sampling is fast, shape (tissues, frequencies)."""
    corner, stiffness, damping = (np.asarray(part, dtype=np.float64)[..., None] for part in tissue)
    s, t = 1j * omega, rates.sample_s
    return np.asarray((stiffness * corner + damping * s) * t / (1 + corner * t - np.exp(-s * t)))


def drift(drift_rad_s: float, rates: Rates, omega: Column) -> Complex:
    """The second integral beside what it is added to, shape of ``omega``."""
    return np.asarray(1 + drift_rad_s * rates.sample_s / (1 - np.exp(-1j * omega * rates.sample_s)))


def open_loop(axis: AxisResponse, rates: Rates, law: Constants, tissue: TrueTissue, omega: Column) -> Complex:
    """L, shape (tissues, frequencies)."""
    same = common(axis, rates, law.lead_s, omega) * drift(law.drift_rad_s, rates, omega)
    return np.asarray(law.crossover_rad_s * same * tissue_ratio(tissue, rates, omega))


def margins(loop: Complex, omega: Column) -> Margins:
    """Of each row of ``loop``: the highest crossover, and the smallest margins of all crossings.

    The gain margin is the smallest factor, up or down, that brings a crossing of -180 degrees to unity: two integrals
    may pass below -180 degrees where gain is high.
    """
    log_gain = np.log(np.abs(loop))
    phase = np.unwrap(np.angle(loop), axis=-1)
    phase -= 2 * np.pi * np.ceil(phase[..., :1] / (2 * np.pi))  # two integrals begin at -180 degrees, not at 180
    crossing, share = _crossings(log_gain)
    phases = np.where(crossing, _between(phase, share), np.inf)
    log_omega = np.where(crossing, _between(np.broadcast_to(np.log(omega), loop.shape), share), -np.inf)
    turning, share = _crossings(phase + np.pi)
    gains = np.where(turning, np.abs(_between(log_gain, share)), np.inf)
    return Margins(
        np.exp(np.max(log_omega, axis=-1)), np.degrees(np.min(phases, axis=-1) + np.pi), np.exp(np.min(gains, axis=-1))
    )


def _crossings(values: Column) -> tuple[NDArray[np.bool_], Column]:
    """Where neighbours are on two sides of 0, and at which share of the way 0 is."""
    left, right = values[..., :-1], values[..., 1:]
    crosses = (left > 0) != (right > 0)
    return crosses, np.where(crosses, left / np.where(crosses, left - right, 1.0), 0.0)


def _between(values: Column, share: Column) -> Column:
    return np.asarray(values[..., :-1] + share * np.diff(values, axis=-1))


def noise_share(loop: Complex, omega: Column, rates: Rates) -> Column:
    """Standard deviation of the force that the sensor's noise causes, over that of one sample; shape (tissues,)."""
    played = np.abs(loop / (1 + loop)) ** 2
    area = np.sum(0.5 * (played[..., 1:] + played[..., :-1]) * np.diff(omega), axis=-1)
    return np.asarray(np.sqrt(area * rates.sample_s / np.pi))
