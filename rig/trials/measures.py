"""What can be measured of how good a recording is; each is NaN where the recording does not show it."""

import json
import math

import numpy as np
from pydantic import ValidationError

from rig.config.products.registry import AXES, FORCE_SENSORS, TRACKERS, read
from rig.config.products.roles import ForceProduct
from rig.config.wiring import Loop
from rig.errors import DataError
from rig.recording.converter import at_the_end_of_range, run_lengths
from rig.recording.mcap_file import SUMMARY
from rig.recording.reader import Recording
from rig.recording.slope import TIP_TOOL, Slope
from rig.recording.tables import compression_N, force_map
from rig.trials.curves import Curve

CHANNELS = ("fx_N", "fy_N", "fz_N", "mx_N_m", "my_N_m", "mz_N_m")
# A sample later than one and a half periods has a lost one before it.
LATE_PERIODS = 1.5
COMPRESS, RETRACT = 3, 5
LEAST_AIR = 10  # a median of ten is known to 0.4 of a sample's deviation
# Samples further apart than a twentieth of the depth, and twice as far as usual, have a hole between them.
HOLE_SHARE = 0.05


def nominal_Hz(recording: Recording) -> dict[str, float]:
    """The rate that each stream was to have, where the recording's wiring says so."""
    wiring = recording.metadata.get("wiring", {})
    try:
        rates = {
            "force": read(FORCE_SENSORS, wiring["force"]).sampled_Hz,
            "axis": min(Loop.model_validate_json(wiring["loop"]).rate_Hz, read(AXES, wiring["axis"]).reports_Hz),
        }
        tracker = wiring.get("tracker", "null")
        return rates | ({} if tracker == "null" else {"marker": read(TRACKERS, tracker).rate_Hz})
    except (KeyError, ValidationError):
        return {}


def rate_lost(recording: Recording, stream: str, nominal_Hz: float) -> float:
    """Share of the nominal rate not achieved, 0 where there was more."""
    steps_ns = np.diff(np.sort(recording.tables[stream]["capture_ns"]))
    if not steps_ns.any():
        return 1.0
    rate_Hz = np.count_nonzero(steps_ns) / (float(steps_ns.sum()) * 1e-9)
    return max(0.0, 1.0 - rate_Hz / nominal_Hz)


def gap_ms(recording: Recording, stream: str) -> float:
    """Longest time between two samples, in excess of two of its periods: a slow sensor has no gaps by being slow."""
    taken_ns = recording.tables[stream]["capture_ns"]
    if len(taken_ns) < 3:
        return math.nan
    step_ns = np.diff(taken_ns)
    return float(max(step_ns.max() - 2 * np.median(step_ns), 0)) * 1e-6


def samples_lost(recording: Recording) -> float:
    """Share of force samples that never came, found no place in the ring, or that the sensor did not vouch for."""
    force = recording.tables["force"]
    if len(force) < 3:
        return math.nan
    step_ns = np.diff(force["capture_ns"])
    period_ns = float(np.median(step_ns))
    late = step_ns > LATE_PERIODS * period_ns
    missing = float(np.sum(np.round(step_ns[late] / period_ns) - 1)) + _dropped(recording)
    return (missing + float(np.count_nonzero(force["valid"] != 1))) / (len(force) + missing)


def _dropped(recording: Recording) -> float:
    try:
        return float(json.loads(recording.metadata.get(SUMMARY, {}).get("dropped", ""))["force"])
    except (ValueError, KeyError, TypeError):
        return 0.0


def wire_damage(recording: Recording) -> dict[str, float]:
    """By role, failed checksums and discarded bytes for each good message; empty where the loop did not say."""
    try:
        found = json.loads(recording.metadata.get(SUMMARY, {}).get("wire_damage", "{}"))
        return {str(role): float(share) for role, share in found.items()}
    except (ValueError, AttributeError, TypeError):
        return {}


def cycles_missed(recording: Recording) -> float:
    """Share of the loop's cycles that were not run."""
    numbers = recording.tables["loop"]["cycle"]
    if len(numbers) < 2:
        return math.nan
    return 1.0 - (len(numbers) - 1) / max(int(numbers[-1] - numbers[0]), 1)


def saturated(recording: Recording) -> float:
    """Share of force samples at the end of a range, where a full sensor stands at its largest or smallest value.

    Beyond the range that its maker states a sensor marks its samples as invalid; those count as lost.
    """
    force, axis = recording.tables["force"], recording.tables["axis"]
    read_N, axis = force[f"{force_map(recording).channel}_N"], axis[axis["valid"] != 0]
    if len(read_N) < 2:
        return math.nan
    sound = np.isfinite(read_N)
    start_ns = force["capture_ns"][0]
    at_ns, seen_ns = force["capture_ns"][sound] - start_ns, axis["capture_ns"] - start_ns
    place_mm = np.interp(at_ns, seen_ns, axis["position_mm"]) if len(axis) else None
    return float(np.mean(at_the_end_of_range(read_N[sound], place_mm)))


