"""Where a recording's force is zero and where its tip touches: from the air before, the air after, or without any.

A recording that begins in contact (at a preload, clamped, glued) has no onset of force. Its surface lies before its
start, as far as the force there and how it grows on allow: ``contact_before``.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rig.errors import DataError
from rig.trials.contact import Contact, FloatArray, Misfits, find_contact
from rig.trials.cycles import IndentationCycle, way_back
from rig.trials.findings import Finding
from rig.trials.preload import contact_before
from rig.trials.streams import LEAST_SAMPLES, despiked, sample_noise

# The fewest that have a median and a spread about it.
LEAST_AIR_SAMPLES = 3
# Contact is known to 0.2 mm in a good trial (`contact_within_mm`); air begins half as much again above it.
AIR_MARGIN_MM = 0.3
# Five standard deviations of a sensor with 10 mN of noise.
LEAST_FORCE_N = 0.05
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
# A median over twenty samples is known to three tenths of their standard deviation.
FRICTION_SAMPLES = 20
# A step of two standard deviations of single samples is five of the difference of two medians over twenty.
FRICTION_SPREADS = 2.0
FRICTION_FLAT = 0.25  # two medians over ten differ by chance by as much of such a step
# Drift and drag of cables in the air are below a hundredth of a stroke's force; a tenth of the way into tissue is not.
LOADED_SHARE = 0.01
# A level that holds while the tip goes on by a twentieth of its way is no tissue letting go.
LIFTED_SHARE = 0.05
# An interval of contact wider than this share of the stroke leaves the shape of the curve to the guess.
WIDEST_SHARE = 0.25
# A tip that has gone on by six deviations of its position, and by a ten-thousandth of its way, has left its start.
LEFT_SHARE = 1e-4


class Rise(NamedTuple):
    """Samples of the cycle at which force leaves the air for good, or the tip its start, and at which force peaks."""

    touch: int
    peak: int


class FoundSurface(NamedTuple):
    """The cycle less its zero, the rise in it, contact, the noise of a sample, and what is to be said of them."""

    cycle: IndentationCycle
    rise: Rise
    contact: Contact
    noise_N: float
    findings: tuple[Finding, ...] = ()


class _NoAirError(DataError):
    """Nothing of the recording before its rise is air."""


def find_surface(cycle: IndentationCycle) -> FoundSurface:
    """Zero and contact of a cycle; raises DataError where there is no contact, or none that can be told."""
    try:
        run_in, rise = _run_in(cycle, _rise(cycle))
        return _zeroed(run_in, rise)
    except _NoAirError:
        return _from_contact(cycle)


def _rise(cycle: IndentationCycle) -> Rise:
    """The last rise from the air to the peak of force; the air is where the tip was highest before the peak."""
    force_N, peak = despiked(cycle.force_N), _peak(cycle)
    before_mm, before_N = cycle.position_mm[: peak + 1], force_N[: peak + 1]
    travel_mm = float(np.ptp(before_mm))
    high_N = before_N[before_mm <= before_mm.min() + HIGHEST_SHARE * travel_mm]
    zero_N, spread_N = _middle(high_N)
    height_N = float(force_N[peak]) - zero_N
    if _loaded(before_mm, before_N):
        raise _NoAirError(f"{cycle.name}: no air part: force rises from where the tip starts")
    fall_N = zero_N - float(force_N.min())
    # Adhesion pulls less than what pressed the tip in: force that falls further than it rises has the wrong sign.
    if height_N < max(10 * spread_N, LEAST_FORCE_N, fall_N / 2):
        raise DataError(_no_contact(cycle, height_N, spread_N, fall_N))
    air = np.flatnonzero(before_N < zero_N + max(6 * spread_N, ONSET_SHARE * height_N))
    if not len(air) or air[-1] + 1 < LEAST_AIR_SAMPLES:
        raise _NoAirError(f"{cycle.name}: no air part: force rises from the first sample")
    return Rise(int(air[-1]) + 1, peak)


def _peak(cycle: IndentationCycle) -> int:
    """The sample of the largest force; the deepest before it, where a full sensor has that on the way out."""
    peak = int(np.argmax(despiked(cycle.force_N)))
    deepest = int(np.argmax(cycle.position_mm[: peak + 1]))
    return deepest if cycle.position_mm[deepest] - cycle.position_mm[peak] > TURN_MM else peak


def _loaded(position_mm: FloatArray, force_N: FloatArray) -> bool:
    """Whether force grows all the way from where the tip is highest: no air, and no noise either."""
    gone_mm = position_mm - position_mm.min()
    high = (gone_mm > _left_mm(position_mm)) & (gone_mm <= HIGHEST_SHARE * gone_mm.max())
    thirds = np.array_split(force_N[high][np.argsort(position_mm[high], kind="stable")], 3)
    if len(thirds[0]) < 2:
        return False
    first_N, middle_N, last_N = (float(np.median(third)) for third in thirds)
    least_N = max(OUTLIER_SPREADS * sample_noise(force_N), LOADED_SHARE * (float(force_N.max()) - first_N))
    # From the middle of the first third to that of the last is two thirds of the way; a guide's friction levels off.
    grows = last_N - middle_N > 0.5 * (middle_N - first_N) > 0
    return bool(grows and 1.5 * (last_N - first_N) > least_N)


def _left_mm(position_mm: FloatArray) -> float:
    """How far from its start a tip at rest may seem to be."""
    return max(OUTLIER_SPREADS * sample_noise(position_mm), LEFT_SHARE * float(np.ptp(position_mm)))


def _from_contact(cycle: IndentationCycle) -> FoundSurface:
    """Surface of a cycle without air before its loading; zero is the air's after it, else the recording's own."""
    rise = _rise_from_contact(cycle)
    start_N, deviation_N, noise_N = _at_start(cycle, rise)
    lifted = _lifted_N(cycle, rise, noise_N)
    zero_N = min(0.0, start_N) if lifted is None else lifted
    # A recording's own zero that is off by what begins below it may be off by as much where nothing shows it.
    deviation_N += max(-start_N, 0.0) / 2 if lifted is None else 0.0
    zeroed = replace(cycle, force_N=cycle.force_N - zero_N)
    span = slice(rise.touch - 1, rise.peak + 1)
    position_mm, force_N = zeroed.position_mm[span], despiked(zeroed.force_N[span])
    contact = contact_before(position_mm, force_N, (start_N - zero_N, deviation_N), noise_N)
    _refuse_wide(cycle.name, position_mm, contact, f"at {start_N:.2g} N where zero is {zero_N:.2g} N")
    return FoundSurface(zeroed, rise, contact, noise_N, (_said(cycle.name, position_mm[0], contact, lifted is None),))


def _refuse_wide(name: str, position_mm: FloatArray, contact: Contact, pressed: str) -> None:
    stroke_mm, width_mm = float(np.ptp(position_mm)), contact.high_mm - contact.low_mm
    if width_mm >= stroke_mm:
        raise DataError(
            f"{name}: started in contact, {pressed}: force grows too little more to tell where its surface lies; "
            "start higher, or go deeper"
        )
    if width_mm > WIDEST_SHARE * stroke_mm:
        raise DataError(
            f"{name}: started in contact, {pressed}: its surface lies between {position_mm[0] - contact.low_mm:.2g} mm "
            f"above its start and {contact.high_mm - position_mm[0]:.2g} mm below, {width_mm:.2g} mm of a stroke of "
            f"{stroke_mm:.3g} mm (at most a quarter is allowed); start higher, or go deeper"
        )


def _rise_from_contact(cycle: IndentationCycle) -> Rise:
    """From where the tip leaves its highest place to the peak of force."""
    peak = _peak(cycle)
    before_mm = cycle.position_mm[: peak + 1]
    touch = int(np.flatnonzero(before_mm - before_mm.min() <= _left_mm(before_mm))[-1]) + 1
    if peak - touch < LEAST_SAMPLES:
        raise DataError(
            f"{cycle.name}: started in contact, and no loading: {max(peak - touch, 0)} samples from where the tip "
            f"starts to the peak of force (at least {LEAST_SAMPLES} are needed); record from before the loading"
        )
    return Rise(touch, peak)


def _at_start(cycle: IndentationCycle, rise: Rise) -> tuple[float, float, float]:
    """Force at rest where the loading starts, its standard deviation, and that of one sample."""
    noise_N = max(sample_noise(cycle.force_N), 1e-4 * float(np.ptp(cycle.force_N)))
    before_mm = cycle.position_mm[: rise.touch]
    off = np.flatnonzero(np.abs(before_mm - before_mm[-1]) > 2 * _left_mm(cycle.position_mm[: rise.peak + 1]))
    rest_N = cycle.force_N[(int(off[-1]) + 1 if len(off) else 0) : rise.touch]
    return float(np.median(rest_N)), noise_N / float(np.sqrt(len(rest_N))), noise_N


def _lifted_N(cycle: IndentationCycle, rise: Rise, noise_N: float) -> float | None:
    """The level that force keeps at the end while the tip goes back: air after the loading; None without."""
    after_N, after_mm = despiked(cycle.force_N[rise.peak :]), cycle.position_mm[rise.peak :]
    level_N = float(np.median(after_N[-LEAST_SAMPLES:]))
    away = np.flatnonzero(np.abs(after_N - level_N) > OUTLIER_SPREADS * noise_N)
    first = int(away[-1]) + 1 if len(away) else 0
    back_mm = float(after_mm[min(first, len(after_mm) - 1)] - after_mm[-1])
    stroke_mm = float(after_mm[0] - cycle.position_mm[rise.touch - 1])
    # The nearer half may still hold the last of the tissue's force.
    clear_N = after_N[first:][after_mm[first:] < after_mm[-1] + back_mm / 2]
    enough = back_mm > LIFTED_SHARE * stroke_mm and len(clear_N) >= LEAST_AIR_SAMPLES
    return float(np.mean(clear_N)) if enough else None


def _said(name: str, start_mm: float, contact: Contact, own_zero: bool) -> Finding:
    zero = "the recording's own zero" if own_zero else "the air after the loading"
    text = (
        f"started in contact: the surface lies between {start_mm - contact.low_mm:.2g} mm above its start and "
        f"{contact.high_mm - start_mm:.2g} mm below; force counts from {zero}"
    )
    return Finding(name, "force", "contact", text)


def _run_in(cycle: IndentationCycle, rise: Rise) -> tuple[IndentationCycle, Rise]:
    """The cycle from where the tip runs in, if the guide has friction: force in the air then steps with motion.

    At rest or on the way up friction is another than on the way down, so the zero of loading is the run-in's own.
    """
    turn = descent(cycle, rise.touch, -np.inf)
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


def _no_contact(cycle: IndentationCycle, height_N: float, spread_N: float, fall_N: float) -> str:
    if fall_N > max(10 * spread_N, LEAST_FORCE_N, height_N):
        if cycle.position_mm[np.argmin(despiked(cycle.force_N))] < cycle.position_mm[0]:
            return f"{cycle.name}: started in contact, and force only falls as the tip goes out; record the loading"
        return (
            f"{cycle.name}: force falls by {fall_N:.2g} N where the tip goes in: the sign of compression is wrong; "
            "correct force.compression in rig.toml, or `positive` of the force in the mapping"
        )
    least_N = max(10 * spread_N, LEAST_FORCE_N)
    why = "to tell it from noise" if least_N > LEAST_FORCE_N else "of tissue under a tip of millimetres"
    return (
        f"{cycle.name}: no contact: force rises by {max(height_N, 0):.2g} N at most "
        f"(at least {least_N:.2g} N is needed {why}); go deeper"
    )


def _zeroed(cycle: IndentationCycle, rise: Rise) -> FoundSurface:
    """The cycle less its zero, its contact, and the noise in the air; twice, since what is air depends on contact.

    Where contact may lie so high that too few samples are above it for certain, those above the likeliest count.
    """
    known: dict[tuple[int, int], Misfits] = {}
    first = _zeroed_above(cycle, rise, float(cycle.position_mm[rise.touch]), known)
    try:
        return _zeroed_above(cycle, rise, first.contact.lower_mm, known)
    except _NoAirError:
        return first


def _zeroed_above(
    cycle: IndentationCycle, rise: Rise, surface_mm: float, known: dict[tuple[int, int], Misfits]
) -> FoundSurface:
    """As ``_zeroed``: zero is the mean of what comes before the rise, clear of the surface, without wrong samples."""
    air_N = cycle.force_N[: rise.touch][cycle.position_mm[: rise.touch] < surface_mm - AIR_MARGIN_MM]
    if len(air_N) < LEAST_AIR_SAMPLES:
        raise _NoAirError(f"{cycle.name}: no air part: {len(air_N)} samples are clearly above the surface")
    middle_N, spread_N = _middle(air_N)
    usual_N = air_N[np.abs(air_N - middle_N) <= OUTLIER_SPREADS * spread_N] if spread_N else air_N
    zeroed, noise_N = replace(cycle, force_N=cycle.force_N - float(np.mean(usual_N))), float(np.std(usual_N))
    return FoundSurface(zeroed, rise, _contact(zeroed, rise, noise_N, known), noise_N)


def _middle(values: FloatArray) -> tuple[float, float]:
    """Median, and the standard deviation that the median absolute deviation stands for in normal noise."""
    middle = float(np.median(values))
    return middle, 1.4826 * float(np.median(np.abs(values - middle)))


def _contact(cycle: IndentationCycle, rise: Rise, noise_N: float, known: dict[tuple[int, int], Misfits]) -> Contact:
    """Contact searched from well above the first clear rise of force to the first sample in it."""
    position_mm, force_N = cycle.position_mm, cycle.force_N
    touch_mm, peak_mm = float(position_mm[rise.touch]), float(position_mm[rise.peak])
    above_mm = max(SEARCH_SHARE * (peak_mm - touch_mm), LEAST_SEARCH_MM)
    start = descent(cycle, rise.touch, touch_mm - above_mm)
    deep = np.flatnonzero(force_N[rise.touch : rise.peak] > SHALLOW_SHARE * force_N[rise.peak])
    stop = rise.touch + max(int(deep[0]) if len(deep) else 0, LEAST_SAMPLES)
    stop = min(stop, rise.peak + 1)
    search_mm = (max(float(position_mm[start]), touch_mm - above_mm), touch_mm)
    least_N = max(noise_N, 1e-4 * float(force_N[rise.peak]))
    return find_contact(position_mm[start:stop], force_N[start:stop], search_mm, least_N, known)


def descent(cycle: IndentationCycle, touch: int, from_mm: float) -> int:
    """Where the way down to ``touch`` passes ``from_mm``, or where it begins if that is deeper."""
    way_mm = way_back(cycle.position_mm[: touch + 1], TURN_MM)
    passed = np.flatnonzero(way_mm <= from_mm)
    return touch - int(passed[0] if len(passed) else np.argmin(way_mm))
