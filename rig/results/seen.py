"""From a recording to the numbers of its streams, of which nothing is kept whole."""

import contextlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.errors import DataError
from rig.recording.alignment import Alignment, read_alignments
from rig.recording.converter import Array, at_the_end_of_range, ends_of_range, resolution
from rig.recording.mcap_file import SUMMARY
from rig.recording.reader import Recording
from rig.recording.slope import TIP_TOOL
from rig.recording.tables import compression_N
from rig.results.came_in import StreamIn
from rig.results.came_in_trace import RecordingTrace, trace_of
from rig.results.inputs_in import ChannelIn, channels_in
from rig.trials.streams import longest_repeat, sample_noise, sampling_of

UNITS = {"force": "N", "axis": "mm", "marker": "mm"}
# A pulse and breathing are slower than a fifth of a second, so that a straight line takes them off.
REST_S, FEWEST_AT_REST = 0.2, 10
# Eight micrometres of a stroke of 8 mm: on 1 N/mm that is the noise of a good sensor.
REST_SHARE, SPREADS = 1e-3, 6.0


class Rests(NamedTuple):
    """Stretches in which the axis stood still: where it did, and the deviation of the stream's samples; each (n,)."""

    position_mm: Array
    deviation: Array


@dataclass(frozen=True)
class Seen:
    """Numbers of the streams of a recording, where each of them was at rest, and how their clocks lie."""

    streams: tuple[StreamIn, ...]
    inputs: tuple[StreamIn, ...]
    rests: tuple[Rests, ...]
    one_clock: bool
    alignments: Mapping[str, Alignment]
    tracks_force: bool
    trace: RecordingTrace


def see(recording: Recording) -> Seen:
    """What is known of the recording's streams by themselves; raises DataError where it does not say its force."""
    raw, left_out = list(_raw(recording)), _left_out(recording)
    axis = next((one for one in raw if one.name == "axis"), None)
    force = next((one for one in raw if one.name == "force"), None)
    rests = [_rests(one, axis) for one in raw]
    drawn = _drawn(force, axis)
    place_mm = drawn[2] if np.isfinite(drawn[2]).any() else None
    full = np.zeros(0, bool) if force is None else at_the_end_of_range(drawn[1], place_mm)
    return Seen(
        streams=tuple(_numbers(*one, left_out.get(one[0].name, 0), full) for one in zip(raw, rests, strict=True)),
        inputs=tuple(_numbers(one, Rests(np.zeros(0), np.zeros(0)), 0, full) for one in channels_in(recording)),
        rests=tuple(rests), one_clock=all(np.array_equal(raw[0].time_s, other.time_s) for other in raw[1:]),
        alignments=_alignments(recording), tracks_force=recording.tracks_force,
        trace=trace_of(*drawn, full if len(full) else np.zeros(len(drawn[0]), bool)),
    )  # fmt: skip


def _raw(recording: Recording) -> Iterator[ChannelIn]:
    marker = recording.tables["marker"]
    tip = marker["tool"] == TIP_TOOL
    tables = {**recording.tables, "marker": marker if tip.all() else marker[tip]}
    start_ns = min((int(tables[name]["capture_ns"][0]) for name in UNITS if len(tables[name])), default=0)
    for name, unit in UNITS.items():
        rows = tables[name]
        if len(rows):
            value = _value(recording, name, rows)
            sound = rows["valid"] != 0
            for column in value.reshape(len(rows), -1).T:
                sound &= np.isfinite(column)
            yield ChannelIn(name, (rows["capture_ns"] - start_ns) * 1e-9, value, sound, unit)


def _value(recording: Recording, name: str, rows: NDArray[np.void]) -> Array:
    if name == "marker":
        return np.stack([rows[field] for field in ("x_mm", "y_mm", "z_mm")], axis=1)
    return compression_N(recording) if name == "force" else rows["position_mm"]


def _left_out(recording: Recording) -> dict[str, int]:
    """Rows by stream that the import left out, as it noted them."""
    try:
        found = json.loads(recording.metadata.get(SUMMARY, {}).get("left_out", "{}"))
    except ValueError:
        return {}
    return {str(name): int(count) for name, count in found.items()} if isinstance(found, dict) else {}


