"""The diagnosis' view of a session: every recording on one grid, force and motion averaged over the same short windows.

The force's own time stamps set the grid: the motion is interpolated there by a cubic spline. Where the force is sampled
faster than the working rate, force and motion are averaged over the same samples, so that thinning the data low-passes
both sides alike and cannot be mistaken for a lag of one of them.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import compress, repeat

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from rig.errors import DataError
from rig.recording.converter import at_the_end_of_range, resolution
from rig.simulation.drive import Array, MeasuredMotion
from rig.trials.cycles import as_pushed, cycle_of
from rig.trials.findings import Finding, merge
from rig.trials.streams import sample_noise
from rig.trials.surface import find_surface
from rig.trials.trial import FEWEST_SAMPLES, Trial, TrialSet, drop_disordered, drop_unusable, inspect

WORKING_RATE_HZ = 250.0
LOWEST_RATE_HZ, SHOWS_FAST_HZ = 100.0, 99.0  # below it, less what a clock is off by, nothing fast can be tested
SLOWEST_GRID_HZ = 20.0  # of sessions that show nothing fast: ten readings of half a second of contact
MOST_SAMPLES = 60_000  # four minutes at 250 Hz, the length of `examples/diagnosis.toml`
DERIVATIVE_SPANS_S = (0.008, 0.016)
JITTER_MM = 0.0004  # rounding to the encoder's 0.5 um makes 0.14 um: three times that comes from time stamps
JITTERY = 125.0, (0.024, 0.024)
# A device of 100 Hz that lost one sample has two periods; a gap within the derivatives' spans is bridged by them.
GAP_PERIODS, GAP_S = 3.0, 0.01
MOST_FILLED_S = 5.0  # of lost force; a longer break would be filled for nothing but its two ends
# Over 24 ms a dither of 0.25 mm at 6 Hz turns by 8.5 mm/s, which is to be seen, a corner of 2000 mm/s2 by 30.
MOST_TURN_MM_S = 12.0
# A rise of force below so many times the noise is no contact, and one below this share of the others' tells nothing.
NOTICEABLE, SLIGHT = 5.0, 0.05
DEEPEST = 0.02  # of the travel: a tip that comes from far away is in contact for a little of it
RESTING = 0.5  # of a step: noise below it leaves readings on one step
# Noise of Gauss goes as far once in 10^15 readings; a cable that is moved gives 0.2 % such, strokes of 50 readings 2 %.
FAR, MOST_FAR = 8.0, 0.005
FAR_OUT = "{} readings lie far from both their neighbours, which no motion does; they are not judged"
OMITTED = "recording left out: "
Span = tuple[float, float]


@dataclass(frozen=True)
class Observations:
    """Drive and readings on the working grid: force shape (n,), tip at the tracker's frames shape (m,).

    ``unseen``, shape (n,), marks what nobody knows: motion in gaps of the axis' clock, force lost or beyond the
    sensor's range.
    ``contact_mm`` is from where to where contact lies in some of the recordings, None where none of them tells. Times
    between recordings mean something where they have ``one_clock``. ``labels`` are those that differ, each with what it
    is for each recording, nothing where nobody said. Readings of force rest on steps of ``step_N``, if not 0.
    """

    name: str
    names: tuple[str, ...]
    drive: MeasuredMotion
    force_N: Array
    tip_mm: Array
    surface_mm: float | None
    findings: tuple[Finding, ...] = field(default=())
    jitter_mm: float = 0.0
    unseen: NDArray[np.bool_] | None = None
    contact_mm: Span | None = None
    one_clock: bool = True
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    step_N: float = 0.0

    @property
    def rate_Hz(self) -> float:
        """Samples per second of the working grid."""
        return 1 / self.drive.period_s

    @property
    def has_tracker(self) -> bool:
        """Whether an independent tip position was recorded."""
        return self.tip_mm.size > FEWEST_SAMPLES


@dataclass(frozen=True)
class _Gridded:
    name: str
    time_s: Array
    columns: tuple[Array, Array, Array, Array]  # force, position, velocity, acceleration
    temperature_C: Array | None
    marker_s: Array
    marker_mm: Array
    unseen: NDArray[np.bool_]
    far_out: int  # readings


def contact_span(usable: Sequence[Trial]) -> Span | None:
    """From the first to the last place [mm] at which contact may lie in a recording that tells it."""
    found = []
    for trial in usable:
        with suppress(DataError):
            found.append(find_surface(cycle_of(trial)).contact)
    return (min(c.low_mm for c in found), max(c.high_mm for c in found)) if found else None


def observe(
    session: TrialSet,
    contact_of: Callable[[Sequence[Trial]], Span | None] = contact_span,
    fastest_Hz: float = WORKING_RATE_HZ,
) -> Observations:
    """The session on its working grid; raises DataError where no recording can be used at all.

    ``contact_of`` says where contact lies in the recordings that are used; the grid has at most ``fastest_Hz``.
    """
    findings = [*session.findings, *(finding for trial in session.trials for finding in inspect(trial))]
    usable, lost = sound_trials(session)
    if not usable:
        said = [finding.text.removeprefix(OMITTED) for finding in (*lost, *session.findings)]
        why = said[0] if said else "there is none"
        raise DataError(f"{session.name}: no recording can be used ({why}); run `rig verify` on it")
    findings += lost
    rough_mm = float(np.median([jitter_mm(trial) for trial in usable]))
    rate_Hz, spans_s = (WORKING_RATE_HZ, DERIVATIVE_SPANS_S) if rough_mm <= JITTER_MM else JITTERY
    period_s = working_period(usable, min(rate_Hz, fastest_Hz))
    parts = [_on_grid(trial, period_s, spans_s) for trial in usable]
    parts.sort(key=lambda part: float(part.time_s[0]))
    findings += [Finding(part.name, "force", "far out", FAR_OUT.format(part.far_out)) for part in parts if part.far_out]
    drive, force, tip = _joined(parts)
    return Observations(
        session.name, tuple(part.name for part in parts), drive, force, tip, session.surface_mm, merge(findings),
        rough_mm, np.concatenate([part.unseen for part in parts]), contact_of(usable), session.one_clock,
        _labels(usable, parts), float(np.quantile(list(map(_step_N, usable)), 0.5, method="lower")),
    )  # fmt: skip


def _labels(usable: Sequence[Trial], parts: Sequence[_Gridded]) -> dict[str, tuple[str, ...]]:
    of = {trial.name: trial.labels for trial in usable}
    names = dict.fromkeys(name for trial in usable for name in trial.labels)
    found = {name: tuple(of[part.name].get(name, "") for part in parts) for name in names}
    return {name: told for name, told in found.items() if len(set(told)) > 1}


def jitter_mm(trial: Trial) -> float:
    """How far positions typically lie off a smooth motion through their stamps, as a standard deviation.

    By third divided differences: a device that is read at uneven times, each stamped as it was, is no rough one.
    """
    four_s = np.stack([trial.axis_s[k : len(trial.axis_s) - 3 + k] for k in range(4)])
    apart_s = four_s[:, None] - four_s[None] + np.eye(4)[:, :, None]
    weights = 1 / apart_s.prod(axis=1)
    places = np.stack([trial.axis_mm[k : len(trial.axis_mm) - 3 + k] for k in range(4)])
    rough = (weights * places).sum(axis=0) / np.linalg.norm(weights, axis=0)
    moving = np.abs(np.diff(trial.axis_mm))[1:-1] > 0
    # Nine in ten lie within 1.645 standard deviations; the rest are corners of the motion.
    return float(np.quantile(np.abs(rough[moving]), 0.9)) / 1.645 if moving.any() else 0.0


def working_period(recordings: Sequence[Trial], rate_Hz: float = WORKING_RATE_HZ) -> float:
    """Grid period [s]: a whole number of force periods, near ``rate_Hz``, coarser only for very long sessions."""
    native_s = float(np.median([np.median(np.diff(trial.force_s)) for trial in recordings]))
    total_s = float(sum(trial.force_s[-1] - trial.force_s[0] for trial in recordings))
    slowest_Hz = LOWEST_RATE_HZ if native_s * SHOWS_FAST_HZ <= 1 else SLOWEST_GRID_HZ
    wanted_Hz = float(np.clip(MOST_SAMPLES / max(total_s, 1e-9), slowest_Hz, rate_Hz))
    return native_s * max(1, round(1 / wanted_Hz / native_s))


def sound_trials(session: TrialSet) -> tuple[list[Trial], list[Finding]]:
    """The recordings that can be judged, pulled ones as if pushed, and why others cannot."""
    usable, lost = _cleaned(session)
    usable, copies = _without_copies(usable)
    turned = [as_pushed(trial) for trial in usable]
    usable, astray = _pressing([trial for trial, _ in turned])
    return usable, [*lost, *copies, *(finding for _, found in turned for finding in found), *astray]


def _cleaned(session: TrialSet) -> tuple[list[Trial], list[Finding]]:
    usable, lost = [], []
    for trial in session.trials:
        try:
            usable.append(drop_unusable(trial))
        except DataError as error:
            lost.append(Finding(trial.name, "recording", "unusable", f"{OMITTED}{error}"))
    return usable, lost


def _without_copies(usable: Sequence[Trial]) -> tuple[list[Trial], list[Finding]]:
    """Each recording once: a copy would be left out and predicted from itself."""
    first: dict[bytes, Trial] = {}
    copies = []
    for trial in usable:
        of = first.setdefault(trial.force_N.tobytes(), trial)
        if of is not trial and np.ptp(trial.force_N) > 0:
            text = f"{OMITTED}it holds the same forces as {of.name}"
            copies.append(Finding(trial.name, "recording", "copy", text))
    gone = {copy.recording for copy in copies}
    return [trial for trial in usable if trial.name not in gone], copies


def _pressing(usable: Sequence[Trial]) -> tuple[list[Trial], list[Finding]]:
    """Without recordings whose force does not rise as the tip goes as far in as in others, where it does in those.

    Where it meets nothing contact lies nowhere; where force falls, in few, its sign is wrong.
    """
    if not usable:
        return [], []
    rises = np.array([_rise_of(trial) for trial in usable])
    least = np.array([NOTICEABLE * max(sample_noise(t.force_N), rounding_N(_step_N(t))) for t in usable])
    changes, ways = np.abs(rises), np.array([np.ptp(trial.axis_mm) for trial in usable])
    slight = (changes <= least) & (changes < SLIGHT * changes.max())
    idle = slight & (ways > 0.5 * np.median(ways)) & (changes > least).any()
    usable, flat = _without(usable, idle, "no contact", "its force does not rise as the tip goes in")
    rises, least = rises[~idle], least[~idle]
    falls = rises < -np.maximum(0.5 * float(np.median(np.abs(rises))), least)
    falls &= np.count_nonzero(falls) < 0.5 * len(usable)
    turned = "its force falls as the tip goes in, and rises in the others: turn its sign"
    usable, lost = _without(usable, falls, "sign", turned)
    return usable, flat + lost


def _without(
    usable: Sequence[Trial], gone: NDArray[np.bool_], kind: str, why: str
) -> tuple[list[Trial], list[Finding]]:
    lost = [Finding(trial.name, "recording", kind, OMITTED + why) for trial in compress(usable, gone)]
    return list(compress(usable, ~gone)), lost


def far_readings(force_N: Array) -> NDArray[np.bool_]:
    """Single readings far out, shape (n,): second differences of 1, -2, 1 times a step far beyond the noise.

    A contact or a turn is a kink, of one difference or of two with the same sign. Where many seem far out none is: so
    few readings were taken that the motion itself looks like this.
    """
    bend, far = np.diff(force_N, 2), np.zeros(len(force_N), bool)
    if len(bend) < FEWEST_SAMPLES:
        return far
    middle, sides, usual_N = bend[1:-1], np.stack([bend[:-2], bend[2:]]), 1.4826 * float(np.median(np.abs(bend)))
    alone = ((sides * middle < 0) & (np.abs(sides) > 0.25 * np.abs(middle))).all(axis=0)
    far[2:-2] = alone & (np.abs(middle) > FAR * usual_N) & (usual_N > 0)
    return np.asarray(far & (far.mean() <= MOST_FAR))


def rise_N(place_mm: Array, force_N: Array) -> float:
    """Force at the deepest tenth of the motion, less that at the highest; both of shape (n,)."""
    deep, high = (place_mm >= np.quantile(place_mm, 0.9)), (place_mm <= np.quantile(place_mm, 0.1))
    return float(np.median(force_N[deep]) - np.median(force_N[high]))


def _rise_of(trial: Trial) -> float:
    place_mm = np.interp(trial.force_s, trial.axis_s, trial.axis_mm)
    top_mm, way_mm = float(place_mm.min()), float(np.ptp(place_mm))
    deep, high = place_mm >= top_mm + (1 - DEEPEST) * way_mm, place_mm <= top_mm + 0.1 * way_mm
    return float(np.median(trial.force_N[deep]) - np.median(trial.force_N[high]))


def rounding_N(step_N: float) -> float:
    """Standard deviation of an error that may be anything up to half a step of the converter, either way [N]."""
    return step_N / math.sqrt(12)


def _step_N(trial: Trial) -> float:
    """The converter's step where readings rest on one, 0 where noise moves them between steps."""
    step_N = resolution(trial.force_N)
    return step_N if sample_noise(trial.force_N) < RESTING * step_N else 0.0


