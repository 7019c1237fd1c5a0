"""Few samples that look like all, for pictures."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rig.recording.converter import Array


def extremes(value: Array, points: int, share: Array | None = None) -> NDArray[np.intp]:
    """At most ``points`` samples that look like all: smallest and largest of each run of them, in order.

    Runs have as many samples each, or as much of what ``share`` grows by from sample to sample; each of shape (n,).
    """
    if len(value) <= points:
        return np.arange(len(value))
    cuts = np.linspace(0, len(value), points // 2 + 1).astype(int)
    if share is not None:
        cuts[:-1] = np.searchsorted(share, np.linspace(share[0], share[-1], len(cuts)))[:-1]
    runs = [(start, value[start:stop]) for start, stop in pairwise(cuts.tolist()) if stop > start]
    return np.array(
        [at for start, run in runs for at in sorted({start + int(run.argmin()), start + int(run.argmax())})]
    )
