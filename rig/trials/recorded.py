"""One trial from its recording, as the devices vouch for it."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.recording.converter import Array
from rig.recording.reader import Recording
from rig.recording.slope import TIP_TOOL
from rig.recording.tables import compression_N
from rig.trials.chosen import labels_of
from rig.trials.findings import Finding
from rig.trials.trial import Trial

NS = 1e-9
# A drive that is asked half a millisecond late has gone 15 um at 30 mm/s, a tenth of what contact is known to.
LATE_NS = 500_000
MOST_LATE = 0.01  # one left out in a hundred leaves a hole of one period, which interpolation bridges


def trial_of(name: str, recording: Recording) -> Trial:
    """The trial in a recording, samples the devices vouch for, on a clock that starts with it.

    The tip is tool 0 of the tracker. Raises DataError where the metadata do not say what was recorded.
    """
    force, axis, marker = (recording.tables[stream] for stream in ("force", "axis", "marker"))
    sound, moving = force["valid"] != 0, (axis["valid"] != 0) & in_time(axis["capture_ns"], axis["arrival_ns"])
    seen = (marker["tool"] == TIP_TOOL) & (marker["valid"] != 0)
    facts, notes = recording.metadata.get("trial", {}), recording.metadata.get("notes", {})
    start = start_ns(recording)
    stated_C = _number(name, "temperature_C", facts if "temperature_C" in facts else notes)
    return Trial(
        name, (force["capture_ns"][sound] - start) * NS, compression_N(recording)[sound],
        (axis["capture_ns"][moving] - start) * NS, axis["position_mm"][moving],
        (marker["capture_ns"][seen] - start) * NS,
        np.stack([marker[field][seen] for field in ("x_mm", "y_mm", "z_mm")], axis=1),
        _temperature(force["temperature_C"][sound], stated_C), _number(name, "speed_mm_s", facts),
        _number(name, "depth_mm", facts), _number(name, "surface_mm", recording.metadata.get("calibration", {})),
        labels_of(recording.metadata), "axis_files" in recording.metadata.get("recording", {}),
    )  # fmt: skip


def _temperature(measured_C: Array, stated_C: float) -> Array | None:
    """At each force sample: as measured, else as stated."""
    found = measured_C if np.isfinite(measured_C).all() else np.full(measured_C.shape, stated_C)
    return found if found.size and np.isfinite(found).all() else None


def start_ns(recording: Recording) -> int:
    """When force was first sensed; 0 where it never was."""
    force = recording.tables["force"]
    return int(force["capture_ns"][0]) if len(force) else 0


def shifted(trial: Trial, by_ns: int) -> Trial:
    """The trial on a clock that started ``by_ns`` earlier; its times are whole nanoseconds, and stay so."""
    force_s, axis_s = (_later(at_s, by_ns) for at_s in (trial.force_s, trial.axis_s))
    marker_s = None if trial.marker_s is None else _later(trial.marker_s, by_ns)
    return replace(trial, force_s=force_s, axis_s=axis_s, marker_s=marker_s)


def _later(at_s: Array, by_ns: int) -> Array:
    return np.asarray((np.rint(at_s / NS) + by_ns) * NS)


def _number(name: str, key: str, facts: Mapping[str, str]) -> float:
    text = facts.get(key, "")
    try:
        return float(text or "nan")
    except ValueError as error:
        raise DataError(f"{name}: {key} is {text!r}; it must be a number") from error


def late(name: str, axis: Mapping[str, Array] | NDArray[np.void]) -> list[Finding]:
    """What to say of an axis whose samples came late; nothing below 1 %."""
    share = 1 - float(np.mean(in_time(axis["capture_ns"], axis["arrival_ns"]))) if len(axis["capture_ns"]) else 0.0
    text = f"axis: {100 * share:.0f} % of the samples came more than 0.5 ms later than usual; these were left out"
    return [Finding(name, "axis", "late", text)] if share > MOST_LATE else []


def in_time(capture_ns: NDArray[np.int64] | Array, arrival_ns: NDArray[np.int64] | Array) -> NDArray[np.bool_]:
    """Samples that came no later than usual, within 0.5 ms.

    A drive that is asked late tells where it is then, under the time it should have been asked; at the ends of a dither
    that is always further back, and would pass for stiffer tissue there.
    """
    taken_ns = arrival_ns - capture_ns
    return np.asarray(taken_ns < np.median(taken_ns) + LATE_NS) if len(taken_ns) else np.zeros(0, bool)
