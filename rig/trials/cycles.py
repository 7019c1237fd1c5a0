"""One trial as three aligned arrays, from whatever a recording holds: captured by the loop or imported from CSV."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.recording.reader import Recording
from rig.recording.tables import compression_N, force_map
from rig.trials.contact import FloatArray


@dataclass(frozen=True)
class IndentationCycle:
    """One trial on the force sensor's own time base; force is compressive but not yet zeroed.

    Arrays have shape (n,); ``speed_mm_s`` is the speed asked for, NaN where nobody said.
    """

    name: str
    speed_mm_s: float
    time_s: FloatArray
    force_N: FloatArray
    position_mm: FloatArray


def cycle_of(name: str, recording: Recording) -> IndentationCycle:
    """The trial in ``recording``, position interpolated to the capture times of force.

    Samples a device marked invalid are left out. Raises DataError where a stream is missing, empty, out of order or
    holds NaN, or where force and axis do not overlap in time.
    """
    force_ns, force_N = _column(name, recording, "force", f"{force_map(recording).channel}_N", compression_N)
    axis_ns, position_mm = _column(name, recording, "axis", "position_mm", _position_mm)
    inside = (force_ns >= axis_ns[0]) & (force_ns <= axis_ns[-1])
    if np.count_nonzero(inside) < 2:
        raise DataError(f"{name}: force and axis do not overlap in time; check the clocks of the two streams")
    force_ns, force_N = force_ns[inside], force_N[inside]
    start_ns = force_ns[0]
    return IndentationCycle(
        name=name,
        speed_mm_s=_nominal_speed(name, recording.metadata),
        time_s=(force_ns - start_ns) * 1e-9,
        force_N=force_N,
        position_mm=np.interp((force_ns - start_ns) * 1e-9, (axis_ns - start_ns) * 1e-9, position_mm),
    )


def _position_mm(recording: Recording) -> FloatArray:
    return recording.tables["axis"]["position_mm"].astype(float)


def _nominal_speed(name: str, metadata: Mapping[str, Mapping[str, str]]) -> float:
    text = metadata.get("trial", {}).get("speed_mm_s", "nan")
    try:
        return float(text)
    except ValueError as error:
        raise DataError(f"{name}: trial speed_mm_s is {text!r}; it must be a number in mm/s") from error


def _column(
    name: str, recording: Recording, stream: str, field: str, values_of: Callable[[Recording], FloatArray]
) -> tuple[NDArray[np.int64], FloatArray]:
    table = recording.tables.get(stream)
    if table is None or not len(table):
        raise DataError(f"{name}: no {stream} samples; a curve needs force and axis")
    sound = table["valid"] == 1
    if np.count_nonzero(sound) < 2:
        raise DataError(f"{name}: no valid {stream} samples; the device vouched for none")
    times_ns, values = table["capture_ns"][sound].astype(np.int64), values_of(recording)[sound]
    if np.any(np.diff(times_ns) < 0):
        raise DataError(f"{name}: {stream} times go backwards at sample {int(np.argmax(np.diff(times_ns) < 0)) + 1}")
    if not np.all(np.isfinite(values)):
        bad = ~np.isfinite(values)
        raise DataError(
            f"{name}: {stream} {field} is not a number in {np.count_nonzero(bad)} of {len(values)} samples, "
            f"first at sample {int(np.argmax(bad))}; mark or remove them"
        )
    return times_ns, values
