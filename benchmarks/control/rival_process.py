"""The loop's process with a constant PI in place of the force law: ``python -m benchmarks.control.rival_process``.

It takes the product's own track step: ``crossover_rad_s`` holds If, ``lead_s`` is Pf over If, ``drift_rad_s`` the
corner of the second integral. Devices, safety, phase and recording are the loop's own. The product has no such switch.
"""

import sys
from typing import NamedTuple
from unittest.mock import patch

from benchmarks.control import rival_law
from benchmarks.control.rival_law import RivalColumns, RivalFeedback, RivalMemory, RivalSettings
from controller.law.force_position import ForceReading, Settings
from controller.law.inverse_model import Columns, Inverse
from controller.loop import process, steps

MODULE = "benchmarks.control.rival_process"


class ConstantMemory(NamedTuple):
    """What the rival remembers, and the stiffness that the loop publishes; NaN, as a constant knows none."""

    rival: RivalMemory
    tangent_N_mm: float = float("nan")


class ConstantLaw:
    """Two functions under the names by which the track step calls the product's law."""

    @staticmethod
    def begin(table: Columns, inverse: Inverse, force_N: float) -> ConstantMemory:
        """Memory at hand-over."""
        return ConstantMemory(rival_law.begin(with_gains(table, 0.0, 0.0), inverse, force_N))

    @staticmethod
    def increment(
        memory: ConstantMemory, table: Columns, settings: Settings, reference_N: float, measured: ForceReading,
        dt_s: float,
    ) -> tuple[float, ConstantMemory]:  # fmt: skip
        """One cycle of `rival_law.increment` with the step's three numbers."""
        common = settings.feedback
        rival = RivalSettings(settings.inverse, RivalFeedback(common, common.drift_rad_s, True, 0.0, 0.0))
        gains = with_gains(table, common.lead_s * common.crossover_rad_s, common.crossover_rad_s)
        step_mm, after = rival_law.increment(memory.rival, gains, rival, reference_N, measured, dt_s)
        return step_mm, ConstantMemory(after)


def with_gains(table: Columns, proportional_mm_N: float, integral_mm_N_s: float) -> RivalColumns:
    """The product's table with the same gains at every force."""
    rows = len(table.force_N)
    return RivalColumns(*table, (proportional_mm_N,) * rows, (integral_mm_N_s,) * rows)


def main() -> int:
    """Runs the loop."""
    with patch.object(steps, "force_position", ConstantLaw):
        return process.main(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