def _alignments(recording: Recording) -> dict[str, Alignment]:
    """As they were noted; none where the note cannot be read, of which no later step makes use."""
    with contextlib.suppress(DataError):
        return read_alignments(recording.metadata)
    return {}


def _rests(raw: ChannelIn, axis: ChannelIn | None) -> Rests:
    """Deviation about a straight line of each fifth of a second in which the axis goes nowhere."""
    nothing = Rests(np.zeros(0), np.zeros(0))
    time_s, value = raw.time_s[raw.sound], raw.value[raw.sound].reshape(np.count_nonzero(raw.sound), -1)
    if axis is None or np.count_nonzero(axis.sound) < 2 or len(time_s) < 2:
        return nothing
    count = max(FEWEST_AT_REST, round(REST_S / max(float(np.median(np.diff(time_s))), 1e-9)))
    pieces = len(time_s) // count
    if not pieces:
        return nothing
    place_mm = axis.value[axis.sound]
    there_mm = np.interp(time_s[: pieces * count].reshape(pieces, count), axis.time_s[axis.sound], place_mm)
    still_mm = REST_SHARE * float(np.ptp(place_mm)) + SPREADS * sample_noise(place_mm)
    still = np.ptp(there_mm, axis=1) <= still_mm
    parts = value[: pieces * count].reshape(pieces, count, -1)[still]
    return Rests(there_mm[still].mean(axis=1), _about_lines(parts).max(axis=1, initial=0.0))


def _about_lines(parts: Array) -> Array:
    """Standard deviation of each part (m, n, k) about its line of least squares over the middle axis, (m, k)."""
    count = parts.shape[1]
    at = np.arange(count) - (count - 1) / 2
    centred = parts - parts.mean(axis=1, keepdims=True)
    slope = np.einsum("n,mnk->mk", at, centred) / (at @ at)
    return np.asarray(np.sqrt(np.maximum((centred**2).sum(axis=1) - slope**2 * (at @ at), 0.0) / (count - 2)))


def _drawn(force: ChannelIn | None, axis: ChannelIn | None) -> tuple[Array, Array, Array]:
    """Times, force and place at them, each (n,): at those of force, where there is one; NaN where nobody knows."""
    lead, nowhere = force or axis, np.zeros(0)
    time_s = nowhere if lead is None else lead.time_s[lead.sound]
    place_mm = np.full(len(time_s), np.nan)
    if axis is not None and axis.sound.any():
        place_mm = np.interp(time_s, axis.time_s[axis.sound], axis.value[axis.sound])
    return time_s, np.full(len(time_s), np.nan) if force is None else force.value[force.sound], place_mm


def _numbers(raw: ChannelIn, rests: Rests, left_out: int, of_force: NDArray[np.bool_]) -> StreamIn:
    time_s, value = raw.time_s[raw.sound], raw.value[raw.sound]
    clock, columns = sampling_of(time_s), np.atleast_2d(value.T)
    full = of_force if raw.name == "force" else np.zeros(len(value), bool)
    at_rest = len(rests.deviation) > 0
    return StreamIn(
        stream=raw.name, unit=raw.unit, samples=len(time_s), missing=len(raw.time_s) - len(time_s),
        left_out=left_out, span_s=float(np.ptp(time_s)) if len(time_s) else 0.0, rate_Hz=1 / clock.period_s,
        lowest_rate_Hz=1 / clock.longest_s, gaps=clock.gaps, longest_gap_s=clock.longest_s if clock.gaps else None,
        lost=clock.lost, lowest=float(value.min(initial=np.inf)), highest=float(value.max(initial=-np.inf)),
        noise=float(np.median(rests.deviation)) if at_rest else max(map(sample_noise, columns), default=np.nan),
        noise_from="rest" if at_rest else "differences" if len(time_s) else "",
        resolution=max(map(resolution, columns), default=0.0) or None,
        saturated=float(np.mean(full)) if len(full) else 0.0, saturated_at=ends_of_range(value, full),
        longest_repeat=longest_repeat(columns[0]) if len(columns) else 0,
    )  # fmt: skip
