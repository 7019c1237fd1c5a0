"""Data-quality gates, passed before any fit: what is wrong with the numbers themselves, in words."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
UNREADABLE, BAD = "unreadable", "quality_bad"
# Kinds of finding for which a trial is left out before anything is computed.
TRIAL_LEFT_OUT = frozenset({UNREADABLE, BAD})
# Kinds of finding for which samples are left out.
SAMPLES_LEFT_OUT = frozenset({"number", "clock", "late", "text"})
FLAT_TOP_SAMPLES = 8  # a converter that is full repeats its last value; eight in a row are no noise
COARSE_STEPS = 64  # rounding is then 0.45 % of the range (rms)
FROZEN_S = 0.25  # longer than an adapter is late, shorter than a hold
JITTER = 0.25  # stamps anywhere within their period scatter by 0.29 of it


@dataclass(frozen=True)
class Finding:
    """One thing wrong with one stream: where first seen, what, in a sentence, in how many recordings."""

    recording: str
    stream: str
    kind: str
    text: str
    recordings: int = 1

    @property
    def sentence(self) -> str:
        """Recording, what, and in how many more."""
        others = f" (and in {self.recordings - 1} more)" if self.recordings > 1 else ""
        return f"data: {f'{self.recording} ' if self.recording else ''}{self.text}{others}"


def merge(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """One finding a stream and kind: the first, with the number of recordings it was seen in."""
    groups: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.stream, finding.kind), []).append(finding)
    return tuple(replace(group[0], recordings=len(group)) for group in groups.values())


def inspect_stream(recording: str, stream: str, time_s: Array, value: Array) -> list[Finding]:
    """Findings of one stream: clock, gaps, jitter, constant, frozen, saturated, coarse."""
    if len(time_s) < 3:
        return [
            Finding(recording, stream, "missing", f"{stream} holds {len(time_s)} samples; nothing can be said of it")
        ]
    found = [*_numbers(time_s, value, may_hide=stream == "marker"), *_clock(time_s)]
    found += _values(time_s, value, may_rest=stream != "force")
    return [Finding(recording, stream, kind, f"{stream}: {text}") for kind, text in found]


def _numbers(time_s: Array, value: Array, may_hide: bool) -> list[tuple[str, str]]:
    """A marker that is hidden has no numbers, and no fault."""
    bad = ~np.isfinite(time_s) | (~np.isfinite(value) & (not may_hide))
    if not bad.any():
        return []
    count = int(np.count_nonzero(bad))
    return [("number", f"{count} of {len(bad)} samples hold no number, first sample {np.argmax(bad) + 1}; left out")]


def in_order(time_s: Array) -> NDArray[np.bool_]:
    """Which of the finite times lie after every earlier one."""
    return np.concatenate([[True], time_s[1:] > np.maximum.accumulate(time_s)[:-1]]) if time_s.size else time_s > 0


def _clock(time_s: Array) -> list[tuple[str, str]]:
    time_s = time_s[np.isfinite(time_s)]
    if len(time_s) < 2:
        return []
    step = np.diff(time_s)
    period = float(np.median(step))
    found = []
    if np.any(step <= 0):
        lost, first = np.count_nonzero(~in_order(time_s)), int(np.argmax(step <= 0)) + 2
        text = f"time stands still or runs backwards, first at sample {first}; {lost} of {len(time_s)} samples left out"
        found.append(("clock", text))
    if period <= 0:
        return found
    gaps = step > 5 * period
    if np.any(gaps):
        longest_ms = 1e3 * float(step.max())
        count = int(np.count_nonzero(gaps))
        text = f"{count} gap{'s' * (count > 1)}, the longest {longest_ms:.0f} ms at {1 / period:.0f} Hz"
        found.append(("gap", text))
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
    same, quantum = np.diff(finite) == 0, _quantum(finite)
    clipped = 0 if may_rest else _longest_run(at_the_end_of_range(finite))
    if clipped:
        text = f"{clipped} samples in a row stand at the largest value {finite.max():g}; not judged there"
        found.append(("saturation", text))
    if span / max(quantum, 1e-300) < COARSE_STEPS:
        found.append(("quantisation", f"only {span / quantum:.0f} steps of {quantum:g} over its range"))
    frozen_s = _longest_run(same) * float(np.median(np.diff(time_s)))
    if not may_rest and frozen_s > FROZEN_S and span / quantum >= COARSE_STEPS and np.mean(same) < 0.5:
        found.append(("frozen", f"the value does not change for {1e3 * frozen_s:.0f} ms"))
    return found


def at_the_end_of_range(value: Array) -> NDArray[np.bool_]:
    """Which finite samples a full converter cut off: long runs of the largest value, where other values do not last."""
    span, same = float(np.ptp(value)), np.diff(value) == 0
    top = value >= value.max() - 1e-9 * span
    longest = _longest_run(top)
    clipped = (
        longest >= FLAT_TOP_SAMPLES and longest > 4 * _longest_run(same & ~top[1:]) and span > 20 * _quantum(value)
    )
    return np.asarray(top & clipped)


def _quantum(value: Array) -> float:
    """Smallest step between neighbours; the whole range where there is none."""
    steps = np.abs(np.diff(value))
    return float(np.min(steps[steps > 0])) if np.any(steps > 0) else float(np.ptp(value))


def run_lengths(mark: NDArray[np.bool_]) -> NDArray[np.int64]:
    """For each element the length of the run of marks it lies in, 0 where it is not marked; shape (n,)."""
    edges = np.flatnonzero(np.diff(mark.astype(np.int8), prepend=0, append=0))
    lengths = np.zeros(len(mark), np.int64)
    lengths[mark] = np.repeat(edges[1::2] - edges[::2], edges[1::2] - edges[::2])
    return lengths


def _longest_run(mark: NDArray[np.bool_]) -> int:
    return int(run_lengths(mark).max(initial=0))
