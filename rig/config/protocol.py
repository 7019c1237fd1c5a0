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

    name: str = Field(default="indentation", description="kept with each recording")
    kind: Literal["indentation"] = Field(
        default="indentation", description="which experiment these are the settings of"
    )
    speeds_mm_s: tuple[Positive, ...] = Field(
        default=(5.0, 10.0, 15.0, 20.0, 30.0), min_length=1, description="of loading; the study's five"
    )
    trials: int = Field(default=5, ge=1, le=1000, description="trials at each speed")
    randomise: bool = Field(default=True, description="trials in random order, so that time and speed are told apart")
    seed: int = Field(default=1, description="of that order")
    depth_mm: Positive = Field(default=8.0, description="of the indentation, from the surface")
    air_dwell_s: Positive = Field(default=0.5, description="rest in the air that gives the reference zero")
    approach_speed_mm_s: Positive = Field(default=5.0, description="on the way to the surface")
    contact_force_N: Positive = Field(
        default=0.05, description="above the zero, from which contact is looked for; noise can ask for more"
    )
    contact_within_mm: Positive = Field(
        default=0.2, description="how well the surface is to be known (95 %); else the tip touches again, slowly"
    )
    touches: int = Field(default=3, ge=0, le=10, description="slow touches at most")
    touch_speed_mm_s: Positive = Field(default=0.5, description="of a slow touch")
    search_to_mm: Positive = Field(default=40.0, description="axis position at which the search for contact gives up")
    run_up_mm: Positive = Field(default=2.0, description="back-off after contact, to be at speed on the surface")
    hold_s: NotNegative = Field(default=0.5, description="rest at depth, in which force relaxes")
    dither_amplitude_mm: NotNegative = Field(default=0.0, description="of a sine about the depth; 0: none")
    dither_frequency_Hz: Positive = Field(default=5.0, description="of that sine")
    dither_s: NotNegative = Field(default=0.0, description="how long it lasts")
    second_depth_mm: NotNegative = Field(
        default=0.0, description="0: none; held for hold_s, reached at the trial's speed"
    )
    retract_speed_mm_s: Positive = Field(default=10.0, description="on the way out")
    clearance_mm: Positive = Field(default=5.0, description="distance above the surface at rest")
    rest_s: NotNegative = Field(default=0.2, description="pause between trials")
    force_limit_N: Positive = Field(default=12.0, description="ends a compression; 0.8 of a threshold below it")

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