def _on_grid(trial: Trial, period_s: float, spans_s: Sequence[float]) -> _Gridded:
    """Force and motion at the force's stamps, then the same samples of all of them averaged window by window."""
    native_s = float(np.median(np.diff(trial.force_s)))
    columns = [
        trial.force_s, trial.force_N, *_motion(trial, trial.force_s, spans_s),
        *([trial.temperature_C] if trial.temperature_C is not None else []),
    ]  # fmt: skip
    window = np.floor((trial.force_s - trial.force_s[0]) / period_s + 0.5 * native_s / period_s).astype(np.int64)
    count = np.bincount(window)
    full = count >= max(1, round(0.5 * period_s / native_s))
    means = [np.bincount(window, column)[full] / count[full] for column in columns]
    time_s = means[0]
    marker_s, marker_mm = np.empty(0), np.empty((0, 3))
    if trial.marker_s is not None and trial.marker_mm is not None:
        marker_s, *xyz = drop_disordered(trial.marker_s, *trial.marker_mm.T)
        inside = (marker_s >= time_s[0]) & (marker_s <= time_s[-1])
        marker_s, marker_mm = marker_s[inside], np.array(xyz).T[inside]
    unseen = beside_gaps(trial.axis_s, time_s, 0.5 * max(spans_s))
    unseen |= np.bincount(window, at_the_end_of_range(trial.force_N, columns[2]))[full] > 0
    far = far_readings(trial.force_N)
    unseen |= np.bincount(window, far)[full] > 0
    if spans_s[0] > DERIVATIVE_SPANS_S[0]:
        # Derivatives over long spans round off what turns within one.
        unseen |= np.abs(means[4]) * spans_s[0] > MOST_TURN_MM_S
    # A row at every time whose force was lost: a delay of so many rows is one of so much time then.
    lost_s = lost_times(time_s, period_s)
    at = np.searchsorted(time_s, lost_s)
    lost = [lost_s, np.interp(lost_s, time_s, means[1]), *_motion(trial, lost_s, spans_s)]
    lost += [np.interp(lost_s, time_s, kelvin) for kelvin in means[5:]]
    time_s, force, position, velocity, acceleration, *kelvin = map(np.insert, means, repeat(at), lost)
    motion = force, position, velocity, acceleration
    unseen = np.insert(unseen, at, True)
    kelvin_of = kelvin[0] if kelvin else None
    return _Gridded(trial.name, time_s, motion, kelvin_of, marker_s, marker_mm, unseen, int(far.sum()))


