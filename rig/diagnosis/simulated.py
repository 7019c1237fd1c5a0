"""Simulation error on a recording, before and after the model was extended."""

from typing import NamedTuple


class Simulated(NamedTuple):
    """Closed-loop force error [%] of one recording; ``fitted`` if its data chose the model."""

    recording: str
    fitted: bool
    before_percent: float
    after_percent: float
