"""What `rig diagnose` and `rig protocol check` found."""

from collections.abc import Mapping

from pydantic import AliasChoices, AliasPath, Field

from rig.diagnosis.estimates import (
    AxisPrediction,
    Estimate,
    NamedCause,
    NextExperiment,
    OwnSpread,
    SimulationError,
    SmallestSize,
    Unexplained,
    Verdict,
)
from rig.results.base import Number, Result, SavedResult
from rig.trials.findings import Finding

FOLDER, FILE, MODEL, TRUTH = "diagnosis", "diagnosis.json", "model.json", "truth.txt"
MOCK_LIMB = "a limb like the mock bench's"
PICTURES = ("share", "simulation", "residuals", "evidence", "confusability")


def _of_budget(name: str) -> AliasChoices:
    """The key, or where a diagnosis keeps it."""
    return AliasChoices(name, AliasPath("budget", name))


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
    explained_share: Estimate | None = Field(
        default=None,
        validation_alias=AliasChoices(
            "explained_share", AliasPath("budget", "explained_share"), AliasPath("axis", "explained_share")
        ),
        description="of the power of the error that could be taken off, what the causes named take off",
    )
    base_N: Number = Field(
        default=None,
        validation_alias=_of_budget("base_N"),
        description="error of the simulation as it is on recordings left out, each with its own contact, zero and "
        "stiffness as the causes named leave them; with terms of their own are those below, too",
    )
    extended_N: Number = Field(
        default=None, validation_alias=_of_budget("extended_N"), description="with the causes named"
    )
    flexible_N: Number = Field(
        default=None, validation_alias=_of_budget("flexible_N"), description="of a tissue of any form and memory"
    )
    floor_N: Number = Field(
        default=None, validation_alias=_of_budget("floor_N"), description="the smallest that any of them reached"
    )
    noise_N: Number = Field(default=None, validation_alias=_of_budget("noise_N"), description="of force at rest")
    repeatability_N: Number = Field(
        default=None,
        validation_alias=_of_budget("repeatability_N"),
        description="by how much repeats of one motion differ",
    )
    shared_by_repeats: Estimate | None = Field(
        default=None,
        validation_alias=_of_budget("shared_by_repeats"),
        description="power that the errors of repeats have in common, over what they differ by",
    )
    scatter: Mapping[str, OwnSpread] = Field(
        default={},
        validation_alias=_of_budget("scatter"),
        description="how recordings differ in contact, zero and stiffness",
    )
    stiffness_N_mm: Number = Field(
        default=None,
        validation_alias=_of_budget("stiffness_N_mm"),
        description="of the tissue where the tip presses: it turns an error of force into one of depth",
    )
    axis: AxisPrediction | None = Field(default=None, description="of a drive axis; its effort has a unit of its own")


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

    tissue: str = Field(default=MOCK_LIMB, description="what the protocol was laid out on; its noise is assumed")
    duration_s: float
    cycles: int
    detectable: Mapping[str, SmallestSize]
    not_testable: Mapping[str, str]
    not_separable: tuple[AmbiguousPair, ...]
    ambiguous: tuple[AmbiguousPair, ...]
    confusion_nats: Confusion
