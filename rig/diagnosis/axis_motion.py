"""Recordings of an axis as rows without a unit: filtered, thinned, each quantity over the range it has in them.

Motion and effort pass the same zero-phase filter and are thinned together (parallel decimation; Gautier 1997). Effort
counts in half its range, position in its range, velocity and acceleration in their largest, time in the one over the
other; what a parameter is in the axis' own units follows.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy  # its parts load when they are used: scipy.signal takes half a second
from numpy.typing import NDArray

from rig.errors import DataError
from rig.intake.axis import AxisRecording, AxisUnits
from rig.trials.streams import sample_noise

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

# The filter passes what is ten times faster than nearly all of the motion, as corners of the velocity are, and more
# where that leaves too few rows: friction that turns round within a slow motion is faster than it.
SLOW_SHARE, CUT_TIMES = 0.99, 10.0
WANTED_ROWS = 1200  # a hundred in each of a dozen blocks
CUT_OF_THINNED = 0.35  # of the thinned rate; at half of it, which is as fast as rows tell, 5 % pass
EDGE_PERIODS = 8.0  # of the cut, after which the filter has forgotten its start
MOST_ROWS = 6000  # evidence of 24,841 samples thinned to 2,500 is that of all of them; a search takes seconds
FEWEST_ROWS = 240  # twenty in each of a dozen blocks
BLOCKS = 12  # of so many a standard error is known to a fifth (1 / sqrt(2 x 11))
SIGN_SHARE = 0.004  # of the speed: where dry friction has most of its sign
SIGN_NOISES = 1.5  # standard deviations: of slower rows one sign in fifteen is noise
SIGNS = 6.0  # from here on dry friction has its full sign (tanh 6 = 1 - 1e-5)
OUTER = (0.5, 99.5)  # percentiles: a spike is no range
FASTEST = 99.0  # percentile taken for the largest: derivatives of a spike are larger, and are no motion
WHITE = 1.95  # third differences of white noise see no more than that of it once it has passed the filter


class Scales(NamedTuple):
    """What one unit of each row stands for in the axis' own units; ``centre`` is the position of row 0."""

    position: float
    centre: float
    speed: float
    acceleration: float
    effort: float
    units: AxisUnits

    @property
    def time_s(self) -> float:
        """The unit of time: speed over acceleration."""
        return self.speed / self.acceleration

    def of(self, dimension: str) -> tuple[float, str]:
        """Factor and unit of a parameter that is declared in ``dimension``."""
        place, effort = self.units
        return {
            "1": (1.0, "1"),
            "s": (self.time_s, "s"),
            "position": (self.position, place),
            "speed": (self.speed, f"{place}/s"),
            "effort": (self.effort, effort),
            "effort s/position": (self.effort / self.speed, f"{effort} s/{place}"),
            "effort s2/position": (self.effort / self.acceleration, f"{effort} s2/{place}"),
            "effort s4/position": (self.effort / self.acceleration * self.time_s**2, f"{effort} s4/{place}"),
            "effort/position": (self.effort / self.position, f"{effort}/{place}"),
            "position/effort": (self.position / self.effort, f"{place}/{effort}"),
        }[dimension]


@dataclass(frozen=True)
class Motion:
    """Rows of all recordings, one after another, without unit; shape (n,). ``block`` is the part that is left out.

    ``direction`` is the sign of the velocity, through the same filter as the effort: dry friction that turns round
    does so in both alike. ``slip`` is what the load is ahead of the drive, NaN without a second encoder; ``angle_rad``
    the position as an angle, NaN where it is none; ``blind`` rows stand still, or rest on samples that are missing.
    """

    position: Array
    velocity: Array
    acceleration: Array
    snap: Array
    effort: Array
    slip: Array
    angle_rad: Array
    time: Array
    block: Index
    recording: Index
    blind: Mask
    direction: Array

    @cached_property
    def first(self) -> Mask:
        """True at the first row of each recording."""
        return np.asarray(np.diff(self.recording, prepend=-1) != 0)

    @property
    def period(self) -> float:
        """Time between two rows."""
        return float(np.median(np.diff(self.time)))


