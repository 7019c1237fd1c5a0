"""What a calibration as a job is asked for."""

from typing import Literal

from pydantic import Field

from api.http.jobs.params import JobBody
from api.http.models import RequestBody
from controller.commissioning.weights import Weights, parse_weights


class CalibrateForceParams(RequestBody):
    """Known weights, one after the other, each put on by a person when the job asks for it."""

    weights: str = Field(min_length=1, max_length=200, description="as '100 g,200 g,5 N'")
    load: Literal["pressed", "hung"]
    tolerance_percent: float = Field(default=0.5, ge=0, le=10, description="bound on the error of each weight")
    gravity_m_s2: float | None = Field(default=None, ge=9.7, le=9.9, description="at this place, for g and kg")

    def up_to(self, limit_N: float) -> Weights:
        """As loads; raises UsageError where they do not fit each other, or one is above ``limit_N``."""
        tolerance = self.tolerance_percent / 100
        return parse_weights(self.weights, self.load == "hung", tolerance, limit_N, self.gravity_m_s2)


class CalibrateForceJob(JobBody):
    """Calibrates the force sensor against known weights; the loop ends for it, and nothing moves."""

    kind: Literal["calibrate-force"]
    params: CalibrateForceParams
