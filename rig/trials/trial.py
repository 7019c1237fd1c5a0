"""One trial as everything reads it: raw streams on one clock, compression positive, position into the tissue."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from rig.errors import DataError
from rig.recording.converter import Array
from rig.trials.findings import Finding, inspect_stream
from rig.trials.streams import in_order

# Of force and of axis: fewer are no cycle, at 10 Hz as little as two seconds.
FEWEST_SAMPLES = 20
# What a mapping calls the column of each stream that a trial needs.
MAPPED = {"force": "force", "axis": "position"}


@dataclass(frozen=True)
class Trial:
    """Raw streams of one recording on one clock [s]; force as sensed, no zero taken off.

    ``marker_mm`` has shape (frames, 3), NaN where the tool was hidden; ``temperature_C`` goes with ``force_s``;
    ``speed_mm_s`` of loading, ``depth_mm`` from the surface and ``surface_mm`` on the axis are as somebody stated or
    asked for them, NaN where nobody did; ``labels`` tell specimen, site, operator and the like; ``of_axis`` where it is
    of a drive axis alone, whose force is its effort.
    """

    name: str
    force_s: Array
    force_N: Array
    axis_s: Array
    axis_mm: Array
    marker_s: Array | None = None
    marker_mm: Array | None = None
    temperature_C: Array | None = None
    speed_mm_s: float = float("nan")
    depth_mm: float = float("nan")
    surface_mm: float = float("nan")
    labels: Mapping[str, str] = field(default_factory=dict)
    of_axis: bool = False


@dataclass(frozen=True)
class TrialSet:
    """Trials in the order they were made, the surface where somebody stated it, and what is to be said of the data.

    ``one_clock`` is false where each recording counted its own time, so that nobody knows when it was made.
    """

    name: str
    trials: tuple[Trial, ...]
    surface_mm: float | None = None
    findings: tuple[Finding, ...] = ()
    one_clock: bool = True


def inspect(trial: Trial) -> list[Finding]:
    """What is wrong with the numbers of a trial."""
    axis_s, axis_mm = drop_disordered(trial.axis_s, trial.axis_mm)
    place_mm = np.interp(trial.force_s, axis_s, axis_mm) if axis_s.size else None
    found = inspect_stream(trial.name, "force", trial.force_s, trial.force_N, place_mm)
    found += inspect_stream(trial.name, "axis", trial.axis_s, trial.axis_mm)
    if trial.marker_s is not None and trial.marker_mm is not None and len(trial.marker_s):
        found += inspect_stream(trial.name, "marker", trial.marker_s, trial.marker_mm[:, 0])
    return found


def inspected(trials: TrialSet) -> TrialSet:
    """The trials with what is wrong with the numbers of each among their findings."""
    found = (finding for trial in trials.trials for finding in inspect(trial))
    return replace(trials, findings=(*trials.findings, *found))


def drop_disordered(time_s: Array, *columns: Array) -> tuple[Array, ...]:
    """Rows with finite values whose time lies after every earlier one: a clock that steps back loses those rows."""
    finite = np.isfinite(time_s) & np.all([np.isfinite(c) for c in columns], axis=0)
    time_s, columns = time_s[finite], tuple(c[finite] for c in columns)
    if time_s.size == 0:
        return (time_s, *columns)
    keep = in_order(time_s)
    return (time_s[keep], *(c[keep] for c in columns))


def drop_unusable(trial: Trial) -> Trial:
    """The trial without what holds no number or comes out of order, cut to the time both force and axis cover.

    The marker is left as it is. Raises DataError where too little is left.
    """
    temperature = trial.temperature_C
    extra = () if temperature is None or not np.isfinite(temperature).all() else (temperature,)
    force = drop_disordered(trial.force_s, trial.force_N, *extra)
    axis = drop_disordered(trial.axis_s, trial.axis_mm)
    for name, raw, kept in (("force", trial.force_s, force[0]), ("axis", trial.axis_s, axis[0])):
        if not raw.size:
            said = f"no valid {name} samples; a trial needs force and axis"
            raise DataError(f"{trial.name}: {said}: name the column of its {MAPPED[name]} in the mapping")
        if kept.size < FEWEST_SAMPLES:
            raise DataError(
                f"{trial.name}: {kept.size} of {raw.size} samples of {name} are numbers at growing times "
                f"(limit {FEWEST_SAMPLES})"
            )
    inside = (force[0] >= axis[0][0]) & (force[0] <= axis[0][-1])
    if np.count_nonzero(inside) < FEWEST_SAMPLES:
        raise DataError(
            f"{trial.name}: force from {force[0][0]:g} to {force[0][-1]:g} s and axis from {axis[0][0]:g} to "
            f"{axis[0][-1]:g} s have no common time; check the clocks of the two streams"
        )
    return replace(
        trial, force_s=force[0][inside], force_N=force[1][inside], axis_s=axis[0], axis_mm=axis[1],
        temperature_C=force[2][inside] if extra else None,
    )  # fmt: skip
