"""From what an axis was told and where it went to its delay and lags: frequency response, fit, and what is refused."""

import math
from datetime import datetime
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import stdtrit as student_t

from controller.commissioning.sweep import RUN_IN_S, TURN_MM_S, AirSweep, steady_mm
from drivers.roles import Identity
from rig.config.axis_dynamics import AxisDynamics, Reversal, TimeEstimate
from rig.config.wiring import Wiring
from rig.errors import CheckFailed
from rig.recording.slope import COVERAGE

Column = NDArray[np.float64]
Spectrum = NDArray[np.complex128]

LINES = 24
# Of each cycle that is missed the set-point stands twice as long; with more of them it is no sweep of this loop.
LARGEST_MISSED = 0.02
# The two ways of a turn are compared where a lag of 10 ms and the stick after the turn are over: in their second half.
SETTLED = 0.5
# Of the run-in, where its transients are over: what the axis lags by at its steady speed.
BASE_S = 0.02
# No axis is a delay and two lags to better than a hundredth.
LEAST_DEVIATION = 0.01
# Half of the smallest gain that can be meant: below it the axis does not move, or not by its set-point.
LEAST_GAIN = 0.5


class SweepRecord(NamedTuple):
    """What was told and what came: columns by cycle and by axis sample; times in s from the begin of the first sweep.

    ``told_s`` is when the loop looked at its inputs, ``force_age_s`` how old the newest force was then.
    """

    told_s: Column
    told_mm: Column
    force_age_s: Column
    position_s: Column
    position_mm: Column
    current_A: Column
    missed: int

    @property
    def period_s(self) -> float:
        """Time between set-points, median."""
        return float(np.median(np.diff(self.told_s)))


class FrequencyResponse(NamedTuple):
    """Set-point to position by frequency, shape (lines,): of all repeats, with each left out in turn, and coherence."""

    frequency_Hz: Column
    mean: Spectrum
    left_out: Spectrum
    coherence: Column

    @property
    def deviation(self) -> Column:
        """Relative standard deviation of ``mean`` (Bendat and Piersol, Random Data, 9.2), no less than LEAST."""
        count = len(self.left_out)
        random = np.sqrt((1 - self.coherence) / (2 * count * self.coherence))
        return np.asarray(np.hypot(random, LEAST_DEVIATION))


class ResponseFit(NamedTuple):
    """Parameters of the fit; ``product_s2`` is lag1 times lag2, ``sum_s`` their sum."""

    gain: float
    delay_s: float
    sum_s: float
    product_s2: float

    @property
    def lags_s(self) -> tuple[float, float]:
        """Both lags, the shorter first."""
        spread = math.sqrt(max(0.25 * self.sum_s**2 - self.product_s2, 0.0))
        return max(0.5 * self.sum_s - spread, 0.0), 0.5 * self.sum_s + spread


def identify(
    drive: Identity, wiring: Wiring, sweep: AirSweep, followed: SweepRecord, now: datetime, computer: str
) -> AxisDynamics:
    """The calibration that a record gives; raises CheckFailed with number and bound where it says too little."""
    _refuse_missed(followed)
    _refuse_sense(followed)
    response = response_of(sweep, followed)
    best = fit(response, response.mean)
    misfit, within = _misfit(response, best), _within(response, best)
    short_s, long_s = best.lags_s
    lag_within_s = _lag_within_s(best, within)
    dynamics = AxisDynamics(
        product=drive.product,
        serial=drive.serial,
        date=now,
        computer=computer,
        rate_Hz=wiring.loop.rate_Hz,
        force_product=wiring.force.product,
        gain=best.gain,
        delay=TimeEstimate(s=best.delay_s, within_s=within[1]),
        lag1=TimeEstimate(s=short_s, within_s=lag_within_s),
        lag2=TimeEstimate(s=long_s, within_s=lag_within_s),
        total=TimeEstimate(s=best.delay_s + best.sum_s, within_s=within[4]),
        reversal=reversal_of(sweep, followed, best.delay_s + best.sum_s),
        lowest_Hz=sweep.lowest_Hz,
        highest_Hz=sweep.highest_Hz,
        coherence=float(response.coherence[response.frequency_Hz <= wiring.axis.bandwidth_Hz].min()),
        misfit=misfit,
        force_filter_s=0.5 / wiring.force.sampled_Hz,
        force_age_s=float(followed.force_age_s.mean()),
    )
    if dynamics.doubts:
        raise CheckFailed("; ".join(dynamics.doubts))
    return dynamics


