"""The summary of `rig demo`."""

from collections.abc import Mapping

from rig.results.base import Result
from rig.results.diagnosis import DiagnosisResult
from rig.results.fit import FitResult
from rig.results.recorded import ReportResult
from rig.results.tracking import TrackResult


class HiddenTruth(Result):
    """What was hidden in the bench; ``named``: the diagnosis found it; ``inside``: whether intervals hold it."""

    effect: str
    parameters: Mapping[str, float]
    seed: int
    named: bool
    inside: Mapping[str, bool] = {}


class DemoSummary(ReportResult):
    """The whole demonstration, and what its report counts."""

    fit: FitResult
    tracking: TrackResult
    diagnosis: DiagnosisResult
    hidden: HiddenTruth
