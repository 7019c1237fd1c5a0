"""The lattice whose springs stiffen each by itself, fitted to a session: a exp(b |strain|) in every spring."""

from dataclasses import dataclass, replace

import numpy as np

from rig.progress import Progress
from rig.tissue.fitting import fit_law
from rig.tissue.judging import Judged, judge
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.ramp import DepthRamp, ramp
from rig.tissue.lattice.springs import LARGEST_EXPONENT, Mode, Springs
from rig.tissue.lattice.symmetry import shaken
from rig.tissue.laws import FloatArray
from rig.tissue.laws_springs import springs_law
from rig.tissue.study import Study

DEPTHS = 10
CLOSER_TOGETHER = 1.5  # depths grow with this power: phi bends most where contact begins
AGREES = 0.01  # a tenth of the error these fits have
_SEED = 1


@dataclass(frozen=True)
class PerSpring:
    """The fit, made with a quarter of the block, and phi [mm] of the shaken whole block at the fitted b.

    ``whole_mm`` ends at the first depth where the whole block differs by more than 1 %.
    """

    ramp: DepthRamp
    judged: Judged
    depth_mm: FloatArray
    quarter_mm: FloatArray
    whole_mm: FloatArray

    @property
    def agrees_to_mm(self) -> float:
        """Deepest depth up to which the whole block answers as its quarter."""
        good = np.abs(self.whole_mm / self.quarter_mm[: len(self.whole_mm)] - 1.0) <= AGREES
        return float(self.depth_mm[np.argmin(good) - 1]) if not good.all() else float(self.depth_mm[len(good) - 1])

    def doubt(self) -> str | None:
        """What is wrong with the answer, in words, or None."""
        if self.ramp.inverted_cells:
            return (
                f"{self.ramp.inverted_cells} cells inverted on the way: the springs collapsed; use the stabilised mode"
            )
        if len(self.whole_mm) < len(self.depth_mm) or self.agrees_to_mm < self.depth_mm[-1]:
            return (
                f"the whole block agrees with its quarter to {self.agrees_to_mm:.3g} mm only; deeper it leaves the "
                "mirror symmetry, so do not use a and b beyond"
            )
        return None


def per_spring(study: Study, block: Block, mode: Mode, deepest_mm: float, tell: Progress) -> PerSpring:
    """Raise b from 0 past the best fit, fit a, b, B and offsets on the surface so made, and check with the whole block.

    ``tell(stage, share)`` is called as it goes; raises DataError where springs cannot follow the curves.
    """
    depth_mm = deepest_mm * (np.arange(1, DEPTHS + 1) / DEPTHS) ** CLOSER_TOGETHER
    springs = Springs.for_mode(mode)
    raised = ramp(
        block.as_quarter(),
        springs,
        depth_mm,
        study.judged[study.closest].law.elastic(depth_mm),
        lambda b: tell("springs that stiffen: b from 0", b / LARGEST_EXPONENT),
    )
    law = springs_law(raised)
    judged = judge(fit_law(law, study.curves), study.curves, study.force_N, study.origins_mm)
    b = float(judged.law.values[list(law.bounds).index("b")])
    quarter_mm = judged.law.elastic(depth_mm) / judged.law.values[0]
    whole_mm = _whole(block, replace(springs, b=b), depth_mm, quarter_mm, tell)
    return PerSpring(raised, judged, depth_mm, quarter_mm, whole_mm)


def _whole(block: Block, springs: Springs, depth_mm: FloatArray, quarter_mm: FloatArray, tell: Progress) -> FloatArray:
    found: list[float] = []
    states = shaken(block, springs, depth_mm.tolist(), np.random.default_rng(_SEED))
    for expected_mm, state in zip(quarter_mm, states, strict=False):
        found.append(state.reaction_N / springs.k_N_mm)
        tell("springs that stiffen: whole block", len(found) / len(depth_mm))
        if abs(found[-1] / expected_mm - 1.0) > AGREES:
            break
    return np.array(found)
