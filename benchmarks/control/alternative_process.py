"""The loop's process with a constant PI for the force law: ``python -m benchmarks.control.alternative_process``.

It takes the product's own track step: ``crossover_rad_s`` holds If, ``lead_s`` is Pf over If, ``drift_rad_s`` the
corner of the second integral. Devices, safety, phase and recording are the loop's own. The product has no such switch.
"""

import sys
from typing import NamedTuple
from unittest.mock import patch

from controller.law.force_position import ForceReading, Settings
from controller.law.inverse_model import Columns, Inverse
from controller.loop import process, steps
from controller.simulated.alternatives import alternative_law
from controller.simulated.alternatives.alternative_law import (
    AlternativeColumns,
    AlternativeFeedback,
    AlternativeMemory,
    AlternativeSettings,
)

MODULE = "benchmarks.control.alternative_process"


class ConstantMemory(NamedTuple):
    """What the alternative remembers, and the stiffness that the loop publishes; NaN, as a constant knows none."""

    alternative: AlternativeMemory
    tangent_N_mm: float = float("nan")


class ConstantLaw:
    """Two functions under the names by which the track step calls the product's law."""

    @staticmethod
    def begin(table: Columns, inverse: Inverse, force_N: float) -> ConstantMemory:
        """Memory at hand-over."""
        return ConstantMemory(alternative_law.begin(with_gains(table, 0.0, 0.0), inverse, force_N))

    @staticmethod
    def increment(
        memory: ConstantMemory, table: Columns, settings: Settings, reference_N: float, measured: ForceReading,
        dt_s: float,
    ) -> tuple[float, ConstantMemory]:  # fmt: skip
        """One cycle of `alternative_law.increment` with the step's three numbers."""
        common = settings.feedback
        feedback = AlternativeFeedback(common, common.drift_rad_s, True, 0.0, 0.0)
        alternative = AlternativeSettings(settings.inverse, feedback)
        gains = with_gains(table, common.lead_s * common.crossover_rad_s, common.crossover_rad_s)
        step_mm, after = alternative_law.increment(memory.alternative, gains, alternative, reference_N, measured, dt_s)
        return step_mm, ConstantMemory(after)


def with_gains(table: Columns, proportional_mm_N: float, integral_mm_N_s: float) -> AlternativeColumns:
    """The product's table with the same gains at every force."""
    rows = len(table.force_N)
    return AlternativeColumns(*table, (proportional_mm_N,) * rows, (integral_mm_N_s,) * rows)


def main() -> int:
    """Runs the loop."""
    with patch.object(steps, "force_position", ConstantLaw):
        return process.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
