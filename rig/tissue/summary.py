"""The numbers of a study of tissue laws as results hold them; no science is loaded to read them."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from rig.config.table import Table
from rig.tissue.index_law import index_stiffness

NotNegative = Annotated[float, Field(ge=0)]


@dataclass(frozen=True)
class Skipped:
    """A trial that gave no curve, and the sentence that says why."""

    trial: str
    reason: str


@dataclass(frozen=True)
class SpeedSummary:
    """What was measured at one speed; depth and force are the largest of its trials."""

    speed_mm_s: float
    trials: int
    max_depth_mm: float
    max_force_N: float


@dataclass(frozen=True)
class Row:
    """One given force in the study's table: means over the trials that reached it, and the worst trial's error.

    ``error_percent`` is None where too little was measured for a percentage.
    """

    force_N: float
    measured_mm: float
    measured_spread_mm: float
    predicted_mm: float
    error_mm: float
    error_percent: float | None


@dataclass(frozen=True)
class RateTest:
    """Whether speeds differ: damping B with its interval over trials, against the study's 1.3 N s/mm.

    ``p_value`` is the share of shuffled speed labels that give as large a slope. ``effect_N`` is the force that B makes
    between slowest and fastest speed, ``study_effect_N`` what the study's B would; ``spread_N`` the scatter of trials.
    """

    damping_N_s_mm: float
    interval: tuple[float, float]
    p_value: float
    trials: int
    speeds_mm_s: tuple[float, ...]
    effect_N: float
    effect_interval_N: tuple[float, float]
    spread_N: float
    study_effect_N: float
    excludes_study: bool


class ControlRow(Table):
    """One force: the depth at rest, stiffness from contact (secant) and for a small move (tangent), and damping.

    The gain of a force loop is the tangent, not the secant that the study lists as K.
    """

    force_N: NotNegative
    depth_mm: NotNegative
    secant_N_mm: NotNegative
    tangent_N_mm: NotNegative
    tangent_low_N_mm: NotNegative
    tangent_high_N_mm: NotNegative
    damping_N_s_mm: NotNegative
    damping_low_N_s_mm: NotNegative
    damping_high_N_s_mm: NotNegative


@dataclass(frozen=True)
class KPoint:
    """One force of the study's table; ``k_loop_N_mm`` is None where the search was not run."""

    force_N: float
    depth_mm: float
    k_exact_N_mm: float
    k_loop_N_mm: float | None = None
    simulations: int = 0


@dataclass(frozen=True)
class IndexFit:
    """k(x) = a exp(b x) through the points (least squares on ln k), with Student's intervals."""

    a_N_mm: float
    b_per_mm: float
    a_interval: tuple[float, float]
    b_interval: tuple[float, float]
    r_squared: float

    def __call__(self, depth_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """k(x) in N/mm."""
        return index_stiffness(depth_mm, self.a_N_mm, self.b_per_mm)