def lost_times(time_s: Array, period_s: float) -> Array:
    """Evenly between the times of each break, those that an even grid has there, shape (lost,)."""
    steps_s = np.diff(time_s)
    counts = np.where(steps_s < MOST_FILLED_S, np.round(steps_s / period_s).astype(np.int64) - 1, 0)
    breaks = np.flatnonzero(counts > 0)
    inner = (np.linspace(time_s[k], time_s[k + 1], counts[k] + 2)[1:-1] for k in breaks)
    return np.concatenate([np.empty(0), *inner])


def beside_gaps(axis_s: Array, at_s: Array, margin_s: float) -> NDArray[np.bool_]:
    """Which times lie in a gap of the axis' clock, or so near to one that derivatives there reach across it."""
    step_s = np.diff(axis_s)
    gaps = np.flatnonzero(step_s > max(GAP_PERIODS * float(np.median(step_s)), GAP_S))
    begun = np.searchsorted(axis_s[gaps] - margin_s, at_s, side="right")
    return np.asarray(begun > np.searchsorted(axis_s[gaps + 1] + margin_s, at_s, side="right"))


def _motion(trial: Trial, at_s: Array, spans_s: Sequence[float]) -> tuple[Array, Array, Array]:
    """Position, velocity, acceleration at the given times.

    Derivatives come from local quartics over ``spans_s``: differences of an encoder's steps
    would put noise into the simulation that no noise model of the force accounts for.
    """
    motion = CubicSpline(trial.axis_s, trial.axis_mm)
    period_s = float(np.median(np.diff(trial.axis_s)))
    even_s = np.arange(trial.axis_s[0], trial.axis_s[-1], period_s)
    lengths = [max(5, 2 * round(0.5 * span_s / period_s) + 1) for span_s in spans_s]
    if len(even_s) <= max(lengths):
        return motion(at_s), motion(at_s, 1), motion(at_s, 2)
    even = motion(even_s)
    slopes = (derivative(even, n, k, period_s) for k, n in enumerate(lengths, start=1))
    velocity, acceleration = (np.asarray(CubicSpline(even_s, slope)(at_s)) for slope in slopes)
    return np.asarray(motion(at_s)), velocity, acceleration


