"""One session: a protocol with several sites, speeds and repeats, each from the air, and the streams devices wrote.

Everything is computed on a grid of half a millisecond; what is hidden acts at its stage, in the order of ``STAGES``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.forms.noise import Noise
from benchmarks.forms.tissue import Law

Array = NDArray[np.float64]
STEP_S = 5e-4
CORNER_S = 0.03  # corners of the motion are rounded over this: 10 mm/s turn with 330 mm/s2
PAUSE_S = 0.5  # between recordings
GRID_S = 0.004  # noise is stated for means over this, as a diagnosis at 250 Hz has it
Stage = Literal["tip", "surface", "softening", "memory", "guide", "sensor"]
STAGES: tuple[Stage, ...] = ("tip", "surface", "softening", "memory", "guide", "sensor")


class Signals(NamedTuple):
    """As far as the session has come; all of shape (steps, recordings), but ``site`` (recordings,)."""

    time_s: Array
    axis_mm: Array
    tip_mm: Array
    surface_mm: Array
    force_N: Array
    site: Array
    law: Law

    @property
    def depth_mm(self) -> Array:
        """Below the surface."""
        return self.tip_mm - self.surface_mm

    @property
    def tip_mm_s(self) -> Array:
        """The tip's speed."""
        return np.asarray(np.gradient(self.tip_mm, STEP_S, axis=0))


@dataclass(frozen=True)
class Part:
    """One thing hidden: its act gives the signal of its stage as it leaves (tip, surface, else force).

    ``names`` are those of docs/reference/causes.md that are true of it; none: it is outside of the library. ``sizes``
    are known numbers, by their names there. ``late_s`` and ``tracker_late_s`` are of time stamps.
    """

    name: str
    names: frozenset[str] = frozenset()
    stage: Stage = "sensor"
    act: Callable[[Signals], Array] = lambda signals: signals.force_N
    sizes: Mapping[str, float] = field(default_factory=dict)
    late_s: float = 0.0
    tracker_late_s: float = 0.0


@dataclass(frozen=True)
class Bench:
    """A session's circumstances. ``way`` arrays have one value a recording: speed, depth, hold, site."""

    law: Law
    surface_mm: float
    clearance_mm: float
    retract_mm_s: float
    dwell_s: float
    speeds_mm_s: Array
    depths_mm: Array
    holds_s: Array
    site: Array
    site_gain: Array
    site_mm: Array
    gain_sd: float
    touch_sd_mm: float
    rate_Hz: float
    tracker_Hz: float
    noise: Noise
    noise_N: float
    step_N: float
    zero_N: float


@dataclass(frozen=True)
class Recording:
    """What the devices wrote of one stroke; the marker has shape (frames, 3), and none where there is no tracker."""

    force_s: Array
    force_N: Array
    axis_s: Array
    axis_mm: Array
    marker_s: Array
    marker_mm: Array
    speed_mm_s: float


class Session(NamedTuple):
    """The recordings and how large their noise is [N]: rms of means over ``GRID_S``."""

    recordings: tuple[Recording, ...]
    noise_N: float


def record(bench: Bench, parts: Sequence[Part], rng: np.random.Generator) -> Session:
    """The session with all parts in it."""
    signals, lasts_s = _motion(bench)
    at = bench.site.astype(np.int64)
    gain = bench.site_gain[at] * np.exp(rng.normal(0, bench.gain_sd, len(bench.site)))
    touch_mm = bench.surface_mm + bench.site_mm[at] + rng.normal(0, bench.touch_sd_mm, len(bench.site))
    signals = signals._replace(surface_mm=signals.surface_mm + touch_mm)
    signals = run(signals, parts, gain)
    return _written(bench, signals, lasts_s, parts, rng)


