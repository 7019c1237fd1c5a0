"""From a cycle to a loading curve: force zeroed in the air, depth from contact, only while the tip moves steadily."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.trials.contact import Contact, FloatArray, find_contact
from rig.trials.cycles import IndentationCycle
from rig.trials.findings import Finding

# Two samples always lie on a line; the third can contradict it.
LEAST_SAMPLES = 3
# The fewest that have a median and a spread about it.
LEAST_AIR_SAMPLES = 3
# Contact is known to 0.2 mm in a good trial (`contact_within_mm`); air begins half as much again above it.
AIR_MARGIN_MM = 0.3
# So that a fit may move contact by its interval and still see the air above it.
AIR_KEPT_MM = 0.5
# Five standard deviations of a sensor with 10 mN of noise.
LEAST_FORCE_N = 0.05
# Half of what contact is known to in a good trial: a shorter way has no depth that can be told.
LEAST_TRAVEL_MM = 0.1
# Of normal noise two samples in a thousand million lie further off.
OUTLIER_SPREADS = 6
# The clearance of a protocol (4 to 5 mm) is a quarter of its travel or more, so the highest tenth is air.
HIGHEST_SHARE = 0.1
ONSET_SHARE = 0.01  # of 5 N and more: LEAST_FORCE_N, where the data have no noise
SHALLOW_SHARE = 0.15  # deeper force says more of the tissue than of its surface
SEARCH_SHARE = 1.0  # a soft onset may stay below the noise for as long a way as the rest takes
# Five times what contact is known to in a good trial.
LEAST_SEARCH_MM = 1.0
# What contact is known to in a good trial: a smaller way back is no turn, but dither and noise of the axis.
TURN_MM = 0.2
STEADY_SHARE = 0.3  # the nearest of the study's speeds, 15 and 20 mm/s, lie a third apart
# Half of the way that the wanted speed makes: nearer to going on than to standing.
ON_SHARE = 0.5
TOP_SHARE = 0.005  # half of ONSET_SHARE: where the data have no noise, what is so near to the top is the top
SPEED_BASE_MM = 0.5  # places written in hundredths of a millimetre give a speed within 3 %
# A median over twenty samples is known to three tenths of their standard deviation.
FRICTION_SAMPLES = 20
# A step of two standard deviations of single samples is five of the difference of two medians over twenty.
FRICTION_SPREADS = 2.0
FRICTION_FLAT = 0.25  # two medians over ten differ by chance by as much of such a step


@dataclass(frozen=True)
class Curve:
    """Loading at steady speed, from just before contact to the deepest point; arrays have shape (n,).

    ``depth_mm`` counts from ``contact.position_mm``; ``zero_N`` was taken off; ``noise_N`` is the standard deviation
    in the air. ``speed_mm_s`` is the speed asked for, or the speed found where nobody said. ``findings`` say which
    samples of the trial were left out.
    """

    name: str
    speed_mm_s: float
    depth_mm: FloatArray
    force_N: FloatArray
    rate_mm_s: FloatArray
    contact: Contact
    zero_N: float
    noise_N: float
    time_s: FloatArray
    subject: str = ""
    findings: tuple[Finding, ...] = ()

    @property
    def max_force_N(self) -> float:
        """Largest force reached."""
        return float(self.force_N.max())

    @property
    def max_depth_mm(self) -> float:
        """Largest depth reached."""
        return float(self.depth_mm.max())

    @property
    def offset_bounds_mm(self) -> tuple[float, float]:
        """How far the true contact may lie from the one found."""
        found = self.contact.position_mm
        return self.contact.lower_mm - found, self.contact.upper_mm - found


def loading_curve(cycle: IndentationCycle) -> Curve:
    """The loading curve of a cycle that begins in the air, touches, and goes deeper at steady speed.

    The last rise of force from the air to its peak counts, so an earlier touch (the search for contact) does not.
    Raises DataError where there is no contact, no air before it, or no steady loading after it.
    """
    if len(cycle.force_N) < LEAST_SAMPLES:
        raise DataError(f"{cycle.name}: {len(cycle.force_N)} samples; a curve needs at least {LEAST_SAMPLES}")
    cycle, rise = _run_in(cycle, _rise(cycle))
    zeroed, contact, noise_N = _zeroed(cycle, rise)
    wanted_mm_s = _wanted_speed(zeroed, rise)
    kept = _rising(zeroed, _steady(zeroed, rise, wanted_mm_s), noise_N)
    if kept[0] == rise.touch:
        air = np.arange(_descent(zeroed, rise.touch, contact.position_mm - AIR_KEPT_MM), rise.touch)
        kept = np.concatenate([air, kept])
    return Curve(
        name=cycle.name,
        speed_mm_s=cycle.speed_mm_s if np.isfinite(cycle.speed_mm_s) else float(f"{wanted_mm_s:.2g}"),
        depth_mm=zeroed.position_mm[kept] - contact.position_mm,
        force_N=zeroed.force_N[kept],
        rate_mm_s=_rate(zeroed.time_s[kept], zeroed.position_mm[kept], wanted_mm_s),
        contact=contact,
        zero_N=float(cycle.force_N[0] - zeroed.force_N[0]),
        noise_N=noise_N,
        time_s=zeroed.time_s[kept],
    )


class _Rise(NamedTuple):
    """Samples of the cycle at which force leaves the air for good and at which it peaks."""

    touch: int
    peak: int


def _rise(cycle: IndentationCycle) -> _Rise:
    """The last rise from the air to the peak of force; the air is where the tip was highest before the peak."""
    force_N = _despiked(cycle.force_N)
    peak = int(np.argmax(force_N))
    before_mm, before_N = cycle.position_mm[: peak + 1], force_N[: peak + 1]
    travel_mm = float(np.ptp(before_mm))
    high_N = before_N[before_mm <= before_mm.min() + HIGHEST_SHARE * travel_mm]
    zero_N, spread_N = _middle(high_N)
    height_N = float(force_N[peak]) - zero_N
    if height_N < max(10 * spread_N, LEAST_FORCE_N):
        raise DataError(_no_contact(cycle, height_N, spread_N, zero_N - float(force_N.min())))
    air = np.flatnonzero(before_N < zero_N + max(6 * spread_N, ONSET_SHARE * height_N))
    if not len(air) or air[-1] + 1 < LEAST_AIR_SAMPLES:
        raise DataError(
            f"{cycle.name}: no air part: force rises from the first sample, so it has no zero; start higher"
        )
    return _Rise(int(air[-1]) + 1, peak)


def _run_in(cycle: IndentationCycle, rise: _Rise) -> tuple[IndentationCycle, _Rise]:
    """The cycle from where the tip runs in, if the guide has friction: force in the air then steps with motion.

    At rest or on the way up friction is another than on the way down, so the zero of loading is the run-in's own.
    """
    turn = _descent(cycle, rise.touch, -np.inf)
    way_mm = cycle.position_mm[turn : rise.peak + 1] - cycle.position_mm[turn]
    start, stop = np.searchsorted(np.maximum.accumulate(way_mm), (AIR_MARGIN_MM, HIGHEST_SHARE * way_mm[-1]))
    moving_N = cycle.force_N[turn + start : turn + stop]
    if min(len(moving_N), turn) < FRICTION_SAMPLES:
        return cycle, rise
    level_N, spread_N = _middle(moving_N)
    step_N = level_N - _middle(cycle.force_N[turn - FRICTION_SAMPLES : turn])[0]
    early_N, late_N = (float(np.median(half)) for half in np.array_split(moving_N, 2))
    if abs(step_N) < FRICTION_SPREADS * spread_N or abs(late_N - early_N) > FRICTION_FLAT * abs(step_N):
        return cycle, rise
    first = turn + int(start)
    arrays = {name: getattr(cycle, name)[first:] for name in ("time_s", "force_N", "position_mm")}
    shorter = replace(cycle, **arrays)
    return shorter, _rise(shorter)


def _despiked(values: FloatArray) -> FloatArray:
    """Median of three: one wrong sample is no contact and no peak."""
    middle = np.median([values[:-2], values[1:-1], values[2:]], axis=0)
    return np.concatenate([values[:1], middle, values[-1:]])


def _no_contact(cycle: IndentationCycle, height_N: float, spread_N: float, fall_N: float) -> str:
    if fall_N > max(10 * spread_N, LEAST_FORCE_N, height_N):
        return (
            f"{cycle.name}: force falls by {fall_N:.2g} N where the tip goes in: the sign of compression is wrong; "
            "correct force.compression in rig.toml, or `positive` of the force in the mapping"
        )
    return (
        f"{cycle.name}: no contact: force rises by {max(height_N, 0):.2g} N at most "
        f"(at least {max(10 * spread_N, LEAST_FORCE_N):.2g} N is needed to tell it from noise); go deeper"
    )


def _zeroed(cycle: IndentationCycle, rise: _Rise) -> tuple[IndentationCycle, Contact, float]:
    """The cycle less its zero, its contact, and the noise in the air; twice, since what is air depends on contact."""
    _, contact, _ = _zeroed_above(cycle, rise, float(cycle.position_mm[rise.touch]))
    return _zeroed_above(cycle, rise, contact.lower_mm)


def _zeroed_above(cycle: IndentationCycle, rise: _Rise, surface_mm: float) -> tuple[IndentationCycle, Contact, float]:
    """As ``_zeroed``: zero is the mean of what comes before the rise, clear of the surface, without wrong samples."""
    air_N = cycle.force_N[: rise.touch][cycle.position_mm[: rise.touch] < surface_mm - AIR_MARGIN_MM]
    if len(air_N) < LEAST_AIR_SAMPLES:
        raise DataError(
            f"{cycle.name}: no air part: {len(air_N)} samples are clearly above the surface "
            f"(at least {LEAST_AIR_SAMPLES} give a zero); start higher or rest before touching"
        )
    middle_N, spread_N = _middle(air_N)
    usual_N = air_N[np.abs(air_N - middle_N) <= OUTLIER_SPREADS * spread_N] if spread_N else air_N
    zeroed, noise_N = replace(cycle, force_N=cycle.force_N - float(np.mean(usual_N))), float(np.std(usual_N))
    return zeroed, _contact(zeroed, rise, noise_N), noise_N


def _middle(values: FloatArray) -> tuple[float, float]:
    """Median, and the standard deviation that the median absolute deviation stands for in normal noise."""
    middle = float(np.median(values))
    return middle, 1.4826 * float(np.median(np.abs(values - middle)))


def _contact(cycle: IndentationCycle, rise: _Rise, noise_N: float) -> Contact:
    """Contact searched from well above the first clear rise of force to the first sample in it."""
    position_mm, force_N = cycle.position_mm, cycle.force_N
    touch_mm, peak_mm = float(position_mm[rise.touch]), float(position_mm[rise.peak])
    above_mm = max(SEARCH_SHARE * (peak_mm - touch_mm), LEAST_SEARCH_MM)
    start = _descent(cycle, rise.touch, touch_mm - above_mm)
    deep = np.flatnonzero(force_N[rise.touch : rise.peak] > SHALLOW_SHARE * force_N[rise.peak])
    stop = rise.touch + max(int(deep[0]) if len(deep) else 0, LEAST_SAMPLES)
    stop = min(stop, rise.peak + 1)
    search_mm = (max(float(position_mm[start]), touch_mm - above_mm), touch_mm)
    least_N = max(noise_N, 1e-4 * float(force_N[rise.peak]))
    return find_contact(position_mm[start:stop], force_N[start:stop], search_mm, least_N)


def _descent(cycle: IndentationCycle, touch: int, from_mm: float) -> int:
    """Where the way down to ``touch`` passes ``from_mm``, or where it begins if that is deeper."""
    back_mm = cycle.position_mm[touch::-1]
    turned = np.flatnonzero(back_mm > np.minimum.accumulate(back_mm) + TURN_MM)
    way_mm = back_mm[: turned[0]] if len(turned) else back_mm
    passed = np.flatnonzero(way_mm <= from_mm)
    return touch - int(passed[0] if len(passed) else np.argmin(way_mm))


def _wanted_speed(cycle: IndentationCycle, rise: _Rise) -> float:
    """The speed asked for; where nobody said, the middle one by travel, so that holds do not count."""
    loading = slice(rise.touch, rise.peak + 1)
    reached_mm = np.maximum.accumulate(cycle.position_mm[loading])
    if reached_mm[-1] - reached_mm[0] < LEAST_TRAVEL_MM:
        raise DataError(
            f"{cycle.name}: no loading: force rises while the tip does not go deeper; check axis and clocks"
        )
    if np.isfinite(cycle.speed_mm_s):
        return cycle.speed_mm_s
    marks_mm = np.linspace(reached_mm[0], reached_mm[-1], 41)
    times_s = np.interp(marks_mm, *_increasing(reached_mm, cycle.time_s[loading]))
    return float(np.diff(marks_mm)[0] / np.median(np.diff(times_s)))


def _increasing(positions_mm: FloatArray, times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    first = np.concatenate([[True], np.diff(positions_mm) > 0])
    return positions_mm[first], times_s[first]


def _rate(time_s: FloatArray, position_mm: FloatArray, speed_mm_s: float) -> FloatArray:
    """Speed of the tip: slope of position over the time it needs for half a millimetre, at least three samples."""
    half_s = max(SPEED_BASE_MM / speed_mm_s / 2, 1.01 * float(np.median(np.diff(time_s))))
    first = np.searchsorted(time_s, time_s - half_s)
    last = np.searchsorted(time_s, time_s + half_s, side="right")
    return _window_slopes(time_s, position_mm, first, last)


def _window_slopes(
    times_s: FloatArray, positions_mm: FloatArray, first: NDArray[np.intp], last: NDArray[np.intp]
) -> FloatArray:
    """Least-squares slope over samples ``first`` to ``last`` (exclusive) of each window; 0 where time stands still."""
    times, positions = times_s - times_s[0], positions_mm - positions_mm[0]
    count = (last - first).astype(float)
    sum_t, sum_p, sum_tp, sum_tt = (
        _window_sums(values, first, last) for values in (times, positions, times * positions, times**2)
    )
    spread = count * sum_tt - sum_t**2
    return np.divide(count * sum_tp - sum_t * sum_p, spread, out=np.zeros_like(spread), where=spread > 0)


def _window_sums(values: FloatArray, first: NDArray[np.intp], last: NDArray[np.intp]) -> FloatArray:
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(total[last] - total[first])


def _steady(cycle: IndentationCycle, rise: _Rise, wanted_mm_s: float) -> NDArray[np.intp]:
    """Samples between contact and peak that move at the wanted speed, up to where the tip stops.

    Samples of another speed are left out; what follows them counts while the tip has gone on meanwhile (a stumble of
    the clock), and no longer where it has not (a hold).
    """
    span = slice(rise.touch, rise.peak + 1)
    time_s, position_mm = cycle.time_s[span], cycle.position_mm[span]
    rate_mm_s = _rate(cycle.time_s, cycle.position_mm, wanted_mm_s)[span]
    steady = np.flatnonzero(np.abs(rate_mm_s - wanted_mm_s) <= STEADY_SHARE * wanted_mm_s)
    if not len(steady):
        raise DataError(
            f"{cycle.name}: no loading at {wanted_mm_s:.3g} mm/s: between contact and peak the tip moved at "
            f"{rate_mm_s.min():.3g} to {rate_mm_s.max():.3g} mm/s; correct the trial's speed_mm_s"
        )
    went_on = np.diff(position_mm[steady]) >= ON_SHARE * wanted_mm_s * np.diff(time_s[steady])
    stumbled = np.diff(steady) > 1
    stops = np.flatnonzero(stumbled & ~went_on)
    steady = steady[: stops[0] + 1] if len(stops) else steady
    return rise.touch + steady


def _rising(cycle: IndentationCycle, steady: NDArray[np.intp], noise_N: float) -> NDArray[np.intp]:
    """The samples up to where force has come as high as it does among them.

    Where the clock of force runs ahead of the axis', force stands still while the tip still seems to move.
    """
    force_N = _despiked(cycle.force_N[steady]) if len(steady) >= LEAST_SAMPLES else cycle.force_N[steady]
    top_N = float(force_N.max())
    top = int(np.argmax(force_N >= top_N - max(4 * noise_N, TOP_SHARE * top_N)))
    if top + 1 < LEAST_SAMPLES:
        raise DataError(
            f"{cycle.name}: no loading: {top + 1} samples at steady speed with rising force "
            f"(at least {LEAST_SAMPLES} are needed); record faster, go slower or deeper"
        )
    return steady[: top + 1]
