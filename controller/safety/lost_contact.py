"""Whether the limb is still felt where it was: a tip that feels nothing goes on inwards, in search of it.

A limb that was drawn back is searched for in vain; a force channel that is dead makes the tip press as deep as it may.
The two cannot be told apart, so the search ends a little beyond where something was felt last.
"""

import math

from controller.loop.state import LoopState

# The softest tissue (0.1 N/mm) gives six standard deviations of the noisier product over it, and it is more than a limb
# draws back between two cycles of breathing.
FARTHEST_MM = 3.0
# Half of the contact force of a search, and what noise reaches once in a thousand samples of an hour.
LEAST_N, NOISES = 0.05, 4.0


class LostContact:
    """``update`` is called once a cycle in which the tip presses, ``begin`` before a program."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Nothing was felt yet."""
        self._felt_mm = math.nan

    def update(self, state: LoopState) -> str:
        """A sentence where nothing is felt beyond the last place where something was, or the surface; else ""."""
        inside = state.depth_mm > 0.0
        if not inside or math.isnan(self._felt_mm):
            self._felt_mm = state.surface_mm
        if inside and state.force_N >= max(LEAST_N, NOISES * state.noise_N):
            self._felt_mm = state.position_mm
        beyond_mm = state.position_mm - self._felt_mm
        if not beyond_mm > FARTHEST_MM:
            return ""
        return (
            f"nothing is felt {beyond_mm:.1f} mm beyond where the limb was felt last (limit {FARTHEST_MM:g} mm): the"
            " limb is gone, or a force channel is dead; check sensor and cable, then `rig calibrate force`"
        )