def frozen_samples(recording: Recording) -> float:
    """Longest run of force samples that are equal in all six channels."""
    rows = np.stack([recording.tables["force"][name] for name in CHANNELS], axis=1)
    if len(rows) < 2:
        return math.nan
    same = np.all(rows[1:] == rows[:-1], axis=1)
    return float(run_lengths(same).max(initial=0))


def dead_channels(recording: Recording) -> tuple[str, ...]:
    """Channels of force and torque whose reading never changes."""
    force = recording.tables["force"]
    measured = [name for name in CHANNELS if name.partition("_")[0] in _channels(recording)]
    return tuple(name for name in measured if len(force) > 1 and np.ptp(force[name]) == 0)


def _channels(recording: Recording) -> tuple[str, ...]:
    """Those that its sensor has; all where the product is not known."""
    try:
        return read(FORCE_SENSORS, recording.metadata["wiring"]["force"]).channels
    except (KeyError, ValidationError):
        return ForceProduct.channels


def tracker_lost(recording: Recording, nominal_Hz: float) -> float:
    """Share of the tip's frames that were not seen, or did not come within the time the axis was recorded."""
    marker, axis = recording.tables["marker"], recording.tables["axis"]
    tip = marker[marker["tool"] == TIP_TOOL]
    if len(axis) < 2:
        return math.nan
    due = float(axis["capture_ns"][-1] - axis["capture_ns"][0]) * 1e-9 * nominal_Hz
    return max(0.0, 1.0 - float(np.count_nonzero(tip["valid"] == 1)) / due) if due > 1 else math.nan


def tracker_jump_mm(recording: Recording, slope: Slope) -> float:
    """Largest step of the tip's marker from one frame to the next that the axis did not make."""
    marker, axis = recording.tables["marker"], recording.tables["axis"]
    tip = marker[(marker["tool"] == TIP_TOOL) & (marker["valid"] == 1)]
    start_ns = axis["capture_ns"][0]
    way_mm = np.diff(np.interp(tip["capture_ns"] - start_ns, axis["capture_ns"] - start_ns, axis["position_mm"]))
    steps_mm = np.diff(np.stack([tip[field] for field in ("x_mm", "y_mm", "z_mm")], axis=1), axis=0)
    own_mm = steps_mm - slope.slope * way_mm[:, None] * np.array(slope.direction)
    return float(np.linalg.norm(own_mm, axis=1).max(initial=0.0))


def zero_drift_N(recording: Recording) -> float:
    """Compressive force at rest in the air after the last step, less that of the first; by the loop's own steps."""
    loop, force = recording.tables["loop"], recording.tables["force"]
    steps = loop["step"]
    if not len(loop) or not (steps >= 0).any() or not (loop["mode"] == RETRACT).any():
        return math.nan
    after = int(steps.max())
    left = loop["capture_ns"][np.flatnonzero(loop["mode"] == RETRACT)[-1]]
    first, last = (loop["capture_ns"][steps == step] for step in (0, after))
    last = last[last > left]
    compression = compression_N(recording)
    rests = [(force["capture_ns"] >= at[0]) & (force["capture_ns"] <= at[-1]) for at in (first, last) if len(at)]
    if len(rests) < 2 or min(np.count_nonzero(rest) for rest in rests) < LEAST_AIR:
        return math.nan
    before_N, after_N = (float(np.median(compression[rest])) for rest in rests)
    return after_N - before_N


def depth_mm(recording: Recording, contact_mm: float) -> float:
    """Deepest position of the first compression and the rest after it, from ``contact_mm``."""
    loop, axis = recording.tables["loop"], recording.tables["axis"]
    step = loop["step"]
    pressing = loop["mode"] == COMPRESS
    if not pressing.any():
        return math.nan
    first = loop["capture_ns"][pressing & (step <= step[pressing][0] + 1)]
    inside = (axis["capture_ns"] >= first[0]) & (axis["capture_ns"] <= first[-1])
    return float(axis["position_mm"][inside].max()) - contact_mm if inside.any() else math.nan


def loading_lost(curve: Curve, reached_mm: float) -> float:
    """Share of the way from contact to the depth reached that the loading curve leaves out."""
    depth_mm = curve.depth_mm[curve.depth_mm > 0]
    if math.isnan(reached_mm):
        return math.nan
    if not len(depth_mm) or reached_mm <= 0:
        return 1.0
    steps = np.diff(np.concatenate([[0.0], depth_mm, [max(reached_mm, float(depth_mm[-1]))]]))
    hole_mm = max(HOLE_SHARE * reached_mm, 2 * float(np.median(steps)))
    return min(1.0, float(steps[steps > hole_mm].sum()) / reached_mm)


def asked_mm(recording: Recording) -> float:
    """The depth that was asked for; NaN where nobody said."""
    try:
        return float(recording.metadata.get("trial", {}).get("depth_mm", "nan"))
    except ValueError as error:
        raise DataError(f"{recording.path.stem}: trial depth_mm is no number") from error
