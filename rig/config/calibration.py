"""Calibrations: what `rig calibrate` measured of the force sensor and of the axis, whose it is, and how sure it is."""

from collections.abc import Mapping
from datetime import datetime, timedelta
from pathlib import Path
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import AwareDatetime, Field, model_validator

from rig.config.axis_dynamics import AxisDynamics
from rig.config.force_map import UNIT, ForceChannel, ForceMap, Matrix, Sign, Vector
from rig.config.table import Table

VERSION = 1
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Name = Annotated[str, Field(min_length=1)]

# A sensor whose matrix is farther from the factory's than this is broken or was never calibrated: `rig calibrate`
# refuses 0.02 on the gain and 0.03 of cross-talk, so that only an edited file can have more.
LARGEST_CORRECTION = 0.1
# Rounding and noise of the readings; `rig calibrate` refuses residuals of 0.01 of the largest load.
LARGEST_MISFIT = 0.05
# 0.08 mm of the 8 mm of an indentation, well inside the 0.2 mm that depth is to be known to; a ball screw is ten times
# better, so that more is a wrong figure in the configuration.
LARGEST_SCALE_ERROR = 0.01
# Two computers' clocks may differ by this; a calibration of tomorrow means that one of them is wrong.
CLOCKS_AGREE = timedelta(minutes=1)


class Load(Table):
    """One known load and what the sensor read under it, its zero included; ``load_N`` is positive in compression."""

    load_N: float
    force_N: Vector
    torque_N_m: Vector


class Uncertainty(Table):
    """Relative standard uncertainties of a force of the largest load; ``combined`` is their root sum of squares."""

    combined: NotNegative
    repeatability: NotNegative = Field(description="of the gain, from the scatter of the readings about a line")
    weights: NotNegative = Field(description="of the weights, and of gravity where masses were given")
    linearity: NotNegative = Field(description="largest residual from the line, taken as a rectangular distribution")


class ForceCalibration(Table):
    """What known loads along the tip say of a force sensor.

    Loads along one line identify the gain of the channel that lies along it, its sign in compression, and how much of
    such a load the two other force channels show (cross-talk). They say nothing of the other channels' own gains: for
    these, ``matrix`` keeps the factory's, which is 1. Source of the uncertainties: JCGM 100:2008 (GUM), 4.2 and 4.3.
    """

    version: int = Field(default=VERSION, description="of the file's format; files without one are of version 1")
    product: Name
    serial: str
    date: AwareDatetime
    channel: ForceChannel
    compression: Sign
    matrix: Matrix
    zero_N: Vector = Field(description="unloaded, Fx Fy Fz")
    zero_N_m: Vector
    noise_N: Vector = Field(description="rms of each sample, unloaded")
    noise_N_m: Vector
    loads: tuple[Load, ...] = Field(min_length=3)
    uncertainty: Uncertainty

    @property
    def map(self) -> ForceMap:
        """From readings to compression."""
        return ForceMap(self.channel, self.compression, self.matrix)

    @model_validator(mode="after")
    def _agree(self) -> Self:
        largest = max(abs(value - unit) for row, one in zip(self.matrix, UNIT, strict=True)
                      for value, unit in zip(row, one, strict=True))  # fmt: skip
        if largest > LARGEST_CORRECTION:
            raise ValueError(f"matrix corrects by {largest:g}, more than {LARGEST_CORRECTION:g}: calibrate again")
        misfit_N = max(abs(self._misfit_N(load)) for load in self.loads)
        largest_N = max(abs(load.load_N) for load in self.loads)
        if misfit_N > LARGEST_MISFIT * largest_N:
            raise ValueError(
                f"its own loads do not come out of its matrix, channel and sign (by {misfit_N:.3g} N of"
                f" {largest_N:.3g} N): the file was changed, calibrate again"
            )
        return self

    def _misfit_N(self, load: Load) -> float:
        change_N = (now - zero for now, zero in zip(load.force_N, self.zero_N, strict=True))
        return float(self.map.compression_N(*change_N)) - load.load_N


class AxisStep(Table):
    """How far the axis said it went from the first place, and what the reference said of it."""

    axis_mm: float
    reference_mm: float


