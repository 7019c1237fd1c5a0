"""What a calibration as a job is asked for."""

from typing import Literal, Self

from pydantic import Field, model_validator

from api.http.jobs.params import JobBody, JobOf
from api.http.models import RequestBody
from api.operations.calibrate import AxisAsked
from controller.commissioning.weights import Weights, parse_weights
from rig.results.base import SavedResult
from rig.results.bench import CalibrateResult
from rig.results.glove import GloveCalibrated


class WeightsParams(RequestBody):
    """Known weights, one after the other, each put on by a person when the job asks for it."""

    weights: str = Field(min_length=1, max_length=200, description="as '100 g,200 g,5 N'")
    tolerance_percent: float = Field(default=0.5, ge=0, le=10, description="bound on the error of each weight")
    gravity_m_s2: float | None = Field(default=None, ge=9.7, le=9.9, description="at this place, for g and kg")

    def up_to(self, limit_N: float, hung: bool = False) -> Weights:
        """As loads; raises UsageError where they do not fit each other, or one is above ``limit_N``."""
        return parse_weights(self.weights, hung, self.tolerance_percent / 100, limit_N, self.gravity_m_s2)


class CalibrateForceParams(WeightsParams):
    """Known weights on the tip."""

    load: Literal["pressed", "hung"]


class CalibrateGloveParams(WeightsParams):
    """Known weights on each finger of a glove."""

    input: str = Field(default="", max_length=24, description="name of the glove, where there are several")


class MovingParams(RequestBody):
    """The axis moves in the air, which every stop and the loss of control end."""

    from_mm: float = Field(default=2.0, ge=-1000, le=1000, description="where it begins, in the air")
    clear: bool = Field(default=False, description="the tip's way is free and the limb out; false: the job asks first")


class CalibrateAxisParams(MovingParams):
    """Against the tracker over a travel in the air, or against a gauge block."""

    to_mm: float = Field(default=14.0, ge=-1000, le=1000, description="how far it goes, in the air")
    toward_limb: bool | None = Field(
        default=None, description="whether the tip first goes towards the limb; null: the limb's marker, or a person"
    )
    gauge_block_mm: float | None = Field(default=None, ge=1, le=100, description="against a block of that height")
    near_mm: float | None = Field(
        default=None, ge=-1000, le=1000, description="position half a millimetre before the table, for the block"
    )

    @model_validator(mode="after")
    def _one(self) -> Self:
        if self.near_mm is not None and self.gauge_block_mm is None:
            raise ValueError("near_mm says where the table for a gauge block is; give gauge_block_mm, or leave it out")
        return self

    @property
    def asked(self) -> AxisAsked:
        """As the command asks for it."""
        return AxisAsked(**self.model_dump())


class CalibrateDynamicsParams(MovingParams):
    """Small sweeps in the air."""


class CalibrateForceJob(JobOf[Literal["calibrate-force"], CalibrateForceParams]):
    """Calibrates the force sensor against known weights; the loop ends for it, and nothing moves."""


class CalibrateGloveJob(JobOf[Literal["calibrate-glove"], CalibrateGloveParams]):
    """Calibrates a glove against known weights on each finger; the loop ends for it, and nothing moves."""


class CalibrateAxisJob(JobOf[Literal["calibrate-axis"], CalibrateAxisParams]):
    """Calibrates the axis against tracker or gauge block; the loop ends for it, then the axis homes and moves."""

    params: CalibrateAxisParams = CalibrateAxisParams()


class CalibrateDynamicsJob(JobOf[Literal["calibrate-dynamics"], CalibrateDynamicsParams]):
    """Finds how the axis follows its set-point; the loop ends for it, then the axis homes and swings in the air."""

    params: CalibrateDynamicsParams = CalibrateDynamicsParams()


AnyCalibrationJob = CalibrateForceJob | CalibrateGloveJob | CalibrateAxisJob | CalibrateDynamicsJob
AnyCalibrated = CalibrateResult | GloveCalibrated
# What it gives, the command that does the same, and the function of `work` that does it.
CALIBRATIONS: tuple[tuple[type[JobBody], type[SavedResult], str, str], ...] = (
    (CalibrateForceJob, CalibrateResult, "calibrate force", "calibrate_force"),
    (CalibrateGloveJob, GloveCalibrated, "calibrate glove", "calibrate_glove"),
    (CalibrateAxisJob, CalibrateResult, "calibrate axis", "calibrate_axis"),
    (CalibrateDynamicsJob, CalibrateResult, "calibrate axis --dynamics", "calibrate_dynamics"),
)
