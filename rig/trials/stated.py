"""What somebody states of a recording against its motion: speed, depth and surface, with both numbers."""

from typing import NamedTuple

import numpy as np

from rig.errors import DataError
from rig.recording.converter import Array
from rig.trials.cycles import cycle_of, way_back
from rig.trials.findings import BAD, Finding
from rig.trials.segments import times_by_way
from rig.trials.trial import FEWEST_SAMPLES, Trial, drop_disordered

# A drive that misses its speed by so much is another's speed, or another unit.
SPEED_SHARE = 0.3
# A preload hides part of a depth, a limit of force ends it early, each less than half; units differ by ten and more.
DEPTH_FACTOR = 2.0
# Depth is told within a factor of two either way: factors of speed and of depth that differ by less may be one.
ONE_FACTOR = 4.0
# The place where force has risen by a tenth is below the surface, and a statement of it is good to a millimetre.
CLEAR_SHARE = 0.1
SURFACE_MM = 1.0
# A step of a motion that steps is a twentieth of its way and more; smaller ones are as good as none.
STEP_SHARE = 0.05
TURN_SHARE = 0.05  # of the way: dither and noise are less, the way back between approach and loading is more
FEWEST_STEPS = 4  # at three samples of a way, its ends' rests take a third of the time
START_SAMPLES = 3  # the fewest that have a median


class WayIn(NamedTuple):
    """The way into the tissue, in the sense in which force grows (-1: out, as a strip is pulled).

    Speeds [mm/s] in the middle of its travel and where it is fastest, NaN where samples are too few to tell; places
    [mm] outermost, where force is clear, and deepest.
    """

    sense: int
    middle_mm_s: float
    fastest_mm_s: float
    outermost_mm: float
    clear_mm: float
    deepest_mm: float

    @property
    def way_mm(self) -> float:
        """The whole of it, air and all."""
        return self.deepest_mm - self.outermost_mm


def stated_findings(trial: Trial) -> tuple[Finding, ...]:
    """What of speed, depth and surface is stated and not the motion's; of kind ``BAD`` where a unit must be wrong."""
    loading = None if np.isnan([trial.speed_mm_s, trial.depth_mm, trial.surface_mm]).all() else _loading_of(trial)
    if loading is None:
        return ()
    wrong = {
        "speed": _speed(trial, loading),
        "depth": _depth(trial, loading),
        "surface": "" if trial.of_axis else _surface(trial, loading),
    }
    found = tuple(Finding(trial.name, "axis", kind, text) for kind, text in wrong.items() if text)
    if not (wrong["speed"] and wrong["depth"]):
        return found
    factor = trial.speed_mm_s / loading.middle_mm_s
    if not 1 / ONE_FACTOR < factor * loading.way_mm / trial.depth_mm < ONE_FACTOR:
        return found
    text = f"speed and depth are both off by a factor of about {factor:.2g}: position is in another unit, or both"
    return (*found, Finding(trial.name, "axis", BAD, f"{text}; correct the mapping"))


def _speed(trial: Trial, loading: WayIn) -> str:
    """Where it is neither the middle speed nor, of a motion that steps, that of its steps."""
    slow, fast = (1 - SPEED_SHARE) * loading.middle_mm_s, (1 + SPEED_SHARE) * loading.fastest_mm_s
    if not (trial.speed_mm_s < slow or trial.speed_mm_s > fast):
        return ""
    steps = f" (in steps at up to {loading.fastest_mm_s:.2g})" if loading.fastest_mm_s > 2 * loading.middle_mm_s else ""
    moves = f"{'the axis moves' if trial.of_axis else 'the tip loads'} at {loading.middle_mm_s:.2g} mm/s{steps}"
    return f"stated speed {trial.speed_mm_s:.3g} mm/s, but {moves}: the motion's is used"


