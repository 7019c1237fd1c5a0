"""What a pain glove found: presses, the value by a stated rule, and whose it is."""

from pydantic import Field

from rig.config.glove import GloveCalibration
from rig.results.base import Result, SavedResult
from rig.results.tracking import Threshold


class PressSeen(Result):
    """One press with the glove; ``refused`` says why it does not count, and is empty where it does."""

    peak_N: float
    seconds: float
    refused: str = ""


class GloveThreshold(Threshold):
    """A threshold by glove; ``up_to_N`` is the most that it can measure."""

    subject: str = Field(description="code of the subject")
    site: str
    input: str = Field(description="name of the glove in the configuration")
    presses: tuple[PressSeen, ...]
    rule: str


class GloveCalibrated(SavedResult):
    """A glove's calibration, and the file it is kept in."""

    file: str
    calibration: GloveCalibration
