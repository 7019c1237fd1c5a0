"""What was found in each session of a cohort, and what its subjects share."""

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from rig.results.base import Result, SavedResult

FILE = "cohort.json"


class CohortSession(Result):
    """One session, or one part of one. ``kept``: its result was there already; ``failed``: ``reason`` says why it has
    none.
    """

    session: str
    subject: str = Field(description="or the specimen, site, operator or recording that the part is of")
    state: Literal["done", "kept", "failed"]
    seconds: float = Field(description="of one core, where it was worked on")
    folder: str = Field(default="", description="where its results are, below the cohort's own")
    reason: str = ""
    parameters: Mapping[str, float] = Field(default={}, description="of a fit: those of its model")
    worst_percent: float | None = Field(
        default=None, description="of a fit: the largest error of a displacement, if possible of trials left out"
    )
    verdict: str = Field(default="", description="of a diagnosis")
    causes: tuple[str, ...] = Field(default=(), description="of a diagnosis: what it named")


class PopulationParameter(Result):
    """A parameter over subjects: their mean, and how they and one subject's sessions differ (standard deviations)."""

    unit: str
    subjects: int
    sessions: int
    mean: float
    mean_interval: tuple[float, float]
    between: float = Field(description="of subjects; of sessions too where `within` is null")
    between_interval: tuple[float, float]
    within: float | None = Field(description="of one subject's sessions; null where nobody came twice")


class CohortResult(SavedResult):
    """Every session by itself, then all together."""

    work: Literal["fit", "diagnose", "report"]
    by: Literal["specimen", "site", "operator", "recording"] | None = Field(
        default=None, description="what tells the parts apart that were worked on; null: sessions as they are"
    )
    sessions: tuple[CohortSession, ...]
    model_law: str = Field(default="", description="of a fit: the law whose parameters these are")
    parameters: Mapping[str, PopulationParameter] = Field(
        default={}, description="random effects of subject and session, by restricted maximum likelihood"
    )
    interval_level: float
    causes: Mapping[str, int] = Field(default={}, description="of diagnoses: sessions in which each was named")
    remarks: tuple[str, ...] = ()

    @property
    def failed(self) -> tuple[CohortSession, ...]:
        """Sessions without a result."""
        return tuple(each for each in self.sessions if each.state == "failed")