def response_of(sweep: AirSweep, followed: SweepRecord) -> FrequencyResponse:
    """Each way stands for itself: off its steady speed it begins and ends at rest, so that no window is needed."""
    low_Hz, high_Hz = max(1.5 * sweep.lowest_Hz, 1 / sweep.sweep_s), sweep.highest_Hz - sweep.resolution_Hz
    frequency_Hz = np.geomspace(low_Hz, high_Hz, LINES)
    pairs = [_spectra(sweep, followed, frequency_Hz, at) for at in range(sweep.repeats)]
    told, went = (np.array(side) for side in zip(*pairs, strict=True))
    cross, told_power = np.sum(np.conj(told) * went, axis=0), np.sum(np.abs(told) ** 2, axis=0)
    coherence = np.abs(cross) ** 2 / (told_power * np.sum(np.abs(went) ** 2, axis=0))
    crosses, powers = np.conj(told) * went, np.abs(told) ** 2
    left_out = (cross - crosses) / (told_power - powers)
    return FrequencyResponse(frequency_Hz, cross / told_power, left_out, coherence)


def _spectra(sweep: AirSweep, followed: SweepRecord, frequency_Hz: Column, way: int) -> tuple[Spectrum, Spectrum]:
    """Fourier integrals of what was told, held from cycle to cycle, and of where the axis was."""
    begin_s, end_s = way * sweep.each_s + RUN_IN_S, (way + 1) * sweep.each_s
    omega = 2 * np.pi * frequency_Hz[:, None]
    told_s, told_mm = _off_way(sweep, followed.told_s, followed.told_mm, begin_s, end_s, 0.5 * followed.period_s)
    turned = np.exp(-1j * omega * np.append(told_s, end_s))
    told = ((turned[:, :-1] - turned[:, 1:]) / (1j * omega)) @ told_mm
    at_s, at_mm = _off_way(sweep, followed.position_s, followed.position_mm, begin_s, end_s, 0.0)
    return told, np.exp(-1j * omega * at_s) @ (np.gradient(at_s) * at_mm)


def _off_way(
    sweep: AirSweep, time_s: Column, along_mm: Column, begin_s: float, end_s: float, held_s: float
) -> tuple[Column, Column]:
    """Times and places in the window, less the steady way; ``held_s``: how old a set-point is on average."""
    inside = (time_s >= begin_s) & (time_s < end_s)
    way_mm = np.array([steady_mm(sweep, at_s) for at_s in time_s[inside] + held_s])
    off_mm = along_mm[inside] - way_mm
    before = (time_s >= begin_s - BASE_S) & (time_s < begin_s)
    base_mm = along_mm[before] - np.array([steady_mm(sweep, at_s) for at_s in time_s[before] + held_s])
    return time_s[inside], off_mm - base_mm.mean()


def model(frequency_Hz: Column, gain: float, delay_s: float, sum_s: float, product_s2: float) -> Spectrum:
    """A pure delay and two lags."""
    s = 2j * np.pi * frequency_Hz
    return np.asarray(gain * np.exp(-s * delay_s) / (1 + sum_s * s + product_s2 * s**2))


def fit(response: FrequencyResponse, measured: Spectrum) -> ResponseFit:
    """Weighted least squares of fitted over ``measured`` response, by what is known of each frequency."""

    def residuals(values: Column) -> Column:
        gain, delay_ms, sum_ms, share = values
        product = share * (0.5 * sum_ms) ** 2
        return _weighed(response, measured, gain, 1e-3 * delay_ms, 1e-3 * sum_ms, 1e-6 * product)

    bounds = ([LEAST_GAIN, 0.0, 0.0, 0.0], [1 / LEAST_GAIN, 100.0, 200.0, 1.0])
    found = least_squares(residuals, [1.0, 1.0, 5.0, 0.8], bounds=bounds, x_scale="jac").x
    gain, delay_ms, sum_ms, share = (float(value) for value in found)
    return ResponseFit(gain, 1e-3 * delay_ms, 1e-3 * sum_ms, 1e-6 * share * (0.5 * sum_ms) ** 2)


def _weighed(response: FrequencyResponse, measured: Spectrum, *parameters: float) -> Column:
    """What the model lies off ``measured``, relative and by what is known of each frequency; real and imaginary."""
    ratio = (model(response.frequency_Hz, *parameters) / measured - 1) / response.deviation
    return np.concatenate([ratio.real, ratio.imag])


def _misfit(response: FrequencyResponse, best: ResponseFit) -> float:
    """Rms over all frequencies, each by what is known of it."""
    weights = response.deviation**-2
    off = np.abs(model(response.frequency_Hz, *best) / response.mean - 1) ** 2
    return float(np.sqrt(np.sum(weights * off) / np.sum(weights)))


