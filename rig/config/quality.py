"""How good a trial must be: for each thing that is measured, up to where it is good, and from where it is bad."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from rig.config.table import Table

NotNegative = Annotated[float, Field(ge=0)]


class Bounds(Table):
    """Good up to ``good``, bad above ``bad``, usable between; without ``bad`` it makes no trial bad."""

    good: NotNegative = Field(description="largest value of a good trial")
    bad: NotNegative | None = Field(default=None, description="largest value of a usable trial")

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.bad is not None and self.bad < self.good:
            raise ValueError(f"bad {self.bad:g} is below good {self.good:g}")
        return self


class QualityLimits(Table):
    """Bounds of everything that is measured, each such that more is worse, and how often a bad trial is made again."""

    repeats: int = Field(default=2, ge=0, le=20, description="times a bad trial is made again")
    # A quiet loop misses none; 15 % were missed where a fit could use 3.2 of 8 mm.
    cycles_missed: Bounds = Field(default=Bounds(good=0.05, bad=0.3), description="share of the loop's cycles")
    # The loop asks the axis once a cycle, so what it misses the axis misses too.
    rate_lost: Bounds = Field(default=Bounds(good=0.05, bad=0.3), description="share of the nominal rate not achieved")
    # One frame in five hundred; a cable that loses more is damaged, and at 5 % every tenth of a millimetre has a hole.
    samples_lost: Bounds = Field(default=Bounds(good=0.002, bad=0.05), description="share lost or marked invalid")
    # What gets through a wire that brings noise is right but for one in 65,536 of what a 16-bit checksum lets pass;
    # one byte in five hundred messages, as with losses, says that a cable or its shield is damaged.
    wire_damage: Bounds = Field(default=Bounds(good=0.002), description="damaged or foreign bytes a message")
    # 20 ms are 0.6 mm at 30 mm/s, 0.4 s longer than any loading of 8 mm at 20 mm/s.
    gap_ms: Bounds = Field(default=Bounds(good=20.0, bad=400.0), description="longest time without a sample")
    # A clipped peak is no peak: none is good, and one in a hundred cuts the end off the loading.
    saturated: Bounds = Field(default=Bounds(good=0.0, bad=0.01), description="share of force at the range's end")
    # Noise of half a step of the converter gives ten equal wrenches in a row once in 10^18.
    frozen_samples: Bounds = Field(default=Bounds(good=10.0, bad=100.0), description="equal readings in a row")
    # A channel without noise is not connected; without one of six the tip still presses along another.
    dead_channels: Bounds = Field(default=Bounds(good=0.0), description="force channels that never change")
    # Promised are 0.2 mm; beyond a quarter of the study's 8 mm depth means nothing.
    contact_within_mm: Bounds = Field(default=Bounds(good=0.2, bad=2.0), description="half of contact's 95 % interval")
    depth_off_mm: Bounds = Field(default=Bounds(good=0.2, bad=2.0), description="depth reached less depth asked")
    # The first and last tenth of a millimetre of 8 are run-up and stop.
    loading_lost: Bounds = Field(default=Bounds(good=0.1, bad=0.5), description="share of the loading no fit can use")
    # 5 % are 0.4 mm in 8; screw and camera agree to 0.5 %.
    tracker_slope_off: Bounds = Field(default=Bounds(good=0.05, bad=0.2), description="tracker over axis travel less 1")
    # Sixteen times a camera's noise of 0.06 mm.
    tracker_jump_mm: Bounds = Field(
        default=Bounds(good=1.0), description="step of the marker that the axis did not make"
    )
    tracker_lost: Bounds = Field(default=Bounds(good=0.1), description="share of the tip's frames lost")
    # 2 % of the study's peak of 5 N, and five times a noisy sensor's uncertainty of a mean.
    zero_drift_N: Bounds = Field(default=Bounds(good=0.1, bad=1.0), description="force in the air, after less before")
    # Preconditioning takes 10 to 20 % off a limb's force, speed 5 %; half or twice is another gain, or another site.
    peak_off: Bounds = Field(default=Bounds(good=0.3), description="peak force over that of the trials before, less 1")