def run(signals: Signals, parts: Sequence[Part], gain: Array) -> Signals:
    """Every part at its stage; the tissue answers once tip and surface are known, and pushes only."""
    for stage in STAGES:
        if stage == "softening":
            signals = signals._replace(force_N=gain * signals.law(np.maximum(signals.depth_mm, 0.0)))
        if stage == "guide":
            inside = np.where(signals.depth_mm > 0, np.maximum(signals.force_N, 0.0), 0.0)
            signals = signals._replace(force_N=inside)
        for part in (part for part in parts if part.stage == stage):
            now = part.act(signals)
            if stage == "tip":
                signals = signals._replace(tip_mm=now)
            elif stage == "surface":
                signals = signals._replace(surface_mm=now)
            else:
                signals = signals._replace(force_N=now)
    return signals


def _motion(bench: Bench) -> tuple[Signals, Array]:
    """The axis' way, which is the tip's until something is hidden, and how long each recording lasts [s]."""
    top = bench.surface_mm - bench.clearance_mm
    ways = []
    for speed, depth, hold, at in zip(bench.speeds_mm_s, bench.depths_mm, bench.holds_s, bench.site, strict=True):
        way = bench.clearance_mm + depth + bench.site_mm[int(at)]
        lasts = [bench.dwell_s, way / speed, hold, way / bench.retract_mm_s, bench.dwell_s]
        ways.append((np.cumsum([0.0, *lasts]), [top, top, top + way, top + way, top, top]))
    lasts_s = np.array([corners[-1] for corners, _ in ways])
    within_s = np.arange(int(lasts_s.max() / STEP_S)) * STEP_S
    axis_mm = np.stack([_rounded(np.interp(within_s, *way)) for way in ways], axis=1)
    begin_s = np.concatenate([[0.0], np.cumsum(lasts_s[:-1] + PAUSE_S)])
    time_s = begin_s + within_s[:, None]
    zero = np.zeros_like(axis_mm)
    return Signals(time_s, axis_mm, axis_mm, zero, zero, bench.site, bench.law), lasts_s


def _rounded(way_mm: Array) -> Array:
    """Corners rounded by a raised cosine, later by half of it as a motor is."""
    kernel = np.hanning(int(CORNER_S / STEP_S) + 2)[1:-1]
    padded = np.concatenate([np.full(len(kernel) - 1, way_mm[0]), way_mm])
    return np.convolve(padded, kernel / kernel.sum(), mode="valid")


def _written(
    bench: Bench, signals: Signals, lasts_s: Array, parts: Sequence[Part], rng: np.random.Generator
) -> Session:
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    late_s, tracker_late_s = sum(part.late_s for part in parts), sum(part.tracker_late_s for part in parts)
    recordings, errors = [], []
    for k, lasts in enumerate(lasts_s):
        time_s = signals.time_s[:, k]
        stamps = np.arange(time_s[0], time_s[0] + lasts - 2 * STEP_S, 1 / bench.rate_Hz)
        clean_N = np.interp(stamps, time_s, signals.force_N[:, k]) + bench.zero_N
        reading_N = _rounded_to(bench.step_N, clean_N + bench.noise(rng, len(stamps), bench.noise_N))
        kept = np.isfinite(reading_N)
        errors.append(_windows((reading_N - clean_N)[kept], bench.rate_Hz))
        frames = np.arange(stamps[0], stamps[-1], 1 / bench.tracker_Hz) if bench.tracker_Hz else np.empty(0)
        along = np.interp(frames - tracker_late_s, time_s, signals.tip_mm[:, k])
        marker_mm = along[:, None] * direction + rng.normal(0, 0.05, (len(frames), 3))
        axis_mm = _rounded_to(0.0005, np.interp(stamps, time_s, signals.axis_mm[:, k]))
        recordings.append(
            Recording(
                (stamps + late_s)[kept], reading_N[kept], stamps, axis_mm, frames, marker_mm, bench.speeds_mm_s[k]
            )
        )
    return Session(tuple(recordings), float(np.sqrt(np.mean(np.concatenate(errors) ** 2))))


def _rounded_to(step: float, value: Array) -> Array:
    return np.asarray(np.round(value / step) * step)


def _windows(error_N: Array, rate_Hz: float) -> Array:
    """Means over ``GRID_S``, shape (windows,)."""
    each = max(1, round(GRID_S * rate_Hz))
    return np.asarray(error_N[: len(error_N) // each * each].reshape(-1, each).mean(axis=1))
