"""Jumps of the reference judged: error, overshoot and settling of each, and the worst of a run.

The force judged is the mean of SMOOTH_S around each sample, so that it is the tissue's load and not the sensor's noise.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from controller.loop.modes import Mode
from rig.errors import DataError
from rig.results.tracking import ComparedRun, Jump, StudyLevel, WorstJump
from rig.tissue.model import Model

Column = NDArray[np.float64]

# Eleven samples of 1 kHz have 0.3 of one sample's noise, and are a third of a turn of the fastest loop
# (30 Hz).
SMOOTH_S = 0.011
SETTLED_SHARE = 0.02  # the usual 2 % band of a settling time
# A third of the 1.5 s of a stair; four turns of the fastest loop without leaving the band.
STEADY_S = 0.5
REMAINS_S = 0.2
LEAST_JUMP_N = 0.2  # a fifth of the jumps compared (1 N), a hundred samples of the lead's 2 N/s


def compared_run(
    subject: str, jumps: Sequence[Jump], levels: Sequence[StudyLevel] = (), stopped: str = ""
) -> ComparedRun:
    """A run with the worst of its jumps."""
    settling = [jump.settling_s for jump in jumps]
    worst = WorstJump(
        error_N=max((abs(jump.error_N) for jump in jumps), default=None),
        error_percent=max((abs(jump.error_percent) for jump in jumps), default=None),
        largest_error_N=max((jump.largest_error_N for jump in jumps), default=None),
        overshoot_percent=max((jump.overshoot_percent for jump in jumps), default=None),
        settling_s=None if None in settling else max((found for found in settling if found is not None), default=None),
    )
    return ComparedRun(subject=subject, stopped=stopped, worst=worst, jumps=tuple(jumps), levels=tuple(levels))


def study_levels(jumps: Sequence[Jump], model: Model) -> tuple[StudyLevel, ...]:
    """The rows of the study's table: how far the tip is from where the force would be right is the error over k."""
    return tuple(
        StudyLevel(
            given_N=jump.to_N,
            actual_N=jump.actual_N,
            error_N=jump.error_N,
            error_percent=jump.error_percent,
            position_error_mm=jump.largest_error_N / model.tangent_N_mm(model.depth_mm(jump.to_N)),
        )
        for jump in jumps
    )


def jumps(time_s: Column, reference_N: Column, force_N: Column, mode: NDArray[np.int64]) -> tuple[Jump, ...]:
    """Every jump of the reference in contact, from columns of the loop stream; raises DataError where there is none."""
    on = mode == Mode.CONTACT
    time_s, reference_N, force_N = time_s[on], reference_N[on], force_N[on]
    edges = [int(at) + 1 for at in np.flatnonzero(np.abs(np.diff(reference_N)) > LEAST_JUMP_N)]
    if not edges:
        raise DataError("the recording has no jump of the reference force")
    half = round(SMOOTH_S / float(np.median(np.diff(time_s)))) // 2
    return tuple(
        _jump(
            time_s[start : end - half],
            float(reference_N[start - 1]),
            float(reference_N[start]),
            # Whole windows only, and none that reaches into what the next jump does.
            np.convolve(force_N[start - half : end], np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid"),
        )
        for start, end in pairwise([*edges, len(time_s)])
    )


def _jump(time_s: Column, from_N: float, to_N: float, force_N: Column) -> Jump:
    height_N, error_N = to_N - from_N, force_N - to_N
    outside = np.flatnonzero(np.abs(error_N) > SETTLED_SHARE * abs(height_N))
    settled = len(outside) == 0 or time_s[outside[-1]] < time_s[-1] - REMAINS_S
    steady = error_N[time_s > time_s[-1] - STEADY_S]
    return Jump(
        from_N=from_N,
        to_N=to_N,
        actual_N=to_N + float(np.mean(steady)),
        error_N=float(np.mean(steady)),
        error_percent=100 * float(np.mean(steady)) / to_N,
        largest_error_N=float(np.max(np.abs(steady))),
        overshoot_percent=100 * max(0.0, float(np.max(error_N * np.sign(height_N)))) / abs(height_N),
        settling_s=(float(time_s[outside[-1] + 1] - time_s[0]) if len(outside) else 0.0) if settled else None,
    )
