"""Trials made by a program of its own: but for ``along`` it shares no code with the laws and fits it tests.

The tip moves with finite acceleration on a grid of 0.1 ms; force is computed there, filtered, then sampled on the
sensor's own times, with noise, zero and steps of the converter.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.channels import AXIS, FORCE, LOOP, MARKER, AxisSample, ForceSample, LoopSample
from rig.recording.mcap_file import RecordingWriter
from rig.recording.reader import Recording
from rig.recording.sessions import SessionInfo, TrialInfo, write_session
from rig.tissue.history import History
from rig.tissue.laws import Law
from rig.trials.cycles import IndentationCycle

Column = NDArray[np.float64]
Force = Callable[[Column, Column], Column]
STEP_S = 1e-4
SPEEDS_MM_S = (5.0, 10.0, 15.0, 20.0, 30.0)


def index_force(a_N_mm: float = 0.12, b_per_mm: float = 0.22, damping_N_s_mm: float = 0.01) -> Force:
    """Tissue that stiffens as the study says."""

    def force(depth_mm: Column, rate_mm_s: Column) -> Column:
        inside = depth_mm > 0
        depth = np.where(inside, depth_mm, 0.0)
        total = np.where(inside, a_N_mm * depth * np.exp(b_per_mm * depth) + damping_N_s_mm * rate_mm_s, 0.0)
        return np.maximum(total, 0.0)

    return force


FOREARM = index_force()


def along(law: Law) -> Force:
    """Tissue that obeys a law with its memory, on the bench's own grid of time."""

    def force(depth_mm: Column, rate_mm_s: Column) -> Column:
        history = History.at(STEP_S * np.arange(len(depth_mm)))
        return np.maximum(law.force(depth_mm, rate_mm_s, history), 0.0)

    return force


def with_friction(level_N: float, force: Force = FOREARM) -> Force:
    """Tissue behind a guide with Coulomb friction: against the motion, and at rest as the last motion left it."""

    def total(depth_mm: Column, rate_mm_s: Column) -> Column:
        moving = np.abs(rate_mm_s) > 0.05
        last = np.maximum.accumulate(np.where(moving, np.arange(len(moving)), 0))
        return np.asarray(force(depth_mm, rate_mm_s) + level_N * np.sign(np.where(moving, rate_mm_s, 0.0)[last]))

    return total


@dataclass(frozen=True)
class Bench:
    """How a trial is made; the surface lies at ``surface_mm`` of the axis."""

    force: Force = FOREARM
    surface_mm: float = 20.0
    depth_mm: float = 8.0
    acceleration_mm_s2: float = 4000.0
    zero_N: float = 0.7
    noise_N: float = 0.01
    quantum_N: float = 0.001
    filter_s: float = 0.0005
    rate_Hz: float = 1000.0
    axis_rate_Hz: float = 1000.0
    clock_s: float = 0.0
    dither_mm: float = 0.0
    second_depth_mm: float = 0.0

    def cycle(self, speed_mm_s: float, seed: int = 0, nominal: bool = True) -> IndentationCycle:
        """One trial: rest, touch at 5 mm/s, back off 2 mm, press at the speed, hold, leave."""
        random = np.random.default_rng(seed)
        time_s, position_mm = self._path(speed_mm_s)
        rate_mm_s = np.gradient(position_mm, time_s)
        force_N = _low_pass(self.force(position_mm - self.surface_mm, rate_mm_s), self.filter_s)
        taken_s = np.arange(0.11, time_s[-1] - 0.11, 1 / self.rate_Hz) + random.uniform(0, 1 / self.rate_Hz)
        seen_s = np.arange(0.0, time_s[-1], 1 / self.axis_rate_Hz)
        measured_N = (
            np.interp(taken_s, time_s, force_N) + self.zero_N + self.noise_N * random.standard_normal(len(taken_s))
        )
        if self.quantum_N:
            measured_N = self.quantum_N * np.round(measured_N / self.quantum_N)
        return IndentationCycle(
            name=f"trial_{seed:03d}",
            speed_mm_s=speed_mm_s if nominal else float("nan"),
            time_s=taken_s - taken_s[0],
            force_N=measured_N,
            position_mm=np.interp(taken_s + self.clock_s, seen_s, np.interp(seen_s, time_s, position_mm)),
        )

    def cycles(self, trials: int = 3, speeds_mm_s: Sequence[float] = SPEEDS_MM_S) -> list[IndentationCycle]:
        """``trials`` cycles at each speed, with seeds of their own."""
        return [self.cycle(speed, 100 * int(speed) + trial) for speed in speeds_mm_s for trial in range(trials)]

    def _path(self, speed_mm_s: float) -> tuple[Column, Column]:
        start, top, deep = self.surface_mm - 5.0, self.surface_mm - 2.0, self.surface_mm + self.depth_mm
        parts: list[Column] = [
            _rest(start, 0.4),
            self._move(start, self.surface_mm + 0.3, 5.0),
            self._move(self.surface_mm + 0.3, top, 10.0),
            _rest(top, 0.05),
            self._move(top, deep, speed_mm_s),
            _rest(deep, 0.3),
        ]
        if self.dither_mm:
            phase = 2 * np.pi * 5.0 * np.arange(0, 0.4, STEP_S)
            parts.append(deep + self.dither_mm * np.sin(phase))
        if self.second_depth_mm:
            deeper = self.surface_mm + self.second_depth_mm
            parts += [self._move(deep, deeper, speed_mm_s), _rest(deeper, 0.3)]
            deep = deeper
        parts += [self._move(deep, start, 20.0), _rest(start, 0.2)]
        position_mm: Column = np.concatenate(parts)
        time_s: Column = np.linspace(0.0, STEP_S * (len(position_mm) - 1), len(position_mm))
        return time_s, position_mm

    def _move(self, start_mm: float, end_mm: float, speed_mm_s: float) -> Column:
        """A trapezoid of speed, or a triangle where the way is short."""
        way_mm = abs(end_mm - start_mm)
        speed_mm_s = min(speed_mm_s, float(np.sqrt(way_mm * self.acceleration_mm_s2)))
        ramp_s = speed_mm_s / self.acceleration_mm_s2
        cruise_s = way_mm / speed_mm_s - ramp_s
        time_s = np.arange(0, 2 * ramp_s + cruise_s, STEP_S)
        rate = np.interp(time_s, [0, ramp_s, ramp_s + cruise_s, 2 * ramp_s + cruise_s], [0, speed_mm_s, speed_mm_s, 0])
        gone_mm = np.cumsum(rate) * STEP_S
        return np.asarray(start_mm + np.sign(end_mm - start_mm) * gone_mm * way_mm / gone_mm[-1], float)


