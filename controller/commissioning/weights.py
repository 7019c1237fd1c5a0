"""Known weights: what a person writes, as newtons in compression, with what nobody knows of them."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from rig.errors import UsageError

# CGPM 1901. On the earth's surface gravity is 9.780 to 9.832 m/s2 (WGS 84): where the place is not given, a mass is
# a force within half of that, taken as a rectangular distribution.
STANDARD_GRAVITY_M_S2 = 9.80665
GRAVITY_HALF_WIDTH = 0.026 / STANDARD_GRAVITY_M_S2
KG_PER_UNIT = {"g": 1e-3, "kg": 1.0}
WEIGHT = re.compile(r"\s*([0-9.eE+-]+)\s*(g|kg|N)\s*")
# Two loads and the unloaded sensor: the fewest that tell a bent characteristic from a straight one.
FEWEST = 2


@dataclass(frozen=True)
class Weights:
    """Loads [N] from the lightest up, positive in compression, and their relative standard uncertainty."""

    loads_N: tuple[float, ...]
    uncertainty: float

    @property
    def sequence_N(self) -> tuple[float, ...]:
        """Unloaded, up, down again, unloaded: what differs between up and down is seen."""
        return 0.0, *self.loads_N, *self.loads_N[-2::-1], 0.0


def parse_weights(text: str, hung: bool, tolerance: float, limit_N: float, gravity_m_s2: float | None) -> Weights:
    """Weights written as ``100 g, 0.2 kg, 5 N``; raises UsageError where they do not fit, naming the bound.

    ``hung`` weights pull; ``tolerance`` is the relative bound on each, ``limit_N`` the most that may be applied.
    """
    found = [_newtons(word, gravity_m_s2 or STANDARD_GRAVITY_M_S2) for word in text.split(",")]
    _refuse(found, limit_N)
    masses = gravity_m_s2 is None and "g" in text
    return Weights(
        tuple((-force_N if hung else force_N) for force_N in sorted(found)), uncertainty_of(tolerance, masses)
    )


def uncertainty_of(tolerance: float, masses_without_place: bool = False) -> float:
    """Relative standard uncertainty of weights within ``tolerance`` (rectangular; GUM 4.3.7)."""
    return math.hypot(tolerance, GRAVITY_HALF_WIDTH if masses_without_place else 0.0) / math.sqrt(3)


def _newtons(word: str, gravity_m_s2: float) -> float:
    match = WEIGHT.fullmatch(word)
    try:
        number, unit = (float(match[1]), match[2]) if match else (math.nan, "")
    except ValueError:
        number, unit = math.nan, ""
    if not math.isfinite(number):
        raise UsageError(f"--weights: {word.strip()!r} is no weight; write numbers with g, kg or N, as in '100 g,5 N'")
    return number * KG_PER_UNIT[unit] * gravity_m_s2 if unit in KG_PER_UNIT else number


def _refuse(found_N: Sequence[float], limit_N: float) -> None:
    if min(found_N) <= 0:
        raise UsageError(f"--weights: {min(found_N):g} N is no weight to put on; write what is above 0")
    if len(found_N) < FEWEST:
        raise UsageError(f"--weights: {len(found_N)} given; {FEWEST} or more tell a straight line from a bent one")
    ordered = sorted(found_N)
    if any(math.isclose(low, high, rel_tol=1e-3) for low, high in pairwise(ordered)):
        raise UsageError("--weights: the same weight twice tells nothing new; give different ones")
    if ordered[-1] > limit_N:
        raise UsageError(f"--weights: {ordered[-1]:g} N is above limits.force_N, {limit_N:g} N; use lighter ones")
