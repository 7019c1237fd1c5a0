"""From a cycle to a loading curve: force zeroed in the air, depth from contact, only while the tip moves steadily."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.trials.contact import Contact, FloatArray
from rig.trials.cycles import LEAST_TRAVEL_MM, IndentationCycle, pushed
from rig.trials.findings import Finding
from rig.trials.stated import SPEED_SHARE, middle_speed
from rig.trials.streams import LEAST_SAMPLES, despiked, in_order
from rig.trials.surface import WIDEST_SHARE, Rise, descent, find_surface

# So that a fit may move contact by its interval and still see the air above it.
AIR_KEPT_MM = 0.5
STEADY_SHARE = 0.3  # the nearest of the study's speeds, 15 and 20 mm/s, lie a third apart
# Half of the way that the wanted speed makes: nearer to going on than to standing.
ON_SHARE = 0.5
TOP_SHARE = 0.005  # where the data have no noise, what is so near to the top is the top
# Less than half of the way is no stroke with a run-in and a run-out, but a motion that steps or swings.
STEADY_WAY = 0.5
SPEED_BASE_MM = 0.5  # places written in hundredths of a millimetre give a speed within 3 %


@dataclass(frozen=True)
class Curve:
    """Loading at steady speed, from just before contact to the deepest point; arrays have shape (n,).

    ``depth_mm`` counts from ``contact.position_mm``; ``zero_N`` was taken off; ``noise_N`` is the standard deviation
    in the air. ``speed_mm_s`` is the speed asked for, or the speed found where nobody said. ``recording`` is that
    of which the curve is one cycle of several. ``findings`` say what was left out, and what contact rests on.
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
    recording: str = ""
    findings: tuple[Finding, ...] = ()

    @property
    def trial(self) -> str:
        """What repeats: the cycles of a recording are one."""
        return self.recording or self.name

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
    """The loading curve of a cycle that touches, or begins in contact, and goes deeper, at steady speed where it can.

    The last rise of force from the air to its peak counts, so an earlier touch (the search for contact) does not.
    Raises DataError where there is no contact, none that is known, or no loading after it.
    """
    if len(cycle.force_N) < LEAST_SAMPLES:
        raise DataError(f"{cycle.name}: {len(cycle.force_N)} samples; a curve needs at least {LEAST_SAMPLES}")
    cycle, pulled = pushed(cycle)
    zeroed, rise, contact, noise_N, findings = find_surface(cycle)
    wanted_mm_s = _wanted_speed(zeroed, rise)
    kept, unsteady = _loading(zeroed, rise, wanted_mm_s, noise_N)
    _refuse_unknown(cycle.name, contact, float(zeroed.position_mm[rise.peak]))
    if kept[0] == rise.touch:
        air = np.arange(descent(zeroed, rise.touch, contact.position_mm - AIR_KEPT_MM), rise.touch)
        kept = np.concatenate([air, kept])
    return Curve(
        name=cycle.name, speed_mm_s=wanted_mm_s if wanted_mm_s == cycle.speed_mm_s else float(f"{wanted_mm_s:.2g}"),
        depth_mm=zeroed.position_mm[kept] - contact.position_mm, force_N=zeroed.force_N[kept],
        rate_mm_s=_rate(zeroed.time_s[kept], zeroed.position_mm[kept], wanted_mm_s), contact=contact,
        zero_N=float(cycle.force_N[-1] - zeroed.force_N[-1]), noise_N=noise_N, time_s=zeroed.time_s[kept],
        findings=(*pulled, *findings, *unsteady),
    )  # fmt: skip


def _refuse_unknown(name: str, contact: Contact, peak_mm: float) -> None:
    width_mm, stroke_mm = contact.high_mm - contact.low_mm, peak_mm - contact.low_mm
    if width_mm > WIDEST_SHARE * stroke_mm:
        raise DataError(
            f"{name}: its surface lies between {contact.low_mm:.4g} and {contact.high_mm:.4g} mm, {width_mm:.2g} mm of "
            f"a stroke of {stroke_mm:.3g} mm (at most a quarter is allowed); record faster, or go slower or deeper"
        )


