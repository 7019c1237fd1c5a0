"""What drivers of one role have alike: the numbers of their samples, their names, and what limits allow."""

from typing import Protocol

from drivers.roles import Identity
from rig.config.products.roles import TrackerProduct
from rig.config.wiring import Limits
from rig.errors import SafetyStop

SLACK_MM = 0.05  # beyond a limit a position is still rounding and ripple, and is taken as the limit itself


class Numbering(Protocol):
    """What numbers samples; ``next_seq`` is the number of the next."""

    next_seq: int


class SampledDevice:
    """Its ``_samples`` number what it gives."""

    _samples: Numbering
    _identity: Identity

    @property
    def identity(self) -> Identity:
        """Known after ``start``."""
        return self._identity

    @property
    def next_seq(self) -> int:
        """Number of the next sample."""
        return self._samples.next_seq

    @next_seq.setter
    def next_seq(self, number: int) -> None:
        self._samples.next_seq = number


class SampledTracker(SampledDevice):
    """Rate and tools as configured."""

    _config: TrackerProduct

    @property
    def period_ns(self) -> int:
        """Time between frames."""
        return round(1e9 / self._config.rate_Hz)

    @property
    def tools(self) -> tuple[str, ...]:
        """Names of the tools by index."""
        return self._config.tools


def allowed_mm(position_mm: float, limits: Limits, name: str) -> float:
    """The position within the limits; raises SafetyStop beyond them."""
    low_mm, high_mm = limits.position_min_mm, limits.position_max_mm
    if not low_mm - SLACK_MM <= position_mm <= high_mm + SLACK_MM:
        raise SafetyStop(
            f"{name}: refused to go to {position_mm:g} mm; limits.position_min_mm and position_max_mm are "
            f"{low_mm:g} and {high_mm:g} mm"
        )
    return min(max(position_mm, low_mm), high_mm)
