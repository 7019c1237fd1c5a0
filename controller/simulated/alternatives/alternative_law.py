"""What the force law is compared with: PI on force in velocity form, and admittance with variable damping.

    dx = dx_ahead + Pf (e - e_last) + If e dt + u dt        du = wd (Pf (e - e_last) + If e dt)

with the law's own inverse model and expectation, so that only feedback differs. An admittance moves at the speed
that its damper allows, v = e / D, behind a mass, with less damping where the error is large:

    M dv/dt + D v = e,  D = D0 / (1 + vary |e| / max(F_ref, FLOOR_N))

as in robots for massage and ultrasound. Plain arithmetic on numbers and tuples of columns, compiled.
"""

from typing import NamedTuple

from controller.law.force_position import LINE_CYCLES, Expected, Feedback, ForceReading, expect
from controller.law.inverse_model import Foreseen, Inverse, Values, foresee, interpolate, resting

FLOOR_N = 0.5  # below it the relative error of a contact would take away all damping


class AlternativeColumns(NamedTuple):
    """Tissue as the law's table has it, and gains [mm/N], [mm/(N s)] at each force."""

    force_N: Values
    depth_mm: Values
    tangent_N_mm: Values
    damping_N_s_mm: Values
    proportional_mm_N: Values
    integral_mm_N_s: Values


class AlternativeFeedback(NamedTuple):
    """``expects``: e is against what the axis should show by now, else against the reference itself."""

    common: Feedback
    drift_rad_s: float
    expects: bool
    mass_s: float
    vary: float


class AlternativeSettings(NamedTuple):
    """What does not change during a run."""

    inverse: Inverse
    feedback: AlternativeFeedback


class AlternativeMemory(NamedTuple):
    """What is remembered from cycle to cycle."""

    ahead: Foreseen
    expected: Expected
    error_N: float
    speed_mm_s: float
    drift_mm_s: float


def begin(table: AlternativeColumns, inverse: Inverse, force_N: float) -> AlternativeMemory:
    """Memory at hand-over."""
    expected = Expected((0.0,) * LINE_CYCLES, 0, force_N, force_N, force_N)
    return AlternativeMemory(resting(table, inverse, force_N), expected, 0.0, 0.0, 0.0)  # type: ignore[arg-type]


def correct(
    memory: AlternativeMemory, table: AlternativeColumns, feedback: AlternativeFeedback, error_N: float,
    reference_N: float, force_N: float, dt_s: float,
) -> tuple[float, float]:  # fmt: skip
    """Way [mm] that feedback adds in this cycle, and the speed that an admittance has then."""
    integral = interpolate(table.force_N, table.integral_mm_N_s, force_N)
    if feedback.mass_s > 0:
        softer = 1.0 + feedback.vary * min(abs(error_N) / max(reference_N, FLOOR_N), 1.0)
        share = dt_s / (dt_s + feedback.mass_s)
        speed_mm_s = memory.speed_mm_s + share * (integral * softer * error_N - memory.speed_mm_s)
        return speed_mm_s * dt_s, speed_mm_s
    proportional = interpolate(table.force_N, table.proportional_mm_N, force_N)
    return proportional * (error_N - memory.error_N) + integral * error_N * dt_s, 0.0


def increment(
    memory: AlternativeMemory, table: AlternativeColumns, settings: AlternativeSettings, reference_N: float,
    measured: ForceReading, dt_s: float,
) -> tuple[float, AlternativeMemory]:  # fmt: skip
    """The step to add to the commanded position [mm], within the speed limits, and what to remember."""
    inverse, feedback = settings
    limits, force_N = feedback.common, measured.force_N
    ahead, foreseen_N = memory.ahead, reference_N
    if inverse.ahead_mm_s > 0:
        ahead, foreseen_N = foresee(table, inverse, memory.ahead, reference_N, dt_s)  # type: ignore[arg-type]
    expected = expect(memory.expected, limits, foreseen_N, dt_s)
    error_N = (expected.force_N if feedback.expects else reference_N) - force_N
    way_mm, speed_mm_s = correct(memory, table, feedback, error_N, reference_N, force_N, dt_s)
    drift_mm_s = memory.drift_mm_s + feedback.drift_rad_s * way_mm
    drift_mm_s = min(max(drift_mm_s, -limits.drift_limit_mm_s), limits.drift_limit_mm_s)
    largest_mm = (limits.search_mm_s if force_N < limits.lost_N < reference_N else limits.speed_limit_mm_s) * dt_s
    wanted_mm = ahead.depth_mm - memory.ahead.depth_mm + way_mm + drift_mm_s * dt_s
    step_mm = min(max(wanted_mm, -largest_mm), largest_mm)
    return step_mm, AlternativeMemory(ahead, expected, error_N, speed_mm_s, drift_mm_s)
