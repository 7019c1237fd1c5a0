"""A reference as points joined by straight lines, played again and again, and what to ask for to be in time.

Two points at one time are a jump. What is known beforehand need not be late: a law whose axis takes ``preview_s`` to
follow is asked for what will be wanted then. A jump is never anticipated: a force that rises before it was asked
for is an error of the same size.
"""

from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Column = NDArray[np.float64]


class Line(NamedTuple):
    """Times from 0 on [s], forces [N] and how often they are played."""

    times_s: Sequence[float]
    forces_N: Sequence[float]
    repeats: int = 1

    @property
    def duration_s(self) -> float:
        """Of all repeats."""
        return self.times_s[-1] * self.repeats


def at(line: Line, elapsed_s: float) -> float:
    """The force at a time; after the end the last."""
    times, forces = line.times_s, line.forces_N
    elapsed_s -= min(int(elapsed_s / times[-1]), line.repeats - 1) * times[-1]
    k = min(max(bisect_right(times, elapsed_s) - 1, 0), len(times) - 2)
    start_s, end_s = times[k], times[k + 1]
    share = min(max((elapsed_s - start_s) / (end_s - start_s), 0.0), 1.0) if end_s > start_s else 1.0
    return forces[k] + share * (forces[k + 1] - forces[k])


def along(line: Line, elapsed_s: Column) -> Column:
    """``at`` for all times at once."""
    times, forces = np.array(line.times_s), np.array(line.forces_N)
    played = np.minimum((elapsed_s / times[-1]).astype(np.int64), line.repeats - 1)
    within_s = elapsed_s - played * times[-1]
    k = np.clip(np.searchsorted(times, within_s, side="right") - 1, 0, len(times) - 2)
    span_s = times[k + 1] - times[k]
    share = np.clip(np.divide(within_s - times[k], span_s, out=np.ones_like(within_s), where=span_s > 0), 0.0, 1.0)
    return np.asarray(forces[k] + share * (forces[k + 1] - forces[k]))


def preview(line: Line, preview_s: float) -> Line:
    """The line ``preview_s`` early between jumps; where one repeat joins the next without a jump, across the joint."""
    if preview_s <= 0:
        return line
    times, forces = np.array(line.times_s), np.array(line.forces_N)
    cuts = [0, *(k + 1 for k, (one, next_one) in enumerate(pairwise(times)) if one == next_one), len(times)]
    joined = line.repeats > 1 and bool(np.isclose(forces[0], forces[-1], atol=1e-9))
    found: list[tuple[Column, Column]] = []
    for begin, end in pairwise(cuts):
        known = times[begin:end], forces[begin:end]
        if joined and end == len(times):
            known = np.append(known[0], times[-1] + times[1 : cuts[1]]), np.append(known[1], forces[1 : cuts[1]])
        found.append(_early(known, float(times[begin]), float(times[end - 1]), preview_s))
    early_s, early_N = (np.concatenate(part) for part in zip(*found, strict=True))
    return Line(tuple(map(float, early_s)), tuple(map(float, early_N)), line.repeats)


def _early(known: tuple[Column, Column], begin_s: float, end_s: float, preview_s: float) -> tuple[Column, Column]:
    shifted = known[0] - preview_s
    inner = shifted[(shifted > begin_s) & (shifted < end_s)]
    times = np.concatenate([[begin_s], inner, [end_s]])
    return times, np.interp(times + preview_s, *known)