def derivative(values: Array, count: int, order: int, period_s: float) -> Array:
    """Derivative of the quartics nearest to ``count`` values, an odd number, about each (Savitzky and Golay 1964).

    Near either end that of the quartic of the first or the last ``count``. Not by scipy.signal, which takes half a
    second to load.
    """
    half = count // 2
    at = np.arange(-half, half + 1) / half
    slopes = np.zeros((count, 5))
    slopes[:, order:] = np.vander(at, 5 - order, increasing=True) * [math.perm(k, order) for k in range(order, 5)]
    weights = slopes @ np.linalg.pinv(np.vander(at, 5, increasing=True)) / (half * period_s) ** order
    first, last = weights[:half] @ values[:count], weights[-half:] @ values[-count:]
    return np.concatenate([first, np.correlate(values, weights[half], "valid"), last])


def _joined(parts: Sequence[_Gridded]) -> tuple[MeasuredMotion, Array, Array]:
    recording = np.concatenate([np.full(len(part.time_s), i, np.int64) for i, part in enumerate(parts)])
    force, position, velocity, acceleration = (np.concatenate([part.columns[k] for part in parts]) for k in range(4))
    temperatures = [part.temperature_C for part in parts if part.temperature_C is not None]
    tip_mm, tip_at, tip_recording = _tips(parts, position)
    drive = MeasuredMotion(
        time_s=np.concatenate([part.time_s for part in parts]),
        period_s=float(np.median(np.concatenate([np.diff(part.time_s) for part in parts]))), recording=recording,
        position_mm=position, velocity_mm_s=velocity, acceleration_mm_s2=acceleration, cycle=recording.astype(float),
        temperature_C=np.concatenate(temperatures) if len(temperatures) == len(parts) else None, tip_at=tip_at,
        tip_recording=tip_recording,
    )  # fmt: skip
    return drive, force, tip_mm


def _tips(parts: Sequence[_Gridded], position_mm: Array) -> tuple[Array, Array, NDArray[np.int64]]:
    """The tip along the axis: marker positions projected on the direction they move in with the encoder."""
    at, recording, start = [], [], 0
    for i, part in enumerate(parts):
        at.append(start + np.interp(part.marker_s, part.time_s, np.arange(len(part.time_s))))
        recording.append(np.full(len(part.marker_s), i, np.int64))
        start += len(part.time_s)
    flat_at, xyz = np.concatenate(at), np.concatenate([part.marker_mm for part in parts])
    if len(flat_at) <= FEWEST_SAMPLES:
        return np.empty(0), np.empty(0), np.empty(0, np.int64)
    encoder = np.interp(flat_at, np.arange(len(position_mm)), position_mm)
    direction = (encoder - encoder.mean()) @ (xyz - xyz.mean(axis=0))
    direction = direction / max(float(np.linalg.norm(direction)), 1e-12)
    along = (xyz - xyz.mean(axis=0)) @ direction
    return along + encoder.mean(), flat_at, np.concatenate(recording)