class AxisCalibration(Table):
    """What a reference says of the axis' scale and sense.

    ``scale`` is millimetres of the reference for each millimetre of the axis, with its standard ``uncertainty``. It
    holds for the ``increments_per_mm`` and ``direction`` that were configured: a scale is checked, never corrected for.
    """

    version: int = Field(default=VERSION, description="of the file's format; files without one are of version 1")
    product: Name
    serial: str
    date: AwareDatetime
    scale: Positive
    uncertainty: NotNegative
    direction: Literal[1, -1]
    direction_known_by: Literal["limb marker", "operator", "contact"]
    increments_per_mm: Positive
    reference: Literal["tracker", "gauge block"]
    steps: tuple[AxisStep, ...] = Field(min_length=2)

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if abs(self.scale - 1) > LARGEST_SCALE_ERROR:
            raise ValueError(
                f"scale {self.scale:g} is off from 1 by more than {LARGEST_SCALE_ERROR:g}: calibrate again"
            )
        travel_mm = max(abs(step.axis_mm) for step in self.steps)
        misfit_mm = max(abs(step.axis_mm * self.scale - step.reference_mm) for step in self.steps)
        if misfit_mm > LARGEST_MISFIT * travel_mm:
            raise ValueError(
                f"its own steps do not come out of its scale (by {misfit_mm:.3g} mm of {travel_mm:.3g} mm):"
                " the file was changed, calibrate again"
            )
        return self


AnyCalibration: TypeAlias = ForceCalibration | AxisCalibration | AxisDynamics
What = Literal["force", "axis", "dynamics"]
KINDS: Mapping[What, type[AnyCalibration]] = {
    "force": ForceCalibration, "axis": AxisCalibration, "dynamics": AxisDynamics,
}  # fmt: skip


class Calibration(Table):
    """Where the calibrations are kept, what they must keep to, and, once read, the calibrations themselves."""

    force: Path | None = Field(default=None, description="file that `rig calibrate force` wrote")
    axis: Path | None = Field(default=None, description="file that `rig calibrate axis` wrote")
    dynamics: Path | None = Field(default=None, description="file that `rig calibrate axis --dynamics` wrote")
    max_age_days: Positive = Field(default=365.0, description="makers of force sensors ask for one each year")
    max_uncertainty: Positive = Field(default=0.02, description="relative standard uncertainty of force and of scale")
    of_force: ForceCalibration | None = Field(default=None, description="read from the file that force names")
    of_axis: AxisCalibration | None = Field(default=None, description="read from the file that axis names")
    of_dynamics: AxisDynamics | None = Field(default=None, description="read from the file that dynamics names")

    def alone(self, one: AnyCalibration) -> Self:
        """What is asked of calibrations, and ``one`` in the place of all there are."""
        nothing = {f"of_{what}": None for what in KINDS}
        return self.model_copy(update={**nothing, f"of_{what_of(one)}": one})

    def unfit(self, now: datetime) -> list[str]:
        """Why a calibration may not be used at ``now``, one sentence each; empty if all may, or there is none."""
        found: list[AnyCalibration] = [one for one in (self.of_force, self.of_axis, self.of_dynamics) if one]
        return [reason for one in found for reason in (*self._date(one, now), *self._uncertain(one))]

    def _date(self, one: AnyCalibration, now: datetime) -> list[str]:
        age = now - one.date
        if age < -CLOCKS_AGREE:
            return [f"{_named(one)} is dated {one.date.isoformat()}, which is still to come: check the clocks"]
        if age > timedelta(days=self.max_age_days):
            return [
                f"{_named(one)} is {age.days} days old, calibration.max_age_days is {self.max_age_days:g}:"
                f" run `rig calibrate {what_to_calibrate(one)}`"
            ]
        return []

    def _uncertain(self, one: AnyCalibration) -> list[str]:
        if isinstance(one, AxisDynamics):
            return one.doubts
        share = one.uncertainty.combined if isinstance(one, ForceCalibration) else one.uncertainty / one.scale
        if share <= self.max_uncertainty:
            return []
        return [
            f"{_named(one)} is uncertain by {100 * share:.2g} %, calibration.max_uncertainty is"
            f" {100 * self.max_uncertainty:g} %: calibrate again with better references"
        ]


def what_of(one: AnyCalibration) -> What:
    """Which of the calibrations it is."""
    return next(what for what, kind in KINDS.items() if isinstance(one, kind))


def what_to_calibrate(one: AnyCalibration) -> str:
    """The same in the words of the command."""
    return {"dynamics": "axis --dynamics"}.get(what_of(one), what_of(one))


def _named(one: AnyCalibration) -> str:
    return f"the calibration of {one.product} {one.serial}"