def _within(response: FrequencyResponse, best: ResponseFit) -> Column:
    """Half 95 % intervals of the four parameters and of delay and sum together.

    What repeats scatter by (jackknife), and what the shape that was fitted leaves over, which no repeat shows.
    """
    rows = np.array([[*one, one.delay_s + one.sum_s] for one in (fit(response, each) for each in response.left_out)])
    count = len(rows)
    scatter = student_t(count - 1, 0.975) * np.sqrt((count - 1) * rows.var(axis=0))
    together = np.vstack([np.eye(4), [0, 1, 1, 0]])
    shape = COVERAGE * np.sqrt(np.diag(together @ _covariance(response, best) @ together.T))
    return np.asarray(np.hypot(scatter, shape))


def _covariance(response: FrequencyResponse, best: ResponseFit) -> Column:
    """Of the four parameters, by the residuals' own size where that is larger than their deviations."""
    steps = np.diag([1e-4, 1e-6, 1e-6, 1e-9])
    at = _weighed(response, response.mean, *best)
    jacobian = np.array([(_weighed(response, response.mean, *(best + step)) - at) / step.sum() for step in steps]).T
    size = max(1.0, float(at @ at) / (len(at) - len(steps)))
    return np.asarray(size * np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-20))


def _lag_within_s(best: ResponseFit, within: Column) -> float:
    """Lags of the least and the largest product that the interval holds, at its sum: equal ones are known worst."""
    ends = [best._replace(product_s2=best.product_s2 + side * within[3]).lags_s for side in (-1, 1)]
    return 0.5 * float(within[2]) + max(abs(end[0] - best.lags_s[0]) for end in ends)


def reversal_of(sweep: AirSweep, followed: SweepRecord, lag_s: float) -> Reversal:
    """Of the slow ways: the second half of each, one value a turn."""
    begin_s = sweep.turns_begin_s + 0.25 * sweep.turn_s
    turns = [_turn(sweep, followed, begin_s + at * sweep.turn_s) for at in range(sweep.turns)]
    lost_mm, friction_A = (np.array(side) for side in zip(*turns, strict=True))
    spread = student_t(len(turns) - 1, 0.975) / math.sqrt(len(turns))
    told = bool(np.isfinite(friction_A).all())  # not every drive tells its current
    return Reversal(
        lost_mm=float(lost_mm.mean()) - TURN_MM_S * lag_s,
        lost_within_mm=float(spread * lost_mm.std(ddof=1)),
        friction_A=float(friction_A.mean()) if told else None,
        friction_within_A=float(spread * friction_A.std(ddof=1)) if told else None,
    )


def _turn(sweep: AirSweep, followed: SweepRecord, begin_s: float) -> tuple[float, float]:
    """Half of the band between both ways [mm], and half of the difference of current [A]."""
    told_mm = np.interp(followed.position_s, followed.told_s, followed.told_mm)
    ways = []
    for start_s in (begin_s, begin_s + 0.5 * sweep.turn_s):
        from_s, to_s = start_s + SETTLED * 0.5 * sweep.turn_s, start_s + 0.5 * sweep.turn_s
        inside = (followed.position_s >= from_s) & (followed.position_s < to_s)
        behind_mm = told_mm[inside] - followed.position_mm[inside]
        ways.append((float(behind_mm.mean()), float(followed.current_A[inside].mean())))
    back, forth = ways
    return 0.5 * (forth[0] - back[0]), 0.5 * (forth[1] - back[1])


def _refuse_missed(followed: SweepRecord) -> None:
    share = followed.missed / (followed.missed + len(followed.told_s))
    if share > LARGEST_MISSED:
        raise CheckFailed(
            f"{100 * share:.1f} % of the cycles were missed (bound {100 * LARGEST_MISSED:g} %): what was seen is the"
            " computer, not the axis; end what else runs on it, and give loop.priority"
        )


def _refuse_sense(followed: SweepRecord) -> None:
    """Of the ways there and back: in the lowest lines an axis of the other sense leaves twice the steady way."""
    told_mm = np.interp(followed.position_s, followed.told_s, followed.told_mm)
    gain = float(np.polyfit(told_mm, followed.position_mm, 1)[0])
    if not gain > LEAST_GAIN:
        raise CheckFailed(
            f"the axis' position goes {gain:.2f} mm for each millimetre of its set-point (least {LEAST_GAIN:g}):"
            " check axis.direction, axis.increments_per_mm and whether the drive follows cyclic positions"
        )
