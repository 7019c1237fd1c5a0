"""A linear motor's magnets, whose force along the axis shows in the air as in the tissue."""

from collections.abc import Sequence

import numpy as np

from rig.diagnosis.effects.bench import FEWEST_PERIODS, PITCHES_PER_MM, pair, ripple_tries
from rig.diagnosis.effects.scan import peaks
from rig.diagnosis.problem import Array, Effect, InverseProblem, Par, Values
from rig.simulation.chain import Operator, Series, Tip
from rig.tissue.index_law import Fields


def _cogging_starts(problem: InverseProblem, values: Values, residual: Array) -> Sequence[Values]:
    position = problem.variables()["depth"]
    left = np.where(problem.blind(values), 0.0, residual)
    grid = PITCHES_PER_MM[1 / max(np.ptp(position) / FEWEST_PERIODS, 0.5) <= PITCHES_PER_MM]
    return [{"cogging_pitch_mm": 1 / f} for f in peaks(position, left, float(len(left)), grid)]


def _cogging(tip: Tip, force_N: Series, v: Fields) -> Series:
    turn = 2 * np.pi * tip.drive.position_mm / v["cogging_pitch_mm"]
    waves = ("cogging", turn), ("cogging_harmonic", 2 * turn)
    return sum((v[f"{of}_sin_N"] * np.sin(at) + v[f"{of}_cos_N"] * np.cos(at) for of, at in waves), force_N)


COGGING = Effect(
    "cogging",
    "the axis pulls by itself: a force of {amplitude:.3g} N repeats every {cogging_pitch_mm:.3g} mm, in the air too",
    pair("cogging", "N", "force along the axis", 0.005) + pair("cogging_harmonic", "N", "at half its period", 0.005),
    (Par("cogging_pitch_mm", "mm", 2.0, 0.2, 20.0, 0.02, meaning="period along the axis"),),
    _cogging_starts, ripple_tries, operator=Operator("guide", _cogging), needs=frozenset({"air"}),
    repair="put the sensor at the tip, or subtract the force measured along the axis in the air",
)  # fmt: skip