def _depth(trial: Trial, loading: WayIn) -> str:
    pressed_mm = loading.deepest_mm - loading.clear_mm
    less = trial.depth_mm < pressed_mm / DEPTH_FACTOR
    if trial.depth_mm > DEPTH_FACTOR * loading.way_mm or (less and trial.of_axis):
        who = "axis" if trial.of_axis else "tip"
        return f"stated depth {trial.depth_mm:.3g} mm, but the {who} goes {loading.way_mm:.3g} mm in all"
    if less:
        return f"stated depth {trial.depth_mm:.3g} mm, but force rises over {pressed_mm:.3g} mm"
    return ""


def _surface(trial: Trial, loading: WayIn) -> str:
    surface_mm = loading.sense * trial.surface_mm
    if not (surface_mm > loading.clear_mm + SURFACE_MM or surface_mm < loading.outermost_mm - loading.way_mm):
        return ""
    places = sorted(loading.sense * place for place in (loading.outermost_mm, loading.deepest_mm))
    return (
        f"stated surface {trial.surface_mm:.4g} mm, but the tip goes from {places[0]:.4g} to {places[1]:.4g} mm, with "
        f"clear force from {loading.sense * loading.clear_mm:.4g} mm on: it is not used"
    )


def _loading_of(trial: Trial) -> WayIn | None:
    """How the tip goes to where force differs most from the start; None where too little can be read.

    Speed is that where force is clear, so that an approach at another speed does not count.
    """
    try:
        time_s, position_mm, load = _motion_of(trial)
    except DataError:
        return None
    risen = np.abs(load - np.median(load[:START_SAMPLES]))
    most = int(np.argmax(risen))
    sense = -1 if position_mm[most] < position_mm[0] else 1
    place_mm = sense * position_mm
    way_mm = way_back(place_mm[: most + 1], TURN_SHARE * float(np.ptp(place_mm[: most + 1])))
    start = most - int(np.argmin(way_mm))  # of the last way in
    unclear = np.flatnonzero(risen[start : most + 1] <= CLEAR_SHARE * risen[most])
    clear = start + (int(unclear[-1]) + 1 if len(unclear) else 0)
    most_of_it = place_mm[most] - place_mm[clear] > STEP_SHARE * (place_mm[most] - place_mm[start])
    first = clear if most - clear >= FEWEST_STEPS and most_of_it else start
    speeds = _speeds(time_s[first : most + 1], place_mm[first : most + 1])
    return WayIn(sense, *speeds, float(place_mm.min()), float(place_mm[clear]), float(place_mm.max()))


def _motion_of(trial: Trial) -> tuple[Array, Array, Array]:
    """Times, places, and what is most where the tip is deepest: force, of a drive axis alone the place itself."""
    if not trial.of_axis:
        cycle = cycle_of(trial)
        return cycle.time_s, cycle.position_mm, cycle.force_N
    time_s, place_mm = drop_disordered(trial.axis_s, trial.axis_mm)
    if len(time_s) < FEWEST_SAMPLES:
        raise DataError(f"{trial.name}: {len(time_s)} samples of the axis (at least {FEWEST_SAMPLES} are needed)")
    return time_s, place_mm, place_mm


def _speeds(time_s: Array, position_mm: Array) -> tuple[float, float]:
    if len(time_s) <= FEWEST_STEPS or position_mm.max() <= position_mm[0]:
        return np.nan, np.nan
    return middle_speed(time_s, position_mm), _fastest_speed(time_s, position_mm)


def middle_speed(time_s: Array, position_mm: Array) -> float:
    """The middle speed by travel of a motion in, arrays of shape (n,), so that rests in it do not count."""
    way_mm, took_s = times_by_way(time_s, position_mm)
    return float(way_mm / np.median(took_s))


def _fastest_speed(time_s: Array, position_mm: Array) -> float:
    """That of the twentieth of the way which took the least time."""
    reached_mm = np.maximum.accumulate(position_mm)
    ends = np.searchsorted(reached_mm, reached_mm + STEP_SHARE * np.ptp(reached_mm))
    starts = np.flatnonzero(ends < len(ends))
    gone_mm, took_s = (column[ends[starts]] - column[starts] for column in (reached_mm, time_s))
    return float(np.max(gone_mm / took_s))
