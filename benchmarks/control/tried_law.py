"""Parts that were tried on the force law and are not in the product; the benchmark says what each gains and costs.

*Friction compensation*: the drive's position loop gives way by some micrometres before dry friction does; the set-point
goes that far ahead in the direction of motion, a v / (|v| + v0). *Dead zone*: the second integral rests while the
error is no larger than the sensor's noise. Plain arithmetic, compiled.
"""

from typing import NamedTuple

from controller.law import force_position
from controller.law.force_position import Correction, Feedback, ForceReading, Memory, Settings
from controller.law.inverse_model import Columns, Inverse

# Of 2, 6.5 and 13 um what stands still best; 6.5 is dry friction (0.0024 N m) over what the drive's position loop gives
# for a millimetre (0.37 N m).
GIVES_WAY_MM = 0.013
TURNING_MM_S = 1.0  # the sensor's noise alone asks for 0.3 mm/s of a stiff limb


class TriedSettings(NamedTuple):
    """What does not change during a run; 0 switches a part off."""

    law: Settings
    inverse: Inverse
    ahead_mm: float
    turning_mm_s: float
    rests_below_N: float


class TriedMemory(NamedTuple):
    """The law's memory, and how far the set-point is ahead."""

    law: Memory
    ahead_mm: float


def begin(table: Columns, inverse: Inverse, force_N: float) -> TriedMemory:
    """Memory at hand-over."""
    return TriedMemory(force_position.begin(table, inverse, force_N), 0.0)


def rested(before: Correction, after: Correction, feedback: Feedback, rests_below_N: float) -> Correction:
    """What ``after`` is with u as it was, where the error is small."""
    if feedback.drift_rad_s > 0 and abs(after.error_N) < rests_below_N:
        return Correction(after.error_N, after.led_N, after.speed_mm_s, before.drift_mm_s)
    return after


def increment(
    memory: TriedMemory, table: Columns, settings: TriedSettings, reference_N: float, measured: ForceReading,
    dt_s: float,
) -> tuple[float, TriedMemory]:  # fmt: skip
    """The law's step with what was tried."""
    step_mm, after = law_increment(memory.law, table, settings.law, reference_N, measured, dt_s)
    correction = rested(memory.law.correction, after.correction, settings.law.feedback, settings.rests_below_N)
    kept = Memory(after.ahead, after.expected, correction, after.tangent_N_mm, after.samples, after.since_s)
    speed_mm_s = step_mm / dt_s
    ahead_mm = settings.ahead_mm * speed_mm_s / (abs(speed_mm_s) + settings.turning_mm_s)
    return step_mm + ahead_mm - memory.ahead_mm, TriedMemory(kept, ahead_mm)


# The name that `increment` is bound to where it is compiled.
law_increment = force_position.increment
