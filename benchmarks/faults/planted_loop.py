"""The loop's process with checks switched off: ``python -m benchmarks.faults.planted_loop`` instead of the loop's own.

``PLANTED`` in the environment holds the codes, with commas between them. The table it runs with is a copy without those
lines; what is no line of the table is replaced where it stands. The product has no such switch.
"""

import os
import sys
from collections.abc import Collection, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from unittest.mock import patch

from benchmarks.faults import scenarios
from benchmarks.faults.fault import PROTOCOL, QUALITY
from controller.commissioning import refusals
from controller.loop import process, steps
from controller.safety.table import TABLE, Check

MODULE = "benchmarks.faults.planted_loop"
VARIABLE = "PLANTED"
CONTRADICTIONS = "contradictions"
"""A wiring that says something else than the calibration."""
BLIND = scenarios.INDENTATION.model_copy(update={"quality": scenarios.blind(scenarios.INDENTATION.quality)})
REPLACED: dict[str, tuple[Any, str, object]] = {
    PROTOCOL: (steps, "LARGEST_ZERO_SHIFT_N", float("inf")),
    QUALITY: (scenarios, "INDENTATION", BLIND),
    CONTRADICTIONS: (refusals, "contradictions", lambda _: []),
}


def without(codes: Collection[str], table: tuple[Check, ...] = TABLE) -> tuple[Check, ...]:
    """``table`` less the lines in ``codes``."""
    return tuple(line for line in table if line.code not in codes)


@contextmanager
def replaced(codes: Collection[str]) -> Iterator[None]:
    """What is no line of the table is off in this process until the block ends."""
    with ExitStack() as stack:
        for module, name, instead in (REPLACED[code] for code in codes if code in REPLACED):
            stack.enter_context(patch.object(module, name, instead))
        yield


def main() -> int:
    """Runs the loop without the planted checks."""
    codes = os.environ.get(VARIABLE, "").split(",")
    with replaced(codes):
        return process.main(sys.argv[1:], without(codes))


if __name__ == "__main__":
    sys.exit(main())
