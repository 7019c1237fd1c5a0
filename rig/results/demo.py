"""The summary of `rig demo`."""

from collections.abc import Mapping

from rig.diagnosis.estimates import NamedCause, Verdict
from rig.results.base import Result, SavedResult
from rig.results.fit import FitResult
from rig.results.tracking import LoopCount, Plateau


class RecordingCounts(Result):
    """What all recordings of the session hold and lost."""

    recordings: int
    samples: int
    dropped: int
    loop: LoopCount


class DemoTracking(Result):
    """The tracking run in short."""

    max_error_percent: float | None
    rms_error_N: float | None
    levels: tuple[Plateau, ...]


class HiddenTruth(Result):
    """What was hidden in the bench."""

    effect: str
    parameters: Mapping[str, float]


class DemoDiagnosis(Result):
    """What the diagnosis said, and last what is true; ``named``: it found the cause that was hidden."""

    verdict: Verdict
    statement: str
    findings: tuple[NamedCause, ...]
    named: bool
    seed: int
    truth: HiddenTruth


class DemoSummary(SavedResult, RecordingCounts):
    """The whole demonstration."""

    fit: FitResult
    tracking: DemoTracking
    diagnosis: DemoDiagnosis
