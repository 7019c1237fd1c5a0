"""What `rig diagnose` and `rig protocol check` found."""

from collections.abc import Mapping

from pydantic import AliasChoices, Field

from rig.diagnosis.estimates import (
    Estimate,
    NamedCause,
    NextExperiment,
    SimulationError,
    SmallestSize,
    Unexplained,
    Verdict,
)
from rig.results.base import Result, SavedResult
from rig.trials.findings import Finding

FOLDER, FILE, MODEL, TRUTH = "diagnosis", "diagnosis.json", "model.json", "truth.txt"
PICTURES = ("simulation", "residuals", "evidence", "confusability")


class DiagnosisResult(SavedResult):
    """What the simulation gets wrong on a session, the causes by name, and what they take off the error."""

    verdict: Verdict
    statement: str = Field(description="the whole in one sentence")
    simulation: str
    session: str
    recordings: int
    findings: tuple[NamedCause, ...]
    unexplained: Unexplained | None
    detectable: Mapping[str, SmallestSize] = Field(description="causes not found, and from what size they would be")
    not_testable: Mapping[str, str]
    next_experiment: NextExperiment | None
    data_quality: tuple[Finding, ...] = Field(validation_alias=AliasChoices("data_quality", "quality"))
    parameters: Mapping[str, Estimate] = Field(
        validation_alias=AliasChoices("parameters", "base"), description="of the simulation, causes included"
    )
    simulation_error: tuple[SimulationError, ...] = Field(
        validation_alias=AliasChoices("simulation_error", "simulated")
    )


class AmbiguousPair(Result):
    """Two causes, and how many of 50 nats of evidence for one are left once the other imitates it."""

    pair: tuple[str, str]
    nats: float


class Confusion(Result):
    """``matrix[e][f]`` is what is left of ``of`` nats of evidence for cause e once f imitates it."""

    of: float
    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


class ProtocolCheckResult(SavedResult):
    """What a protocol can show before anything is recorded."""

    duration_s: float
    cycles: int
    detectable: Mapping[str, SmallestSize]
    not_testable: Mapping[str, str]
    not_separable: tuple[AmbiguousPair, ...]
    ambiguous: tuple[AmbiguousPair, ...]
    confusion_nats: Confusion
