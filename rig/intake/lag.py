"""How far one clock is from another, by what both have seen: a motion, and another measure of it or its force.

Correlated rates say where to look, and whether there is one place only. Then the follower is modelled in short windows
by the motion, shifted by a lag, with every other coefficient free; sums of squares, read as likelihoods over all
windows, give offset and drift with intervals. Of two motions the windows are blocks. Of a force they are the turns of
the motion (start, stop, retreat), where force bends at once whatever the tissue: stiffness, viscosity and memory are
not negative and otherwise unknown, so that the interval holds all lags that they could stand for.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import nnls

from rig.errors import RigError

Array = NDArray[np.float64]

# Step of the rates that are correlated: a stroke takes half a second and more, and noise averages out over it.
COARSE_S = 0.01
LEAST_STEPS = 200  # of the shorter signal, so that one of half a second has a shape as well
# A lag is looked for where at least half of the shorter signal has a partner; chance finds likeness in any short end.
LEAST_OVERLAP = 0.5
# Of force that follows a tenth of the motion (the rest is air) the correlation is 0.3; of noise alone it is below 0.1.
LEAST_CORRELATION = 0.3
# Of ten like cycles nine fit one cycle further on: then noise and tissue decide, and not the clocks.
OTHER_PEAK = 0.9
LOBE = 0.5  # below half of its height the correlation is no longer the same peak
# Drives accelerate a tip in 20 to 100 ms; a speed is compared over that time.
TURN_S = 0.05
TURN_SHARE = 0.3  # of the largest speed: a smaller change bends force less than a tissue's stiffening does
# Half a window at a turn: longer than the drive accelerates, shorter than most of a stroke.
WINDOW_S = 0.15
SMOOTH_S = 0.004  # a micrometre in it is 0.25 mm/s
LEAST_SAMPLES = 16  # twice what is fitted in a window
MOST_SAMPLES = 4000
BLOCKS = 12  # as many as leave their scatter known within a fifth
# Clocks of loggers and controllers run within 100 ppm of each other (two crystals of 50 ppm): two deviations.
DRIFT = 50e-6
# Of the samples of a recording that touches some lie in the air, or at its lowest force.
AIR = 0.01
LEFT_SHARE = 0.2  # of the force at a turn: below it the tip may leave the tissue, and force bends by itself
# A turn is seen where it takes five deviations squared off the misfit.
SEEN = 25.0
FAR = 30.0  # five deviations off, a lag is not looked at closely
WITHIN = 3.84  # twice the log likelihood's drop that holds 95 of 100 (chi-squared, one degree)
# Of a window's range: interpolation between samples is no better, and exact data have no noise of their own.
LEAST_NOISE = 1e-4
# A window whose misfit is that much above the noise between samples holds something else: contact begins in it.
MISFIT, MISFIT_SHARE = 2.0, 0.0005
# Maxwell branches, as shares of a half window: quicker ones act as viscosity, slower ones as stiffness.
BRANCHES = (0.05, 0.2, 0.8)
LAGS, ROUNDS = 25, 4
GRID, REACH = 81, 8.0  # deviations that a grid reaches: of a normal likelihood far more than FAR
WIDER = 3.0

Columns = Callable[[Array], Array]
"""The motion at times of its own clock, as columns of shape (n, k)."""
Left = Callable[[Array, Array], Array]
"""What of values of shape (n,) columns of shape (n, k) do not explain."""


class ClocksApart(RigError):
    """The data do not say how two clocks lie to each other; the message says why."""


class TimedSignal(NamedTuple):
    """A channel on its own clock: growing times [s] and finite values, each of shape (n,)."""

    time_s: Array
    value: Array


class Lag(NamedTuple):
    """What is added to a follower's time ``t`` to be on the motion's clock: ``offset_s + drift * (t - at_s)``.

    ``within_s`` is half the 95 % interval at ``at_s``, ``anywhere_s`` the most it is within the follower's times.
    """

    offset_s: float
    within_s: float
    anywhere_s: float
    drift: float
    drift_within: float
    at_s: float


class _Window(NamedTuple):
    """Misfit of the follower about a time over lags, in units of its variance and from its smallest on."""

    at_s: float
    lags_s: Array
    excess: Array

    @property
    def likely(self) -> tuple[float, float]:
        """Middle of the likely lags, and their standard deviation were they normal."""
        near = np.flatnonzero(self.excess <= WITHIN)
        low_s, high_s = self.lags_s[max(near[0] - 1, 0)], self.lags_s[min(near[-1] + 1, len(self.lags_s) - 1)]
        return float(low_s + high_s) / 2, float(high_s - low_s) / 2 / float(np.sqrt(WITHIN))


def lag_of_motion(follower: TimedSignal, motion: TimedSignal) -> Lag:
    """The lag of another measure of the motion, in any unit and sense; raises ClocksApart."""
    start_s = _likeness(follower, motion, signed=False)
    reach_s = 4 * _step_s(follower, motion)
    for _ in range(2):
        found = _joined(list(_blocks(follower, motion, start_s, reach_s)), follower)
        start_s = found.offset_s
    return found


def lag_of_force(force: TimedSignal, motion: TimedSignal) -> Lag:
    """The lag of a force behind the motion that makes it, both positive into the tissue; raises ClocksApart."""
    start_s = _likeness(force, motion, signed=True)
    turns_s = _turns(motion, force)
    for _ in range(2):
        found = _joined(list(_at_turns(force, motion, turns_s, start_s)), force)
        start_s = found.offset_s
    # Between two samples a drive may turn as it will.
    unsure_s = max(_period_s(motion), _period_s(force))
    return found._replace(within_s=found.within_s + unsure_s, anywhere_s=found.anywhere_s + unsure_s)


def _period_s(signal: TimedSignal) -> float:
    return float(np.median(np.diff(signal.time_s)))


def _step_s(*signals: TimedSignal) -> float:
    """Step of the coarse search: two samples of the slower signal at least."""
    shortest_s = min(float(np.ptp(signal.time_s)) for signal in signals)
    return max(2 * max(map(_period_s, signals)), min(COARSE_S, shortest_s / LEAST_STEPS))


def _likeness(follower: TimedSignal, motion: TimedSignal, signed: bool) -> float:
    """The lag at which the rates are most alike; raises ClocksApart where none is, or another is as good."""
    step_s = _step_s(follower, motion)
    theirs, ours = (_rates(signal, step_s) for signal in (follower, motion))
    if min(len(theirs), len(ours)) < LEAST_SAMPLES:
        raise ClocksApart(f"{min(len(theirs), len(ours))} steps of {step_s:.2g} s are too few to be compared")
    energy = _correlated(ours**2, np.ones_like(theirs)) * _correlated(np.ones_like(ours), theirs**2)
    overlap = _correlated(np.ones_like(ours), np.ones_like(theirs))
    product = _correlated(ours, theirs) if signed else np.abs(_correlated(ours, theirs))
    whole = product / np.sqrt((ours @ ours) * (theirs @ theirs) or 1.0)
    common = product / np.sqrt(np.maximum(energy, 1e-9 * energy.max()))
    common[overlap < LEAST_OVERLAP * min(len(theirs), len(ours))] = 0.0
    best = int(np.argmax(np.where(common > 0, whole, 0.0)))
    # What lies outside the common time counts against a lag, or is unknown: alone in both, it is the only one.
    for likeness in (whole, common):
        _check_alone(likeness, best, step_s)
    return float(motion.time_s[0] - follower.time_s[0] + (best - len(theirs) + 1) * step_s)


def _check_alone(likeness: Array, best: int, step_s: float) -> None:
    most = float(likeness[best])
    if not most >= LEAST_CORRELATION:
        raise ClocksApart(f"its rate does not go with the motion (correlation {most:.2f}, {LEAST_CORRELATION} needed)")
    low = np.flatnonzero(likeness < LOBE * most)
    before, after = low[low < best], low[low > best]
    others = likeness.copy()
    others[(before[-1] if len(before) else 0) : (after[0] if len(after) else len(likeness))] = 0.0
    other = int(np.argmax(others))
    if others[other] > OTHER_PEAK * most:
        raise ClocksApart(
            f"the motion repeats: {abs(other - best) * step_s:.3g} s further on the two correlate by "
            f"{others[other]:.2f}, at best by {most:.2f}"
        )


def _rates(signal: TimedSignal, step_s: float) -> Array:
    """Slope of the signal's means over steps, from its start on."""
    time_s = signal.time_s - signal.time_s[0]
    area = np.concatenate([[0.0], np.cumsum(np.diff(time_s) * (signal.value[1:] + signal.value[:-1]) / 2)])
    edges_s = np.arange(0.0, time_s[-1], step_s)
    means = np.diff(np.interp(edges_s, time_s, area)) / step_s
    return np.asarray((means[2:] - means[:-2]) / (2 * step_s))


