"""Data-quality gates, passed before any fit: what is wrong with the numbers themselves, in words."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rig.recording.converter import Array, at_the_end_of_range, ends_of_range, resolution
from rig.trials.streams import longest_repeat, sampling_of, sign_bit

UNREADABLE, BAD = "unreadable", "quality_bad"
# Kinds of finding for which a trial is left out before anything is computed.
TRIAL_LEFT_OUT = frozenset({UNREADABLE, BAD})
# Kinds of finding on what somebody states of a trial.
STATED = frozenset({"speed", "depth", "surface"})
# Kinds of finding for which samples are left out.
SAMPLES_LEFT_OUT = frozenset({"number", "clock", "late", "text"})
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
    """One finding a stream and kind, of the session one a text: the first, with how many recordings it was seen in."""
    groups: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in findings:
        groups.setdefault(
            (finding.stream, finding.kind, finding.text if finding.stream == "session" else ""), []
        ).append(finding)
    return tuple(replace(group[0], recordings=len(group)) for group in groups.values())


def inspect_stream(
    recording: str, stream: str, time_s: Array, value: Array, place: Array | None = None
) -> list[Finding]:
    """Findings of one stream: clock, gaps, jitter, constant, frozen, saturated, coarse, sign bit.

    ``place`` is where the tip was, where that is known; arrays have shape (n,).
    """
    if len(time_s) < 3:
        return [
            Finding(recording, stream, "missing", f"{stream} holds {len(time_s)} samples; nothing can be said of it")
        ]
    found = [*_numbers(time_s, value, may_hide=stream == "marker"), *_clock(time_s)]
    found += _values(time_s, value, place, may_rest=stream != "force")
    return [Finding(recording, stream, kind, f"{stream}: {text}") for kind, text in found]


def _numbers(time_s: Array, value: Array, may_hide: bool) -> list[tuple[str, str]]:
    """A marker that is hidden has no numbers, and no fault."""
    bad = ~np.isfinite(time_s) | (~np.isfinite(value) & (not may_hide))
    if not bad.any():
        return []
    count = int(np.count_nonzero(bad))
    return [("number", f"{count} of {len(bad)} samples hold no number, first sample {np.argmax(bad) + 1}; left out")]


def _clock(time_s: Array) -> list[tuple[str, str]]:
    clock, found = sampling_of(time_s), []
    if clock.lost:
        text = f"time stands still or runs backwards, first at sample {clock.first_lost}; "
        found.append(("clock", f"{text}{clock.lost} of {np.count_nonzero(np.isfinite(time_s))} samples left out"))
    if clock.gaps:
        rate_Hz, longest_ms = 1 / clock.period_s, 1e3 * clock.longest_s
        text = f"{clock.gaps} gap{'s' * (clock.gaps > 1)}, the longest {longest_ms:.0f} ms at {rate_Hz:.0f} Hz"
        found.append(("gap", text))
    if clock.scatter > JITTER:
        text = f"the period scatters by {100 * clock.scatter:.0f} % about {1e3 * clock.period_s:.2f} ms"
        found.append(("jitter", text))
    return found


def _values(time_s: Array, value: Array, place: Array | None, may_rest: bool) -> list[tuple[str, str]]:
    sound = np.isfinite(value)
    finite = value[sound]
    if finite.size < 3:
        return [("missing", "no finite value")]
    span = float(np.ptp(finite))
    if span == 0:
        return [("constant", f"constant at {finite[0]:g}: the stream carries nothing")]
    step = resolution(finite)
    found = _steps(finite, span, step)
    if may_rest:
        return found
    full = at_the_end_of_range(finite, None if place is None else place[sound])
    if full.any():
        ends = " and ".join(f"{end:g}" for end in ends_of_range(finite, full))
        text = f"{np.count_nonzero(full)} samples stand at the end of its range, {ends}; not judged there"
        found.append(("saturation", text))
    frozen_s = (longest_repeat(finite[~full]) - 1) * float(np.median(np.diff(time_s)))
    if frozen_s > FROZEN_S and span > COARSE_STEPS * step and np.mean(np.diff(finite) == 0) < 0.5:
        found.append(("frozen", f"the value does not change for {1e3 * frozen_s:.0f} ms"))
    return found


def _steps(value: Array, span: float, step: float) -> list[tuple[str, str]]:
    """What the steps of a converter say of it, in more samples than there are steps."""
    bit = sign_bit(value, step)
    if bit is not None:
        text = f"values jump by {step * 2**bit:g} as if their sign stood in bit {bit}"
        return [("sign_bit", f"{text}; say sign_bit = {bit} in the mapping")]
    if span < COARSE_STEPS * step and len(value) > COARSE_STEPS:
        return [("quantisation", f"only {span / step:.0f} steps of {step:g} over its range")]
    return []