class _Rows(NamedTuple):
    """One recording, filtered and thinned, in the axis' own units."""

    position: Array
    velocity: Array
    acceleration: Array
    snap: Array
    effort: Array
    slip: Array
    time_s: Array
    blind: Mask
    direction: Array


class _Even(NamedTuple):
    """One recording on an even grid; rows far from any sample are ``unknown``."""

    period_s: float
    position: Array
    effort: Array
    slip: Array
    unknown: Mask


def prepare(recordings: Sequence[AxisRecording], units: AxisUnits, angle_rad: float) -> tuple[Motion, Scales]:
    """Rows of all recordings and what they stand for; ``angle_rad`` is one unit of position, NaN where it is no angle.

    Raises DataError where too little was recorded, or nothing moves.
    """
    even = [evenly(recording) for recording in recordings]
    whole_s = sum(one.period_s * len(one.position) for one in even)
    few_Hz, many_Hz = (CUT_OF_THINNED * count / whole_s for count in (WANTED_ROWS, MOST_ROWS))
    cut_Hz = float(np.clip(min(cut_of(one) for one in even), few_Hz, many_Hz))
    cut_Hz = min(cut_Hz, *(CUT_OF_THINNED / one.period_s for one in even))
    rows = [_thinned(one, cut_Hz) for one in even]
    count = sum(len(one.position) for one in rows)
    if count < FEWEST_ROWS:
        said = f"the motion is told by {count} rows after filtering at {cut_Hz:.3g} Hz (at least {FEWEST_ROWS})"
        raise DataError(f"{said}; record longer, or faster")
    scales = _scales(rows, units)
    return _without_unit(rows, scales, angle_rad), scales


def evenly(recording: AxisRecording) -> _Even:
    """The recording on an even grid at its median period, gaps bridged and marked; raises DataError where none is."""
    seen = np.isfinite(recording.position)
    told = seen & np.isfinite(recording.effort)
    if np.count_nonzero(told) < FEWEST_ROWS:
        said = f"{np.count_nonzero(told)} samples have both motion and effort (at least {FEWEST_ROWS})"
        raise DataError(f"recording {recording.name}: {said}; record longer, or faster")
    time_s = recording.time_s
    period_s = float(np.median(np.diff(time_s[seen])))
    grid_s = np.arange(time_s[told][0], time_s[told][-1] + 0.5 * period_s, period_s)
    effort = np.interp(grid_s, time_s[told], recording.effort[told])
    position = np.interp(grid_s, time_s[seen], recording.position[seen])
    slip, unknown = np.full(len(grid_s), np.nan), _far(grid_s, time_s[told], period_s)
    if recording.load_position is not None:
        both = seen & np.isfinite(recording.load_position)
        slip = np.interp(grid_s, time_s[both], (recording.load_position - recording.position)[both])
        unknown |= _far(grid_s, time_s[both], period_s)
    if np.ptp(position) == 0 or np.ptp(effort) == 0:
        still = "position" if np.ptp(position) == 0 else "effort"
        raise DataError(f"recording {recording.name}: the {still} never changes; connect it, or correct its column")
    return _Even(period_s, position, effort, slip, unknown)


def _far(grid_s: Array, samples_s: Array, period_s: float) -> Mask:
    """Whether the nearest sample is more than a period and a half away."""
    after = np.clip(np.searchsorted(samples_s, grid_s), 1, len(samples_s) - 1)
    nearest = np.minimum(np.abs(samples_s[after] - grid_s), np.abs(samples_s[after - 1] - grid_s))
    return np.asarray(nearest > 1.5 * period_s)


