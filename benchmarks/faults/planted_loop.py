"""The loop's process with checks switched off: ``python -m benchmarks.faults.planted_loop`` instead of the loop's own.

``PLANTED`` in the environment holds the codes, with commas between them. The table it runs with is a copy without those
lines; what is no line of the table is switched off where it stands. The product has no such switch.
"""

import os
import sys

from controller import loop_process, steps
from controller.safety import TABLE, Check

MODULE = "benchmarks.faults.planted_loop"
VARIABLE = "PLANTED"


def without(codes: set[str], table: tuple[Check, ...] = TABLE) -> tuple[Check, ...]:
    """``table`` less the lines in ``codes``."""
    return tuple(line for line in table if line.code not in codes)


def main() -> int:
    """Runs the loop without the planted checks."""
    codes = set(filter(None, os.environ.get(VARIABLE, "").split(",")))
    if "protocol" in codes:
        steps.LARGEST_ZERO_SHIFT_N = float("inf")
    return loop_process.main(sys.argv[1:], without(codes))


if __name__ == "__main__":
    sys.exit(main())
