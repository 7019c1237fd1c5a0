"""The force loop around the drive's position loop: PI on force in velocity form, with a path for what is foreseen.

Each cycle adds to the commanded position

    dx = dx_ahead + Pf (e - e_last) + If e dt + u dt        du = wd (Pf (e - e_last) + If e dt)

dx_ahead is the inverse tissue model: it solves B dx/dt + F(x) = F_ref, no faster than the axis may go, so that a jump
of the reference is spread instead of cut off. Where the model knows of them, the tissue's memory, q' = -q / tau + r
dF/dt of up to two terms, and the guide's friction, Fc z with dz/dx = (1 - sgn(v) z) / l (Dahl 1968), stand beside F.
e is what the axis should show of that by now (two equal lags that together last as long as axis and sensor) minus the
force measured: feedback sees what is unforeseen and nothing else. u is the speed at which the surface itself is found
to move (breathing): a second integral with corner wd, so that a steady motion leaves no steady error. Because only
increments are formed, a change of gains moves nothing, a limit on dx is its own anti-windup, and the hand-over from
position control makes no jump.

With ``forgetting`` above 0 the ratio of tissue to model is followed by recursive least squares (exponential
forgetting, bounded, only while force moves), and gains and inverse model are scaled by it.

Everything here is plain arithmetic on numbers and tuples of columns: the same functions run in the loop, and compiled
in the simulation.
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

# Force must have moved this far from its slow mean before it says anything of stiffness; sensor noise is 0.005 N.
EXCITATION_N = 0.05
SLOW_S = 0.3
# Beyond it is another limb: depths of five subjects at 10 N differ by 2.6 in all (5 to 13 mm).
SCALE_LOW, SCALE_HIGH = 0.5, 2.0
SPREAD = 1.0  # variance of a scale nothing is known of; forgetting must not raise it further while nothing moves


class GainRow(Table):
    """Gains of the force loop at one point of the force-depth curve."""

    force_N: Finite
    depth_mm: Finite
    tangent_N_mm: Annotated[float, Field(gt=0)]
    proportional_mm_N: Finite
    integral_mm_N_s: Annotated[float, Field(gt=0)]


class Columns(NamedTuple):
    """The gain rows by column, force and depth rising; each of shape (rows,)."""

    force_N: Values
    depth_mm: Values
    tangent_N_mm: Values
    proportional_mm_N: Values
    integral_mm_N_s: Values


class Settings(NamedTuple):
    """What does not change during a run; ``ahead_mm_s`` 0 switches the inverse model off, ``forgetting`` 0 the RLS."""

    damping_N_s_mm: float
    lag_s: float
    ahead_mm_s: float
    forgetting: float
    drift_per_s: float
    drift_limit_mm_s: float
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


class Memory(NamedTuple):
    """What the law remembers from cycle to cycle."""

    error_N: float
    ahead: Foreseen
    lagged_N: float
    expected_N: float
    tangent_N_mm: float
    scale: float
    spread: float
    depth_mm: float
    slow_force_N: float
    slow_model_N: float
    drift_mm_s: float


def columns(rows: Sequence[GainRow]) -> Columns:
    """The rows as the law takes them."""
    return Columns(
        tuple(row.force_N for row in rows),
        tuple(row.depth_mm for row in rows),
        tuple(row.tangent_N_mm for row in rows),
        tuple(row.proportional_mm_N for row in rows),
        tuple(row.integral_mm_N_s for row in rows),
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


def begin(table: Columns, force_N: float, depth_mm: float, friction_N: float = 0.0) -> Memory:
    """Memory at hand-over: what is measured now is what was foreseen, so nothing moves; the tip has come inwards."""
    bristle = min(max(force_N / friction_N, -1.0), 1.0) if friction_N > 0 else 0.0
    ahead_mm = interpolate(table.force_N, table.depth_mm, force_N - friction_N * bristle)
    tangent_N_mm = interpolate(table.force_N, table.tangent_N_mm, force_N)
    return Memory(
        0.0,
        Foreseen(ahead_mm, 0.0, 0.0, bristle),
        force_N,
        force_N,
        tangent_N_mm,
        1.0,
        SPREAD,
        depth_mm,
        force_N,
        force_N,
        0.0,
    )


def foresee(
    table: Columns, settings: Settings, ahead: Foreseen, scale: float, reference_N: float, dt_s: float
) -> tuple[Foreseen, float]:
    """The inverse model one cycle later, and the force it asks for then [N].

    One Newton step of the implicit equation B (x1 - x0) / dt + scale F(x1) + memory + friction = reference, within
    ``ahead_mm_s``.
    """
    resistance = settings.damping_N_s_mm / dt_s
    rest_N = scale * interpolate(table.depth_mm, table.force_N, ahead.depth_mm)
    transient1_N = math.exp(-dt_s / settings.tau1_s) * ahead.transient1_N
    transient2_N = math.exp(-dt_s / settings.tau2_s) * ahead.transient2_N
    lacking_N = reference_N - rest_N - transient1_N - transient2_N - settings.friction_N * ahead.bristle
    side = 1.0 if lacking_N > 0 else -1.0
    friction = settings.friction_N * (1.0 - side * ahead.bristle) / settings.friction_mm
    tangent = scale * interpolate(table.depth_mm, table.tangent_N_mm, ahead.depth_mm)
    largest_mm = settings.ahead_mm_s * dt_s
    step_mm = min(max(lacking_N / (tangent + resistance + friction), -largest_mm), largest_mm)
    after_mm = ahead.depth_mm + step_mm
    after_N = scale * interpolate(table.depth_mm, table.force_N, after_mm)
    transient1_N += settings.ratio1 * (after_N - rest_N)
    transient2_N += settings.ratio2 * (after_N - rest_N)
    bristle = side - (side - ahead.bristle) * math.exp(-abs(step_mm) / settings.friction_mm)
    foreseen_N = after_N + transient1_N + transient2_N + settings.friction_N * bristle + resistance * step_mm
    return Foreseen(after_mm, transient1_N, transient2_N, bristle), foreseen_N


def adapt(
    memory: Memory, table: Columns, settings: Settings, force_N: float, depth_mm: float, dt_s: float
) -> tuple[float, float, float, float]:
    """Scale, its spread, and the two slow means: least squares of force against model, both without their means."""
    speed_mm_s = (depth_mm - memory.depth_mm) / dt_s
    elastic_N = force_N - settings.damping_N_s_mm * speed_mm_s
    model_N = interpolate(table.depth_mm, table.force_N, depth_mm)
    share = dt_s / SLOW_S
    slow_force_N = memory.slow_force_N + share * (elastic_N - memory.slow_force_N)
    slow_model_N = memory.slow_model_N + share * (model_N - memory.slow_model_N)
    moved_N = model_N - slow_model_N
    if abs(moved_N) < EXCITATION_N:
        return memory.scale, memory.spread, slow_force_N, slow_model_N
    gain = memory.spread * moved_N / (settings.forgetting + memory.spread * moved_N * moved_N)
    scale = memory.scale + gain * (elastic_N - slow_force_N - memory.scale * moved_N)
    spread = (memory.spread - gain * moved_N * memory.spread) / settings.forgetting
    return min(max(scale, SCALE_LOW), SCALE_HIGH), min(spread, SPREAD), slow_force_N, slow_model_N


def increment(
    memory: Memory,
    table: Columns,
    settings: Settings,
    reference_N: float,
    force_N: float,
    depth_mm: float,
    dt_s: float,
) -> tuple[float, Memory]:
    """The step to add to the commanded position [mm], and what to remember."""
    scale, spread = memory.scale, memory.spread
    slow_force_N, slow_model_N = memory.slow_force_N, memory.slow_model_N
    if settings.forgetting > 0:
        scale, spread, slow_force_N, slow_model_N = adapt(memory, table, settings, force_N, depth_mm, dt_s)
    ahead, foreseen_N = memory.ahead, reference_N
    if settings.ahead_mm_s > 0:
        ahead, foreseen_N = foresee(table, settings, memory.ahead, scale, reference_N, dt_s)
    share = dt_s / (dt_s + 0.5 * settings.lag_s)
    lagged_N = memory.lagged_N + share * (foreseen_N - memory.lagged_N)
    expected_N = memory.expected_N + share * (lagged_N - memory.expected_N)
    error_N = expected_N - force_N
    proportional = interpolate(table.force_N, table.proportional_mm_N, force_N) / scale
    integral = interpolate(table.force_N, table.integral_mm_N_s, force_N) / scale
    tangent_N_mm = scale * interpolate(table.force_N, table.tangent_N_mm, force_N)
    feedback_mm = proportional * (error_N - memory.error_N) + integral * error_N * dt_s
    drift_mm_s = memory.drift_mm_s + settings.drift_per_s * feedback_mm
    drift_mm_s = min(max(drift_mm_s, -settings.drift_limit_mm_s), settings.drift_limit_mm_s)
    return ahead.depth_mm - memory.ahead.depth_mm + feedback_mm + drift_mm_s * dt_s, Memory(
        error_N,
        ahead,
        lagged_N,
        expected_N,
        tangent_N_mm,
        scale,
        spread,
        depth_mm,
        slow_force_N,
        slow_model_N,
        drift_mm_s,
    )
