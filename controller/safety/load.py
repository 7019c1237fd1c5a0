"""The load on the tip, whatever the configuration calls it: norm of all channels, its rate, and where it is going.

A stop takes a while: the newest sample is old when it is looked at, the axis follows its set-point late, and needs a
distance to stand. Until then the load goes on rising by stiffness times way. So what counts is the peak that would be
reached if the axis were stopped now:

    peak = load + k (set-point - position at the sample's capture + v |v| / (2 a))

k is the stiffest of the secants from earlier samples to the newest, each less what noise alone may give, and raised by
what tissue stiffens on the way. Where a limb pushes while the axis stands, load + rate x age of the sample counts.

A channel that dies, loses gain or turns round while the tip presses takes the load away in one sample. Tissue gives it
back by no more than its stiffness times the way out, and on the way in it takes more by its tangent stiffness: what
is missing beyond that has no cause in it.
"""

import math
from collections import deque
from collections.abc import Iterator
from itertools import islice
from typing import NamedTuple, TypeAlias

from controller.loop.setpoint import Setpoint
from rig.config.wiring import Wiring

Wrench: TypeAlias = tuple[float, float, float, float, float, float]
"""fx, fy, fz [N], mx, my, mz [N m], in the sensor's frame."""
NO_WRENCH: Wrench = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NAN_WRENCH: Wrench = (math.nan, math.nan, math.nan, math.nan, math.nan, math.nan)

# Rate from two and a half periods, so that three samples are in it, and never less than 10 ms: at 1 kHz the noise of
# 0.005 N is then 1 N/s, a thousandth of the limit.
RATE_WINDOW_NS = 10_000_000
RATE_PERIODS = 2.5
# How far back secants reach: the axis travels LEAST_TRAVEL_MM in it from 1 mm/s on, below which a stop takes 0.01 mm.
STIFFNESS_WINDOW_NS = 60_000_000
# Below this, force over travel is a limb that moves, not tissue that is stiff; a following error at rest is 0.02 mm.
LEAST_TRAVEL_MM = 0.05
# Beyond this a secant says what the tissue was, not what it is.
LONGEST_TRAVEL_MM = 0.7
# Over this the noise of the noisier product takes no more than 1 N/mm; a shorter secant may lie across a turn.
TELLING_TRAVEL_MM = 0.2
# Samples between the ends of the secants, spread evenly on a logarithmic scale: all sixty would cost the loop 30 us.
LAGS = (1, 2, 3, 5, 8, 13, 21, 34, 55)
# Three standard deviations of a difference of two samples.
NOISE_GUARD = 3.0 * math.sqrt(2.0)
# A zero taken while somebody moved must not blind the prediction; three times the noisier product's 0.05 N.
LARGEST_NOISE_N = 0.15
# Growth of tangent stiffness [1/mm]: the index law exponent of forearms is 0.1 to 0.25; linear tissue is stopped early.
STIFFENING_PER_MM = 0.25
# A filter of a sensor of 1 kHz spreads a jump over two or three samples; the damping of tissue behind a tip that brakes
# from 30 mm/s with 2000 mm/s2 takes 15 ms to go.
VANISHING_NS = 3_000_000
# Half a gain is lost from 0.8 N on: 0.32 N there, which is four standard deviations of a difference of two samples of
# the noisier product, twice.
LEAST_LOADED_N, LEAST_VANISHED_N, LEAST_SHARE = 0.8, 0.3, 0.4
# Stiffer than any limb that is met at a speed that matters (5 N/mm are asked for).
STIFFEST_IN_N_MM = 10.0
# Tissue gives a load back more steeply than it took it, by its memory; a loop that swings on a bone is no lost contact.
UNLOADING, STIFFEST_OUT_N_MM = 2.0, 50.0
# Where no tangent is known the axis went less than LEAST_TRAVEL_MM in STIFFNESS_WINDOW_NS: 0.1 N of a sensor of 1 kHz.
UNKNOWN_OUT_N_MM = 20.0
# A swing of 80 Hz and 0.05 mm passes no place by more between two samples; the softest tissue gives 0.002 N over it.
SAME_PLACE_MM = 0.02
# An axis sample this old is not extrapolated from any further.
LONGEST_AHEAD_NS = 10_000_000


class TipLoad(NamedTuple):
    """What the tip bears: norms from the reference zero [N], [N m], rate [N/s], stiffness [N/mm], peak foreseen [N].

    ``vanished_N`` is the load that went at once and for no reason, 0 where that is little.
    """

    force_N: float
    torque_N_m: float
    rate_N_s: float
    stiffness_N_mm: float
    predicted_N: float
    vanished_N: float