def _rest(position_mm: float, seconds: float) -> Column:
    return np.full(round(seconds / STEP_S), position_mm)


def _low_pass(values: Column, time_constant_s: float) -> Column:
    if not time_constant_s:
        return values
    kernel = np.exp(-np.arange(0, 10 * time_constant_s, STEP_S) / time_constant_s)
    return np.convolve(values, kernel / kernel.sum())[: len(values)]


START_NS = 50_000_000_000


def tables(cycle: IndentationCycle, sign: float = -1.0) -> dict[str, NDArray[np.void]]:
    """The streams a recorder would have kept of a cycle; force on fz, compression negative by default."""
    times_ns = START_NS + np.round(cycle.time_s * 1e9).astype(np.int64)
    force, axis, loop = (np.zeros(len(times_ns), stream.dtype) for stream in (FORCE, AXIS, LOOP))
    for table in (force, axis, loop):
        table["seq"], table["capture_ns"], table["arrival_ns"] = np.arange(len(times_ns)), times_ns, times_ns + 300_000
    force["fz_N"], force["valid"], force["temperature_C"] = sign * cycle.force_N, 1, 25.0
    axis["position_mm"], axis["valid"] = cycle.position_mm, 1
    ticks = np.arange(len(times_ns))
    loop["cycle"], loop["scheduled_ns"] = ticks, START_NS + 1_000_000 * ticks
    loop["wake_latency_ns"], loop["execution_ns"] = 20_000 + 1000 * (ticks % 50), 80_000 + 500 * (ticks % 40)
    loop["force_age_ns"], loop["axis_age_ns"], loop["marker_age_ns"] = 400_000, 900_000, (1 << 62)
    loop["force_N"], loop["reference_N"] = cycle.force_N, np.nan
    return {"force": force, "axis": axis, "loop": loop}


def metadata(cycle: IndentationCycle) -> dict[str, dict[str, str]]:
    """What a captured trial says of itself, as far as curves and report ask."""
    return {
        "recording": {"session": "made", "trial": cycle.name, "software": "tissue-rig 0.1.0"},
        "trial": {"speed_mm_s": repr(cycle.speed_mm_s), "depth_mm": "8.0"},
        "calibration": {"force_axis": "fz", "compression": "negative"},
        "devices": {"force": '{"product": "BFT-SENS", "serial": "000271", "firmware": "1.0.6"}'},
        "realtime": {"scheduler": "SCHED_FIFO 50", "memory": "locked"},
        "wiring": {"force": '{"port": "/dev/ttyUSB0"}'},
    }


def recording(cycle: IndentationCycle, path: Path = Path("trial.mcap")) -> Recording:
    """The trial as a reader would give it."""
    streams = tables(cycle) | {"marker": np.zeros(0, MARKER.dtype)}
    return Recording(path, metadata(cycle), streams, (), True, ())


def write_recording(
    path: Path, streams: dict[str, NDArray[np.void]], about: dict[str, dict[str, str]], finish: bool = True, **said: str
) -> None:
    """A real file with these streams; ``said`` goes into its summary."""
    writer = RecordingWriter(path, about)
    kinds = {"force": (FORCE, ForceSample), "axis": (AXIS, AxisSample), "loop": (LOOP, LoopSample)}
    for name, table in streams.items():
        stream, kind = kinds[name]
        for row in table.tolist():
            writer.add(stream.id, stream.pack(kind(*row)))
    writer.flush()
    if finish:
        writer.finish({"outcome": "complete"} | said)
    else:
        writer.close()


def write_made_session(folder: Path, cycles: Sequence[IndentationCycle], **about: Any) -> Path:
    """A session folder with one recording a cycle."""
    folder.mkdir(parents=True, exist_ok=True)
    for cycle in cycles:
        write_recording(folder / f"{cycle.name}.mcap", tables(cycle), metadata(cycle))
    trials = tuple(
        TrialInfo(s.name, f"{s.name}.mcap", s.speed_mm_s, 8.0, "complete", float(s.force_N.max()), {"force": 1}, {})
        for s in cycles
    )
    info = SessionInfo("made", "capture", "2026-01-02T10:00:00+00:00", "tissue-rig 0.1.0", trials=trials, **about)
    write_session(folder, info)
    return folder