def cut_of(one: _Even) -> float:
    """Frequency of the filter [Hz], by how fast the axis moves; raises DataError where the samples are too slow."""
    frequency, power = scipy.signal.periodogram(np.gradient(one.position, one.period_s), 1 / one.period_s, "hann")
    share = np.cumsum(power) / power.sum()
    fastest_Hz = float(frequency[np.searchsorted(share, SLOW_SHARE)])
    highest_Hz = CUT_OF_THINNED / one.period_s
    if fastest_Hz > highest_Hz / 2:
        raise DataError(
            f"the axis moves at {fastest_Hz:.3g} Hz and is sampled at {1 / one.period_s:.3g} Hz, too slowly to tell "
            f"its acceleration; sample at {2 / CUT_OF_THINNED * fastest_Hz:.2g} Hz or faster"
        )
    return min(CUT_TIMES * fastest_Hz, highest_Hz)


def _thinned(one: _Even, cut_Hz: float) -> _Rows:
    rate_Hz = 1 / one.period_s
    numerator, denominator = scipy.signal.butter(4, cut_Hz / (rate_Hz / 2))
    edge, step = math.ceil(EDGE_PERIODS * rate_Hz / cut_Hz), max(1, round(CUT_OF_THINNED * rate_Hz / cut_Hz))
    take = slice(edge, len(one.position) - edge, step)
    if len(one.position) <= 2 * edge + step * BLOCKS:
        raise DataError(f"a recording of {len(one.position) / rate_Hz:.3g} s is too short; record longer")
    derivatives = [scipy.signal.filtfilt(numerator, denominator, one.position)]
    for _ in range(4):
        derivatives.append(np.gradient(derivatives[-1], one.period_s))
    # Lost motion is a step at each reversal, which the filter would make ring: slip is only thinned.
    effort, slip = scipy.signal.filtfilt(numerator, denominator, one.effort), one.slip
    reach = np.ones(2 * math.ceil(rate_Hz / cut_Hz) + 1)
    unknown = np.convolve(one.unknown, reach, "same") > 0
    time_s = np.arange(len(effort)) * one.period_s
    q, v, a, _, s = derivatives
    sign_speed = max(SIGN_SHARE * float(np.percentile(np.abs(v), FASTEST)), SIGN_NOISES * noise_of(v[take]))
    direction = scipy.signal.filtfilt(numerator, denominator, np.tanh(v / sign_speed))
    blind = unknown | (np.abs(v) < SIGNS * sign_speed)
    return _Rows(*(np.ascontiguousarray(x[take]) for x in (q, v, a, s, effort, slip, time_s, blind, direction)))


def _scales(rows: Sequence[_Rows], units: AxisUnits) -> Scales:
    known = {field: np.concatenate([getattr(one, field)[~one.blind] for one in rows]) for field in _Rows._fields}
    low, high = np.percentile(known["effort"], OUTER)
    near, far = known["position"].min(), known["position"].max()
    speed, acceleration = (float(np.percentile(np.abs(known[key]), FASTEST)) for key in ("velocity", "acceleration"))
    return Scales(float(far - near), float(near + far) / 2, speed, acceleration, float(high - low) / 2, units)


def _without_unit(rows: Sequence[_Rows], scales: Scales, angle_rad: float) -> Motion:
    snap = scales.acceleration / scales.time_s**2
    each = max(1, round(BLOCKS / len(rows)))
    parts, blocks, at_s = [], 0, 0.0
    for number, one in enumerate(rows):
        count = len(one.position)
        parts.append((
            (one.position - scales.centre) / scales.position, one.velocity / scales.speed,
            one.acceleration / scales.acceleration, one.snap / snap, one.effort / scales.effort,
            one.slip / scales.position, one.position * angle_rad, (at_s + one.time_s) / scales.time_s,
            blocks + np.arange(count) * each // count, np.full(count, number), one.blind,
            one.direction,
        ))  # fmt: skip
        blocks, at_s = blocks + each, at_s + float(one.time_s[-1]) + 1.0
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
    names = [field.name for field in fields(Motion)][: len(joined)]
    return Motion(**dict(zip(names, joined, strict=True)))


def noise_of(signal: Array) -> float:
    """Standard deviation of white noise in filtered and thinned rows, by third differences."""
    return WHITE * sample_noise(signal)