UNKNOWN = TipLoad(math.nan, math.nan, 0.0, 0.0, math.nan, 0.0)


class _Sample(NamedTuple):
    capture_ns: int
    position_mm: float
    wrench: Wrench


class LoadMonitor:
    """Fed with every axis and force sample; ``load`` is asked once a cycle."""

    def __init__(self, period_ns: int) -> None:
        self._filter_ns = period_ns // 2  # what is sampled at a rate was filtered for it, about half a period long
        self._rate_ns = max(RATE_WINDOW_NS, round(RATE_PERIODS * period_ns))
        self._kept_ns = max(STIFFNESS_WINDOW_NS, self._rate_ns)
        self._vanishing = max(1, round(VANISHING_NS / period_ns)) if period_ns else 1
        self._axis: deque[tuple[int, float]] = deque(maxlen=64)
        self._samples: deque[_Sample] = deque()

    def axis(self, capture_ns: int, position_mm: float) -> None:
        """One sample of the axis."""
        self._axis.append((capture_ns, position_mm))

    def force(self, capture_ns: int, wrench: Wrench) -> None:
        """One sample of the force sensor, uncorrected."""
        samples = self._samples
        samples.append(_Sample(capture_ns, self._position(capture_ns - self._filter_ns), wrench))
        while capture_ns - samples[0].capture_ns > self._kept_ns and len(samples) > 3:
            samples.popleft()

    def load(self, now_ns: int, zero: Wrench, noise_N: float, setpoint: Setpoint, acceleration_mm_s2: float) -> TipLoad:
        """The load now, and its peak if the axis were told now to stop; NaN before the first sample."""
        if not self._samples:
            return UNKNOWN
        newest = self._samples[-1]
        load_N, rate_N_s = _force(newest.wrench, zero), self._rate()
        velocity_mm_s = setpoint.velocity_mm_s
        ahead_mm = setpoint.position_mm - newest.position_mm
        ahead_mm += velocity_mm_s * abs(velocity_mm_s) / (2.0 * acceleration_mm_s2)
        stiffness_N_mm = self._stiffness(zero, noise_N, max(ahead_mm, 0.0))
        rise_N = stiffness_N_mm * max(ahead_mm, 0.0)
        pushed_N = rate_N_s * (now_ns - newest.capture_ns) * 1e-9
        peak_N, torque_N_m = load_N + max(rise_N, pushed_N), _torque(newest.wrench, zero)
        return TipLoad(load_N, torque_N_m, rate_N_s, stiffness_N_mm, peak_N, self._vanished_N(zero, noise_N))

    def _rate(self) -> float:
        """Change of the force vector over the window [N/s], as a norm: direction and sign do not matter."""
        samples, newest = self._samples, self._samples[-1]
        first = next(sample for sample in samples if newest.capture_ns - sample.capture_ns <= self._rate_ns)
        span_ns = newest.capture_ns - first.capture_ns
        return _force(newest.wrench, first.wrench) / span_ns * 1e9 if span_ns > self._rate_ns // 2 else 0.0

    def _vanished_N(self, zero: Wrench, noise_N: float) -> float:
        """What two samples lack of what the two before a jump let expect, along their direction."""
        samples, newest = self._samples, self._samples[-1]
        if len(samples) < self._vanishing + 3:
            return 0.0
        then = samples[-2 - self._vanishing]
        load_N, inward_mm = _force(then.wrench, zero), newest.position_mm - then.position_mm
        if load_N < LEAST_VANISHED_N:
            return 0.0
        left_N = max(_along(sample.wrench, then.wrench, zero) for sample in (newest, samples[-2])) / load_N
        if left_N >= (1.0 - LEAST_SHARE) * (load_N + STIFFEST_IN_N_MM * max(inward_mm, 0.0)):
            return 0.0  # whatever the tissue, and the secants would cost the loop 10 us
        expected_N = self._expected_N(then, zero, noise_N)
        least_N = max(LEAST_VANISHED_N, LEAST_SHARE * expected_N)
        vanished_N = expected_N - left_N
        if expected_N < LEAST_LOADED_N or not vanished_N > least_N or self._felt_here(zero, left_N + least_N):
            return 0.0
        return vanished_N

    def _felt_here(self, zero: Wrench, most_N: float) -> bool:
        """Whether no more than that was felt at this place a moment ago: a loop that swings on something stiff."""
        place_mm, before = self._samples[-1].position_mm, len(self._samples) - 3 - self._vanishing
        return any(
            abs(sample.position_mm - place_mm) <= SAME_PLACE_MM and _force(sample.wrench, zero) <= most_N
            for sample in islice(self._samples, before)
        )

    def _expected_N(self, then: _Sample, zero: Wrench, noise_N: float) -> float:
        """The least that a sound sensor would show now, going on from either of the two samples before a jump."""
        newest = self._samples[-1]
        if newest.position_mm < then.position_mm:
            known_N_mm = UNLOADING * self._tangent_before(zero, noise_N, LEAST_TRAVEL_MM)
            per_mm = min(known_N_mm, STIFFEST_OUT_N_MM) or UNKNOWN_OUT_N_MM
        else:
            per_mm = min(self._tangent_before(zero, noise_N, TELLING_TRAVEL_MM), STIFFEST_IN_N_MM)
        before = (then, self._samples[-3 - self._vanishing])
        return min(_force(one.wrench, zero) + per_mm * (newest.position_mm - one.position_mm) for one in before)

    def _tangent_before(self, zero: Wrench, noise_N: float, least_mm: float) -> float:
        """The steepest secant over ``least_mm`` or more, up to where a jump may be [N/mm]; 0 where there is none."""
        secants = self._secants(2 + self._vanishing, zero, noise_N)
        return max((per_mm for per_mm, travel_mm in secants if travel_mm >= least_mm), default=0.0)

    def _stiffness(self, zero: Wrench, noise_N: float, ahead_mm: float) -> float:
        """Tangent stiffness on the way of ``ahead_mm`` before the tip [N/mm], never negative."""
        return max(
            (
                per_mm * (1.0 + STIFFENING_PER_MM * 0.5 * (ahead_mm + travel_mm))
                for per_mm, travel_mm in self._secants(1, zero, noise_N)
            ),
            default=0.0,
        )

    def _secants(self, last: int, zero: Wrench, noise_N: float) -> Iterator[tuple[float, float]]:
        """Force over travel, less what noise may give [N/mm], and travel [mm], up to ``last`` from the end."""
        samples, end, guard_N = self._samples, self._samples[-last], NOISE_GUARD * min(noise_N, LARGEST_NOISE_N)
        load_N, found = _force(end.wrench, zero), False
        for lag in LAGS:
            if lag + last > len(samples):
                return
            then = samples[-last - lag]
            travel_mm, rise_N = end.position_mm - then.position_mm, load_N - _force(then.wrench, zero)
            if travel_mm < 0.0:
                travel_mm, rise_N = -travel_mm, -rise_N
            if travel_mm > LONGEST_TRAVEL_MM and found:
                return
            if travel_mm >= LEAST_TRAVEL_MM and rise_N > guard_N:
                found = True
                yield (rise_N - guard_N) / travel_mm, travel_mm

    def _position(self, capture_ns: int) -> float:
        """The axis at ``capture_ns``: between its samples, or ahead of the newest as it last moved [mm]."""
        axis = self._axis
        if not axis:
            return math.nan
        after = axis[-1]
        for before in reversed(axis):
            if before[0] <= capture_ns and before is not after:
                return _between(before, after, min(capture_ns, axis[-1][0] + LONGEST_AHEAD_NS))
            if before[0] > capture_ns:
                after = before
        return after[1]


def calibrated_zero(wiring: Wiring) -> Wrench:
    """What counts as no load until the first zero of a session: the calibration's zero, else nothing at all."""
    known = wiring.calibration.of_force
    return (*known.zero_N, *known.zero_N_m) if known else NO_WRENCH


def _between(before: tuple[int, float], after: tuple[int, float], at_ns: int) -> float:
    share = (at_ns - before[0]) / (after[0] - before[0]) if after[0] > before[0] else 1.0
    return before[1] + share * (after[1] - before[1])


def _force(wrench: Wrench, zero: Wrench) -> float:
    return math.dist(wrench[:3], zero[:3])


def _along(wrench: Wrench, then: Wrench, zero: Wrench) -> float:
    """Scalar product of two forces [N2]: the first along the second, times the second."""
    (fx_N, fy_N, fz_N, *_), (tx_N, ty_N, tz_N, *_), (zx_N, zy_N, zz_N, *_) = wrench, then, zero
    return (fx_N - zx_N) * (tx_N - zx_N) + (fy_N - zy_N) * (ty_N - zy_N) + (fz_N - zz_N) * (tz_N - zz_N)


def _torque(wrench: Wrench, zero: Wrench) -> float:
    return math.dist(wrench[3:], zero[3:])
