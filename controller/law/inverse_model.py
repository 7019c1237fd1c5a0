"""The inverse tissue model: where the tip has to be so that the tissue bears a wanted force.

It solves B dx/dt + F(x) = F_ref, no faster than the axis may go, so that a jump of the reference is spread instead of
cut off. Where the model knows of them, the tissue's memory, q' = -q / tau + r dF/dt of up to two terms, and the guide's
friction, Fc z with dz/dx = (1 - sgn(v) z) / l (Dahl 1968), stand beside F.

Plain arithmetic on numbers and tuples of columns: the loop runs it, and the simulation compiles it.
"""

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from rig.config.table import Table

Finite = Annotated[float, Field(ge=0)]
Values: TypeAlias = Sequence[float] | NDArray[np.float64]


class GainRow(Table):
    """What the force law takes the tissue for at one point of the force-depth curve."""

    force_N: Finite
    depth_mm: Finite
    tangent_N_mm: Annotated[float, Field(gt=0)]
    damping_N_s_mm: Annotated[float, Field(gt=0)]


class Columns(NamedTuple):
    """The gain rows by column, force and depth rising; each of shape (rows,)."""

    force_N: Values
    depth_mm: Values
    tangent_N_mm: Values
    damping_N_s_mm: Values


class Inverse(NamedTuple):
    """What of the inverse model does not change during a run; ``ahead_mm_s`` 0 switches it off."""

    damping_N_s_mm: float
    ahead_mm_s: float
    ratio1: float = 0.0
    tau1_s: float = 1.0
    ratio2: float = 0.0
    tau2_s: float = 1.0
    friction_N: float = 0.0
    friction_mm: float = 1.0


class Foreseen(NamedTuple):
    """What the inverse model remembers: its place, what of the tissue's force will die out, the guide's bristles."""

    depth_mm: float
    transient1_N: float
    transient2_N: float
    bristle: float


def columns(rows: Sequence[GainRow]) -> Columns:
    """The rows as the law takes them."""
    return Columns(
        tuple(row.force_N for row in rows),
        tuple(row.depth_mm for row in rows),
        tuple(row.tangent_N_mm for row in rows),
        tuple(row.damping_N_s_mm for row in rows),
    )


def interpolate(at: Values, values: Values, x: float) -> float:
    """``values`` at ``x``, linear between the rising points ``at``, constant beyond them."""
    low, high = 0, len(at) - 1
    if x <= at[low]:
        return float(values[low])
    if x >= at[high]:
        return float(values[high])
    while high - low > 1:
        middle = (low + high) // 2
        if at[middle] <= x:
            low = middle
        else:
            high = middle
    return float(values[low] + (x - at[low]) / (at[high] - at[low]) * (values[high] - values[low]))


def resting(table: Columns, inverse: Inverse, force_N: float) -> Foreseen:
    """At rest at ``force_N``, the tip having come inwards."""
    bristle = min(max(force_N / inverse.friction_N, -1.0), 1.0) if inverse.friction_N > 0 else 0.0
    depth_mm = interpolate(table.force_N, table.depth_mm, force_N - inverse.friction_N * bristle)
    return Foreseen(depth_mm, 0.0, 0.0, bristle)


def foresee(
    table: Columns, inverse: Inverse, ahead: Foreseen, reference_N: float, dt_s: float
) -> tuple[Foreseen, float]:
    """The inverse model one cycle later, and the force it asks for then [N].

    One Newton step of the implicit equation B (x1 - x0) / dt + F(x1) + memory + friction = reference, within
    ``ahead_mm_s``.
    """
    resistance = inverse.damping_N_s_mm / dt_s
    rest_N = interpolate(table.depth_mm, table.force_N, ahead.depth_mm)
    transient1_N = math.exp(-dt_s / inverse.tau1_s) * ahead.transient1_N
    transient2_N = math.exp(-dt_s / inverse.tau2_s) * ahead.transient2_N
    lacking_N = reference_N - rest_N - transient1_N - transient2_N - inverse.friction_N * ahead.bristle
    side = 1.0 if lacking_N > 0 else -1.0
    friction = inverse.friction_N * (1.0 - side * ahead.bristle) / inverse.friction_mm
    tangent = interpolate(table.depth_mm, table.tangent_N_mm, ahead.depth_mm)
    largest_mm = inverse.ahead_mm_s * dt_s
    step_mm = min(max(lacking_N / (tangent + resistance + friction), -largest_mm), largest_mm)
    after_mm = ahead.depth_mm + step_mm
    after_N = interpolate(table.depth_mm, table.force_N, after_mm)
    transient1_N += inverse.ratio1 * (after_N - rest_N)
    transient2_N += inverse.ratio2 * (after_N - rest_N)
    bristle = side - (side - ahead.bristle) * math.exp(-abs(step_mm) / inverse.friction_mm)
    foreseen_N = after_N + transient1_N + transient2_N + inverse.friction_N * bristle + resistance * step_mm
    return Foreseen(after_mm, transient1_N, transient2_N, bristle), foreseen_N
