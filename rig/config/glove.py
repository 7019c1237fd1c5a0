"""The calibration of a pain glove: what each force sensor read under known weights."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Self

from pydantic import AwareDatetime, Field, model_validator

from rig.config.table import Table

# Ten bits, of which StandardFirmata sends all; a converter at its end says nothing of the force.
COUNTS_MAX = 1023
# The last counts of a divider's converter are noise of its reference.
SATURATED = COUNTS_MAX - 3
Counts = Annotated[float, Field(ge=0, le=COUNTS_MAX)]


class FingerCalibration(Table):
    """Mean counts under each load, lightest first; between them force goes by a straight line, beyond them nowhere."""

    loads_N: tuple[Annotated[float, Field(ge=0)], ...] = Field(min_length=3)
    counts: tuple[Counts, ...] = Field(min_length=3)
    noise_counts: float = Field(ge=0, description="rms of a sample, unloaded")
    repeatability: float = Field(ge=0, description="largest difference between loading and unloading, of the range")

    @model_validator(mode="after")
    def _rises(self) -> Self:
        if len(self.loads_N) != len(self.counts):
            raise ValueError(f"{len(self.loads_N)} loads and {len(self.counts)} counts; each load has its counts")
        for quantity in (self.loads_N, self.counts):
            if any(after <= before for before, after in pairwise(quantity)):
                raise ValueError("loads and counts must rise together: calibrate again")
        return self

    def force_N(self, counts: float) -> float | None:
        """Force at ``counts``; None beyond the heaviest weight, where nothing is known. Below the zero it is 0."""
        if counts <= self.counts[0]:
            return self.loads_N[0]
        steps = zip(pairwise(self.counts), pairwise(self.loads_N), strict=True)
        for (low, high), (below_N, above_N) in steps:
            if counts <= high:
                return below_N + (above_N - below_N) * (counts - low) / (high - low)
        return None


class GloveCalibration(Table):
    """All force sensors of one glove."""

    version: int = Field(default=1, description="of the file's format")
    product: str = Field(min_length=1)
    firmware: str
    date: AwareDatetime
    fingers: Mapping[str, FingerCalibration]