def _correlated(ours: Array, theirs: Array) -> Array:
    """Sum of ours[i + j - len(theirs) + 1] theirs[i] over i, for each j."""
    size = len(ours) + len(theirs) - 1
    product = np.fft.rfft(ours, size) * np.fft.rfft(theirs[::-1], size)
    return np.asarray(np.fft.irfft(product, size))


def _blocks(follower: TimedSignal, motion: TimedSignal, start_s: float, reach_s: float) -> Iterator[_Window]:
    """Windows over the common time, one beside the other, in each of which the follower is a line of the motion."""
    first_s = max(follower.time_s[0], motion.time_s[0] - start_s + reach_s)
    last_s = min(follower.time_s[-1], motion.time_s[-1] - start_s - reach_s)
    lags_s = start_s + np.linspace(-reach_s, reach_s, LAGS)
    for low_s, high_s in pairwise(np.linspace(first_s, last_s, BLOCKS + 1)):
        part = _part(follower, low_s, high_s)
        if part:
            yield from _window(part, np.ones((len(part.time_s), 1)), partial(_place, motion), _off_line, lags_s)


def _part(signal: TimedSignal, low_s: float, high_s: float) -> TimedSignal | None:
    """The samples between two times, thinned where they are more than are needed; None where they are too few."""
    first, last = np.searchsorted(signal.time_s, [low_s, high_s])
    chosen = slice(first, last, 1 + (last - first) // MOST_SAMPLES)
    return TimedSignal(signal.time_s[chosen], signal.value[chosen]) if last - first >= LEAST_SAMPLES else None


def _place(motion: TimedSignal, at_s: Array) -> Array:
    return np.interp(at_s, *motion)[:, None]


def _off_line(columns: Array, values: Array) -> Array:
    column = columns[:, 0]
    return np.asarray(values - column * (column @ values) / max(float(column @ column), 1e-300))


def _off_tissue(columns: Array, values: Array) -> Array:
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    try:
        return np.asarray(values - scaled @ nnls(scaled, values)[0])
    except RuntimeError:  # columns so alike that its search goes in circles: without bounds no lag is excluded wrongly
        return np.asarray(values - scaled @ np.linalg.lstsq(scaled, values, rcond=None)[0])


def _turns(motion: TimedSignal, force: TimedSignal) -> Array:
    """When the speed of the motion changes, each with no greater change near it; shape (turns,)."""
    half_s = max(TURN_S, 3 * _period_s(motion), 3 * _period_s(force))
    grid_s = np.arange(motion.time_s[0] + half_s, motion.time_s[-1] - half_s, half_s / 5)
    if not len(grid_s):
        return grid_s
    before, here, after = (np.interp(grid_s + shift_s, *motion) for shift_s in (-half_s, 0.0, half_s))
    change = np.abs(after - 2 * here + before)
    near = np.lib.stride_tricks.sliding_window_view(np.pad(change, 10), 21).max(axis=1)
    return np.asarray(grid_s[(change >= near) & (change > TURN_SHARE * np.abs(here - before).max())])


def _at_turns(force: TimedSignal, motion: TimedSignal, turns_s: Array, start_s: float) -> Iterator[_Window]:
    """A window about each turn, that holds no other turn."""
    wanted_s = max(WINDOW_S, LEAST_SAMPLES * _period_s(force))
    air_N = float(np.quantile(force.value, AIR))
    gaps_s = np.diff(turns_s, prepend=-np.inf, append=np.inf)
    for turn_s, gap_s in zip(turns_s, np.minimum(gaps_s[:-1], gaps_s[1:]), strict=True):
        half_s = min(wanted_s, 0.6 * gap_s)
        part = _part(_pressed(force, turn_s - start_s, half_s, air_N), -np.inf, np.inf)
        if part:
            # What was pressed before goes on to relax, smoothly.
            smooth = np.vander((part.time_s - part.time_s.mean()) / half_s, 3)
            lags_s = start_s + np.linspace(-half_s / 2, half_s / 2, LAGS)
            yield from _window(part, smooth, _tissue(motion, turn_s, half_s), _off_tissue, lags_s)


def _pressed(force: TimedSignal, at_s: float, half_s: float, air_N: float) -> TimedSignal:
    """The samples about a turn up to where force is a small part of that at it: the tip may leave the tissue."""
    first, last = np.searchsorted(force.time_s, [at_s - half_s, at_s + half_s])
    time_s, over_N = force.time_s[first:last], force.value[first:last] - air_N
    turn = int(np.searchsorted(time_s, at_s))
    if not 0 < turn < len(time_s):
        return TimedSignal(time_s[:0], over_N[:0])
    low = np.flatnonzero(over_N < LEFT_SHARE * np.median(over_N[max(turn - 2, 0) : turn + 3]))
    start, stop = low[low < turn].max(initial=-1) + 1, low[low >= turn].min(initial=len(time_s))
    return TimedSignal(time_s[start:stop], over_N[start:stop])


def _tissue(motion: TimedSignal, turn_s: float, half_s: float) -> Columns:
    """What a tissue can add to force about a turn: springs that stiffen, dampers that do, Maxwell branches."""
    step_s = half_s / 200
    grid_s = np.arange(turn_s - 2 * half_s, turn_s + 2 * half_s, step_s)
    place = CubicSpline(*_smoothed(motion, turn_s - 3 * half_s, turn_s + 3 * half_s))(grid_s)
    depth, gains = place - place.min(), np.diff(place, prepend=place[0])
    branches = [_recent(gains, step_s / (share * half_s)) for share in BRANCHES]
    pace = np.gradient(place, step_s) * half_s
    columns = [depth, depth**2, depth**3, pace, depth * pace, *branches]
    return lambda at_s: np.stack([np.interp(at_s, grid_s, column) for column in columns], axis=1)


def _smoothed(motion: TimedSignal, low_s: float, high_s: float) -> TimedSignal:
    """Means of the samples between two times, over steps in which an encoder's count is no speed."""
    first, last = np.searchsorted(motion.time_s, [low_s, high_s])
    count = max(round(SMOOTH_S / _period_s(motion)), 1)
    last -= (last - first) % count
    return TimedSignal(*(column[first:last].reshape(-1, count).mean(axis=1) for column in motion))


def _recent(gains: Array, loss: float) -> Array:
    """What is left of the gains, each of which dies away by ``loss`` a step."""
    growth = loss * np.arange(len(gains))
    return np.asarray(np.exp(-growth) * np.cumsum(np.exp(growth) * gains))


def _window(part: TimedSignal, smooth: Array, columns: Columns, left: Left, lags_s: Array) -> Iterator[_Window]:
    """The window, where the motion explains what is not ``smooth`` in it, down to its noise; else nothing."""
    base, _ = np.linalg.qr(smooth)
    rest = part.value - base @ (base.T @ part.value)

    def remainder(lag_s: float) -> Array:
        found = columns(part.time_s + lag_s)
        return left(found - base @ (base.T @ found), rest)

    found = dict[float, float]()
    for _ in range(ROUNDS):
        found |= {lag: float(np.sum(remainder(lag) ** 2)) for lag in lags_s.tolist() if lag not in found}
        known, misfits = np.array(sorted(found.items())).T
        remains = remainder(float(known[np.argmin(misfits)]))
        variance = _variance(remains, part.value, base.shape[1])
        lags_s = _closer(known, misfits - misfits.min() <= FAR * variance)
    least = int(np.argmin(misfits))
    if not 0 < least < len(known) - 1:
        return
    if rest @ rest - misfits.min() > SEEN * variance and (left is _off_line or _is_noise(remains, part.value)):
        yield _Window(float(part.time_s.mean()), known, (misfits - misfits.min()) / variance)


def _closer(lags_s: Array, near: NDArray[np.bool_]) -> Array:
    """As many lags between the neighbours of those that are ``near``."""
    kept = np.flatnonzero(near)
    return np.linspace(lags_s[max(kept[0] - 1, 0)], lags_s[min(kept[-1] + 1, len(lags_s) - 1)], LAGS)


def _variance(remains: Array, values: Array, fitted: int) -> float:
    """Of one sample; more where neighbours are alike, which then tell less than their number."""
    power = float(remains @ remains)
    alike = min(max(float(remains[1:] @ remains[:-1]) / power, 0.0), 0.99) if power else 0.0
    own = power / (len(remains) - fitted - 2) * (1 + alike) / (1 - alike)
    return max(own, (LEAST_NOISE * float(np.ptp(values))) ** 2)


def _is_noise(remains: Array, values: Array) -> bool:
    """Whether what remains is the noise between neighbours and little more."""
    noise = float(np.mean(np.diff(values, 2) ** 2)) / 6
    return float(np.mean(remains**2)) <= MISFIT * noise + (MISFIT_SHARE * float(np.ptp(values))) ** 2


def _joined(windows: Sequence[_Window], follower: TimedSignal) -> Lag:
    """Offset and drift that suit all windows; raises ClocksApart where there is none."""
    if not windows:
        raise ClocksApart("no turn of the motion is seen in it clearly")
    at_s, (lags_s, deviations_s) = np.array([item.at_s for item in windows]), np.array([w.likely for w in windows]).T
    weights = deviations_s**-2.0
    middle_s = float(np.average(at_s, weights=weights))
    ways_s = at_s - middle_s
    known = 1 / np.sqrt(weights.sum()), 1 / np.sqrt(weights @ ways_s**2 + DRIFT**-2.0)
    best = float(np.average(lags_s, weights=weights)), float((weights * ways_s) @ lags_s * known[1] ** 2)
    scatter = np.sqrt(max(float(np.mean(((lags_s - best[0] - best[1] * ways_s) / deviations_s) ** 2)), 1.0))
    reach = REACH * scatter
    for _ in range(3):
        offsets_s, drifts = (
            centre + np.linspace(-reach, reach, GRID) * width for centre, width in zip(best, known, strict=True)
        )
        excess = _excess(windows, offsets_s, drifts, ways_s)
        likely = excess <= WITHIN
        if not (likely[[0, -1]].any() or likely[:, [0, -1]].any()):
            return _read(offsets_s, drifts, likely, middle_s, follower)
        reach *= WIDER
    raise ClocksApart(f"its turns disagree: they leave {2 * reach * known[0]:.2g} s open")


def _excess(windows: Sequence[_Window], offsets_s: Array, drifts: Array, ways_s: Array) -> Array:
    """Twice the log likelihood lost at each offset and drift, from 0 on; less where windows disagree among them."""
    total = np.zeros((len(offsets_s), len(drifts)))
    for window, way_s in zip(windows, ways_s, strict=True):
        total += np.interp(offsets_s[:, None] + way_s * drifts, window.lags_s, window.excess)
    scatter = float(total.min()) / max(len(windows) - 1, 1)
    total = total / max(scatter, 1.0) + (drifts / DRIFT) ** 2
    return np.asarray(total - total.min())


def _read(offsets_s: Array, drifts: Array, likely: NDArray[np.bool_], middle_s: float, follower: TimedSignal) -> Lag:
    """The middle of what is likely, and how far it reaches."""
    offset_s, within_s = _middle(offsets_s, np.any(likely, axis=1))
    drift, drift_within = _middle(drifts, np.any(likely, axis=0))
    ends_s = follower.time_s[[0, -1]] - middle_s
    missed_s = (offsets_s[:, None, None] - offset_s) + (drifts[:, None] - drift) * ends_s
    anywhere_s = max(within_s, float(np.abs(missed_s[likely]).max()))
    return Lag(offset_s, within_s, anywhere_s, drift, drift_within, middle_s)


def _middle(grid: Array, likely: NDArray[np.bool_] | np.bool_) -> tuple[float, float]:
    first, last = grid[np.asarray(likely)][[0, -1]]
    return float(first + last) / 2, float(last - first) / 2 + float(grid[1] - grid[0])
