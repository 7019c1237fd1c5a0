"""What recordings differ by: specimens and sites by nature, anything else that a label says not without a reason.

Each recording has a stiffness, contact and zero of its own. Whether these go with a label is asked by the variance
between its groups over that within them, which is what repeats differ by (Fisher's F; Draper and Smith 1998, ch. 23).
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from rig.diagnosis.noise import Array

BY_NATURE = frozenset({"specimen", "site"})
FEWEST_WITHIN = 4  # of less than four degrees of freedom the noise is known to no better than a factor of three


class Dependence(NamedTuple):
    """A label that the recordings' own terms go with, and the chance of it; none, and 1, where there is no label."""

    label: str | None
    p_value: float


def label_dependence(shifts: Array, beside: Array, labels: Mapping[str, Sequence[str]]) -> Dependence:
    """The label that own terms (recordings, quantities) go with most, its chance counted for all that was asked.

    ``beside`` (quantities, recordings, recordings) takes off what is explained already. Levels of nature are not asked.
    """
    asked = [name for name in labels if name not in BY_NATURE]
    chances = {name: _chance(shifts, beside, labels[name]) for name in asked}
    best = min(chances, key=lambda name: chances[name], default=None)
    if best is None:
        return Dependence(None, 1.0)
    return Dependence(best, min(1.0, len(asked) * chances[best]))


def _chance(shifts: Array, beside: Array, names: Sequence[str]) -> float:
    """Of the largest F over quantities, times their number; 1 where groups have too few recordings."""
    groups = np.array([[name == group for group in dict.fromkeys(names)] for name in names], float)
    found = [_of_quantity(own, projector, groups) for own, projector in zip(shifts.T, beside, strict=True)]
    return min(1.0, len(found) * min(found, default=1.0))


def _of_quantity(own: Array, projector: Array, groups: Array) -> float:
    columns, left = projector @ groups, projector @ own
    between = int(np.linalg.matrix_rank(columns, tol=1e-8))
    within = round(float(np.trace(projector))) - between
    if between < 1 or within < FEWEST_WITHIN:
        return 1.0
    taken = columns @ np.linalg.lstsq(columns, left, rcond=1e-8)[0]
    rest = float(np.sum((left - taken) ** 2))
    return float(fdtrc(between, within, float(taken @ taken) / between / max(rest / within, 1e-300)))
