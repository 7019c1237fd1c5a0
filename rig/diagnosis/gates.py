"""Data-quality gates, passed before any fit: what is wrong with the numbers themselves, in words."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FLAT_TOP_SAMPLES = 8
COARSE_STEPS = 64
FROZEN_S = 0.25
JITTER = 0.25


class Finding(NamedTuple):
    """One thing wrong with one stream: where first seen, what, in a sentence, in how many recordings."""

    recording: str
    stream: str
    kind: str
    text: str
    recordings: int = 1


def inspect_stream(recording: str, stream: str, time_s: Array, value: Array) -> list[Finding]:
    """Findings of one stream: clock, gaps, jitter, constant, frozen, saturated, coarse."""
    if len(time_s) < 3:
        return [
            Finding(recording, stream, "missing", f"{stream} holds {len(time_s)} samples; nothing can be said of it")
        ]
    found = [*_clock(time_s), *_values(time_s, value, may_rest=stream != "force")]
    return [Finding(recording, stream, kind, f"{stream}: {text}") for kind, text in found]


def _clock(time_s: Array) -> list[tuple[str, str]]:
    step = np.diff(time_s)
    period = float(np.median(step))
    found = []
    if np.any(step <= 0):
        backwards = np.count_nonzero(step <= 0)
        found.append(("clock", f"time stands still or runs backwards at {backwards} samples; these were left out"))
    if period <= 0:
        return found
    gaps = step > 5 * period
    if np.any(gaps):
        longest_ms = 1e3 * float(step.max())
        found.append(("gap", f"{np.count_nonzero(gaps)} gaps, the longest {longest_ms:.0f} ms at {1 / period:.0f} Hz"))
    spread = float(np.std(step[~gaps & (step > 0)], ddof=0)) / period
    if spread > JITTER:
        found.append(("jitter", f"the period scatters by {100 * spread:.0f} % about {1e3 * period:.2f} ms"))
    return found


def _values(time_s: Array, value: Array, may_rest: bool) -> list[tuple[str, str]]:
    finite = value[np.isfinite(value)]
    if finite.size < 3:
        return [("missing", "no finite value")]
    span = float(np.ptp(finite))
    if span == 0:
        return [("constant", f"constant at {finite[0]:g}: the stream carries nothing")]
    found = []
    top = finite >= finite.max() - 1e-9 * span
    longest = _longest_run(top)
    same = np.diff(finite) == 0
    quantum = float(np.min(np.abs(np.diff(finite))[~same])) if not same.all() else span
    if (
        not may_rest
        and longest >= FLAT_TOP_SAMPLES
        and longest > 4 * _longest_run(same & ~top[1:])
        and span > 20 * quantum
    ):
        found.append(("saturation", f"{longest} samples in a row stand at the largest value {finite.max():g}"))
    if span / max(quantum, 1e-300) < COARSE_STEPS:
        found.append(("quantisation", f"only {span / quantum:.0f} steps of {quantum:g} over its range"))
    frozen_s = _longest_run(same) * float(np.median(np.diff(time_s)))
    if not may_rest and frozen_s > FROZEN_S and span / quantum >= COARSE_STEPS and np.mean(same) < 0.5:
        found.append(("frozen", f"the value does not change for {1e3 * frozen_s:.0f} ms"))
    return found


def _longest_run(mark: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mark, [False]]).astype(np.int8)))
    return int((edges[1::2] - edges[::2]).max()) if edges.size else 0