def _wanted_speed(cycle: IndentationCycle, rise: Rise) -> float:
    """The speed asked for; where nobody said, or another, the middle one by travel, so that holds do not count."""
    loading = slice(rise.touch, rise.peak + 1)
    reached_mm = np.maximum.accumulate(cycle.position_mm[loading])
    if reached_mm[-1] - reached_mm[0] < LEAST_TRAVEL_MM:
        raise DataError(
            f"{cycle.name}: no loading: force rises while the tip does not go deeper; check axis and clocks"
        )
    own_mm_s = middle_speed(cycle.time_s[loading], cycle.position_mm[loading])
    return cycle.speed_mm_s if abs(cycle.speed_mm_s - own_mm_s) <= SPEED_SHARE * own_mm_s else own_mm_s


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


def _loading(
    cycle: IndentationCycle, rise: Rise, wanted_mm_s: float, noise_N: float
) -> tuple[NDArray[np.intp], tuple[Finding, ...]]:
    """Samples of steady loading; where those are little of the way, all at which the tip is deeper than before."""
    position_mm = cycle.position_mm
    steady = _steady(cycle, rise, wanted_mm_s)
    way_mm = position_mm[rise.peak] - position_mm[rise.touch]
    if len(steady) > LEAST_SAMPLES and position_mm[steady[-1]] - position_mm[rise.touch] >= STEADY_WAY * way_mm:
        return _rising(cycle, steady, noise_N), ()
    span = position_mm[rise.touch : rise.peak + 1]
    deeper = in_order(span)
    rate_mm_s = np.diff(span[deeper]) / np.diff(cycle.time_s[rise.touch : rise.peak + 1][deeper])
    text = (
        f"the tip loads unsteadily, at {rate_mm_s.min():.2g} to {rate_mm_s.max():.2g} mm/s: all of its way in is used"
    )
    return _rising(cycle, rise.touch + np.flatnonzero(deeper), noise_N), (
        Finding(cycle.name, "axis", "unsteady", text),
    )


def _steady(cycle: IndentationCycle, rise: Rise, wanted_mm_s: float) -> NDArray[np.intp]:
    """Samples between contact and peak that move at the wanted speed, up to where the tip stops.

    Samples of another speed are left out; what follows them counts while the tip has gone on meanwhile (a stumble of
    the clock), and no longer where it has not (a hold).
    """
    span = slice(rise.touch, rise.peak + 1)
    time_s, position_mm = cycle.time_s[span], cycle.position_mm[span]
    rate_mm_s = _rate(cycle.time_s, cycle.position_mm, wanted_mm_s)[span]
    steady = np.flatnonzero(np.abs(rate_mm_s - wanted_mm_s) <= STEADY_SHARE * wanted_mm_s)
    went_on = np.diff(position_mm[steady]) >= ON_SHARE * wanted_mm_s * np.diff(time_s[steady])
    stumbled = np.diff(steady) > 1
    stops = np.flatnonzero(stumbled & ~went_on)
    steady = steady[: stops[0] + 1] if len(stops) else steady
    return rise.touch + steady


def _rising(cycle: IndentationCycle, steady: NDArray[np.intp], noise_N: float) -> NDArray[np.intp]:
    """The samples up to where force has come as high as it does among them.

    Where the clock of force runs ahead of the axis', force stands still while the tip still seems to move.
    """
    force_N = despiked(cycle.force_N[steady]) if len(steady) >= LEAST_SAMPLES else cycle.force_N[steady]
    top_N = float(force_N.max())
    top = int(np.argmax(force_N >= top_N - max(4 * noise_N, TOP_SHARE * top_N)))
    if top + 1 < LEAST_SAMPLES:
        raise DataError(
            f"{cycle.name}: no loading: {top + 1} samples at steady speed with rising force "
            f"(at least {LEAST_SAMPLES} are needed); record faster, go slower or deeper"
        )
    return steady[: top + 1]
