"""A protocol: the settings of one experiment, as data that can be checked against limits before anything moves."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from rig.config.quality import QualityLimits
from rig.config.table import Table

FORCE_LIMIT = "force limit"
"""Outcome of a trial whose compression ended at the protocol's own limit of force."""
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class Indentation(Table):
    """Constant-velocity indentation: the study's experiment, with holds, dither and a second depth where asked."""

    name: str = "indentation"
    kind: Literal["indentation"] = "indentation"
    speeds_mm_s: tuple[Positive, ...] = Field(default=(5.0, 10.0, 15.0, 20.0, 30.0), min_length=1)
    trials: int = Field(default=5, ge=1, le=1000, description="trials at each speed")
    randomise: bool = True
    seed: int = 1
    depth_mm: Positive = 8.0
    air_dwell_s: Positive = Field(default=0.5, description="rest in the air that gives the reference zero")
    approach_speed_mm_s: Positive = 5.0
    contact_force_N: Positive = 0.05
    contact_within_mm: Positive = Field(
        default=0.2, description="how well the surface is to be known (95 %); else the tip touches again, slowly"
    )
    touches: int = Field(default=3, ge=0, le=10, description="slow touches at most")
    touch_speed_mm_s: Positive = 0.5
    search_to_mm: Positive = Field(default=40.0, description="axis position at which the search for contact gives up")
    run_up_mm: Positive = Field(default=2.0, description="back-off after contact, to be at speed on the surface")
    hold_s: NotNegative = 0.5
    dither_amplitude_mm: NotNegative = 0.0
    dither_frequency_Hz: Positive = 5.0
    dither_s: NotNegative = 0.0
    second_depth_mm: NotNegative = Field(
        default=0.0, description="0: none; held for hold_s, reached at the trial's speed"
    )
    retract_speed_mm_s: Positive = 10.0
    clearance_mm: Positive = Field(default=5.0, description="distance above the surface at rest")
    rest_s: NotNegative = Field(default=0.2, description="pause between trials")
    force_limit_N: Positive = Field(default=12.0, description="ends the compression of a trial, which then retracts")

    quality: QualityLimits = QualityLimits()

    @property
    def deepest_mm(self) -> float:
        """Largest depth any step asks for."""
        return max(self.depth_mm + self.dither_amplitude_mm, self.second_depth_mm)

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.dither_amplitude_mm >= self.depth_mm:
            raise ValueError(
                f"dither_amplitude_mm {self.dither_amplitude_mm:g} must stay below depth_mm {self.depth_mm:g}"
            )
        return self
