"""Trials kept in a file, the table of them, and the exact intervals of their rates."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from benchmarks.faults.fault import Fault, bound_s
from benchmarks.faults.trial import Trial
from rig.errors import UsageError
from rig.recording.files import write_text

LEVEL = 0.95
HEADER = f"{'fault':22}{'n':>4}{'noticed':>8}{'bound s':>9}{'median s':>10}{'max s':>8}{'peak N':>8}  by: end"


def read(file: Path | None) -> list[Trial]:
    """The trials in ``file``; raises UsageError where it holds something else."""
    if file is None or not file.exists():
        return []
    try:
        return [Trial(**one) for one in json.loads(file.read_text())["trials"]]
    except (KeyError, TypeError, ValueError) as error:
        raise UsageError(f"{file}: holds no trials of this campaign ({error}); give another file") from error


def write(file: Path | None, done: Sequence[Trial], date: str) -> None:
    """Keeps ``done``, and the day (ISO 8601) they were completed on."""
    if file:
        write_text(file, json.dumps({"date": date, "trials": [asdict(one) for one in done]}, indent=1) + "\n")


def line(fault: Fault, done: Sequence[Trial]) -> str:
    """One row: the bound of what may notice the fault, how soon it was noticed, and everything that is wrong."""
    times = [one.detected_s for one in done if one.detected_s is not None]
    middle, longest = (f"{np.median(times):.3f}", f"{max(times):.3f}") if times else ("--", "--")
    noticed = sum(not one.unnoticed for one in done)
    ends = ", ".join(sorted({f"{one.noticed_by or 'nobody'}: {one.end}" for one in done}))
    wrong = [f"UNNOTICED {one.unnoticed}" for one in done if one.unnoticed]
    wrong += [f"UNSAFE {one.unsafe}" for one in done if one.unsafe]
    return (
        f"{fault.name:22}{len(done):4}{noticed:8}{_bound(fault):>9}{middle:>10}{longest:>8}"
        f"{max(one.peak_N for one in done):8.2f}  {ends}" + "".join(f"\n{'':6}{text}" for text in dict.fromkeys(wrong))
    )


def _bound(fault: Fault) -> str:
    allowed = [bound_s(fault, code) for code in fault.expected]
    finite = [each for each in allowed if np.isfinite(each)]
    return f"{max(finite):g}" if finite else "--"


def interval(count: int, trials: int) -> tuple[float, float]:
    """Exact (Clopper-Pearson) interval of a rate, 95 %; 0 to 1 without trials."""
    if not trials:
        return 0.0, 1.0
    found = binomtest(count, trials).proportion_ci(LEVEL, "exact")
    return float(found.low), float(found.high)


def repeated(done: Sequence[Trial]) -> str:
    """Which faults took several runs: a stall of the computer ended the run before its fault, or before its notice."""
    again = [f"{one.fault} ({one.attempts})" for one in done if one.attempts > 1]
    return f"run more than once, for a stall: {', '.join(again) or 'none'}"


def rate(what: str, count: int, trials: int) -> str:
    """``count`` of ``trials`` and what that says of the rate."""
    low, high = interval(count, trials)
    return f"{count} of {trials} {what} ({100 * low:.1f} to {100 * high:.1f} %, 95 %, if all were alike)"
