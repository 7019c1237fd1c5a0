"""What commands on the bench itself say: doctor, calibrate, reset, retract."""

from typing import Literal

from pydantic import Field, computed_field

from rig.config.calibration import AnyCalibration
from rig.results.base import Result, SavedResult

Act = Literal["clear", "retract", "home"]


class DeviceReport(Result):
    """What was seen of one device; ``problem`` is empty if it is fit for use, ``advice`` is where to look if silent."""

    role: str
    product: str = ""
    serial: str = ""
    firmware: str = ""
    rate_Hz: float = 0.0
    noise: str = ""
    latency_ms: float = 0.0
    range: str = ""
    bus: str = Field(default="", description="load and errors of the bus that it is on, where it is on one")
    settings: dict[str, str] = Field(default={}, description="what else it says of itself")
    problem: str = ""
    advice: str = ""


class DoctorResult(SavedResult):
    """All devices of the bench."""

    devices: tuple[DeviceReport, ...]


class CalibrateResult(SavedResult):
    """A calibration, and the file it is kept in."""

    file: str
    calibration: AnyCalibration


class Question(Result):
    """A consent that is needed before more is done."""

    act: Act
    question: str


class ResetResult(SavedResult):
    """How far recovery went."""

    happened: tuple[str, ...] = Field(description="what happened and how things stood, for a person")
    done: tuple[str, ...] = ()
    open: tuple[Question, ...] = Field(default=(), description="what must be agreed to before more is done")
    missing: str = Field(default="", description="devices that are still not ok; empty if none")

    @computed_field(description="the bench can be used again")  # type: ignore[prop-decorator]
    @property
    def ready(self) -> bool:
        """Whether the bench can be used again."""
        return not self.open and not self.missing


class RetractResult(SavedResult):
    """How a retraction ended."""

    outcome: str
