"""The cycles of a recording, and one of them as three aligned arrays, on the force sensor's own time base."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rig.errors import DataError
from rig.recording.converter import Array
from rig.trials.findings import Finding
from rig.trials.streams import despiked
from rig.trials.trial import Trial, TrialSet, drop_disordered, drop_unusable

# Shares of a travel, of 5 mm of air and 8 mm of depth for example: a lift leaves the surface, which is at 0.38; a stop
# at half depth, at 0.69, is none; what is within 0.26 mm of the highest place is the rest there.
UP, DEEP = 0.25, 0.6
AT_REST = 0.02
# Half of what contact is known to in a good trial: a shorter way has no depth that can be told.
LEAST_TRAVEL_MM = 0.1
AIR_SHARE = 0.05  # of the force's range: guide friction of 0.2 N, in a trial of 4 N


@dataclass(frozen=True)
class IndentationCycle:
    """One trial at the capture times of force; force is compressive but not yet zeroed.

    Arrays have shape (n,); ``speed_mm_s`` is the speed asked for, NaN where nobody said.
    """

    name: str
    speed_mm_s: float
    time_s: Array
    force_N: Array
    position_mm: Array


def cycle_of(trial: Trial) -> IndentationCycle:
    """The trial, cleaned, with position at the times of force; raises DataError where too little is left."""
    sound = drop_unusable(trial)
    force_s, axis_s = (_from(sound.force_s[0], at_s) for at_s in (sound.force_s, sound.axis_s))
    position_mm = np.interp(force_s, axis_s, sound.axis_mm)
    return IndentationCycle(trial.name, trial.speed_mm_s, force_s, sound.force_N, position_mm)


def pushed(cycle: IndentationCycle) -> tuple[IndentationCycle, tuple[Finding, ...]]:
    """The cycle as compression: with both signs turned, and that said, where force grows in tension on the way out."""
    force_N = despiked(cycle.force_N)
    lowest = int(np.argmin(force_N))
    way_mm = cycle.position_mm[: lowest + 1] - cycle.position_mm[0]
    # A tip that leaves the tissue goes out as well, but its force ends at zero.
    if -force_N[lowest] <= force_N.max() or -way_mm[-1] <= max(float(way_mm.max()), LEAST_TRAVEL_MM):
        return cycle, ()
    text = "force grows in tension as the tip goes out: depth and force count in that sense"
    turned = replace(cycle, force_N=-cycle.force_N, position_mm=-cycle.position_mm)
    return turned, (Finding(cycle.name, "force", "tension", text),)


def as_pushed(trial: Trial) -> tuple[Trial, tuple[Finding, ...]]:
    """The trial likewise; raises DataError where too little is left of it."""
    _, pulled = pushed(cycle_of(trial))
    return replace(trial, force_N=-trial.force_N, axis_mm=-trial.axis_mm) if pulled else trial, pulled


def way_back(position_mm: Array, turn_mm: float) -> Array:
    """Places from the last one backwards, to where the tip turned by more than ``turn_mm`` on its way in."""
    back_mm = position_mm[::-1]
    turned = np.flatnonzero(back_mm > np.minimum.accumulate(back_mm) + turn_mm)
    return back_mm[: turned[0]] if len(turned) else back_mm


def _from(start_s: float, at_s: Array) -> Array:
    """Times from the start, in whole nanoseconds: how far into a session the trial was made leaves no digit in them."""
    return np.asarray(np.rint((at_s - start_s) * 1e9) * 1e-9)


def in_cycles(session: TrialSet) -> TrialSet:
    """The session with every recording cut in the air between its cycles; as it was where none has two."""
    parts = [part for trial in session.trials for part in cut(trial)]
    if len(parts) == len(session.trials):
        return session
    text = f"{len(session.trials)} recordings were cut into {len(parts)} cycles, in the air between them"
    finding = Finding(session.trials[0].name, "session", "cut", text)
    return replace(session, trials=tuple(parts), findings=(*session.findings, finding))


def cut(trial: Trial) -> list[Trial]:
    """The cycles of a recording, each from the middle of the rest before it to that after it."""
    try:
        turned, _ = as_pushed(trial)
    except DataError:  # too little is left to have cycles, as whoever reads the trial says
        return [trial]
    cuts = [at for at in lifts(*drop_disordered(turned.axis_s, turned.axis_mm)) if in_the_air(turned, at)]
    edges = [-np.inf, *cuts, np.inf]
    return [between(trial, number, start, stop) for number, (start, stop) in enumerate(pairwise(edges), start=1)]


def lifts(time_s: Array, place_mm: Array) -> list[float]:
    """When the tip rests highest between two cycles [s]; a cycle goes below 60 % of the travel, a lift above 25 %."""
    travel = (place_mm - place_mm.min()) / max(float(np.ptp(place_mm)), 1e-12)
    marks = np.flatnonzero((travel > DEEP) | (travel < UP))
    leaves = np.flatnonzero(np.diff((travel[marks] > DEEP).astype(int)))
    found = []
    for out, back in pairwise(leaves):
        if travel[marks[out]] > DEEP:
            up = np.arange(marks[out] + 1, marks[back] + 1)
            rest = up[travel[up] < travel[up].min() + AT_REST]
            found.append(float(time_s[rest[len(rest) // 2]]))
    return found


def in_the_air(trial: Trial, at_s: float) -> bool:
    """Whether force is at its lowest at a time: a tissue still pressed remembers the cycle before."""
    low_N, high_N = np.nanquantile(trial.force_N, [0.01, 0.99])
    near = int(np.argmin(np.abs(trial.force_s - at_s)))
    around_N = float(np.nanmedian(trial.force_N[max(near - 5, 0) : near + 6]))
    return bool(around_N < low_N + AIR_SHARE * (high_N - low_N) + 1e-12)


def between(trial: Trial, number: int, start_s: float, stop_s: float) -> Trial:
    """The part of a recording between two times."""
    force, axis = ((t >= start_s) & (t < stop_s) for t in (trial.force_s, trial.axis_s))
    part = replace(
        trial,
        name=trial.name if (start_s, stop_s) == (-np.inf, np.inf) else f"{trial.name}, cycle {number}",
        force_s=trial.force_s[force],
        force_N=trial.force_N[force],
        axis_s=trial.axis_s[axis],
        axis_mm=trial.axis_mm[axis],
        temperature_C=None if trial.temperature_C is None else trial.temperature_C[force],
    )
    if trial.marker_s is None or trial.marker_mm is None:
        return part
    seen = (trial.marker_s >= start_s) & (trial.marker_s < stop_s)
    return replace(part, marker_s=trial.marker_s[seen], marker_mm=trial.marker_mm[seen])
