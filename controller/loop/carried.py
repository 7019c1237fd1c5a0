"""What a loop knew of the force when a program began: with it, a recording is enough to decide all of it again."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from controller.safety.load import Wrench

if TYPE_CHECKING:
    from controller.loop.state import LoopState


@dataclass(frozen=True)
class Carried:
    """Zeros and noise of the programs before; None before the first zero."""

    zero: Wrench | None = None
    reference_zero: Wrench | None = None
    zero_N: float | None = None
    noise_N: float = 0.0
    noise_N_m: float = 0.0

    def into(self, state: "LoopState") -> None:
        """A loop that knows as much."""
        state.zero, state.reference_zero = self.zero, self.reference_zero
        state.zero_N = math.nan if self.zero_N is None else self.zero_N
        state.noise_N, state.noise_N_m = self.noise_N, self.noise_N_m


def carried_by(state: "LoopState") -> Carried:
    """What ``state`` knows now."""
    zero_N = None if math.isnan(state.zero_N) else state.zero_N
    return Carried(state.zero, state.reference_zero, zero_N, state.noise_N, state.noise_N_m)


UNZEROED = Carried()
"""A loop that has just begun."""
