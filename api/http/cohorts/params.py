"""What a job on a cohort is asked for: many sessions, each by itself, in parallel on the service's own computer."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from api.http.jobs.params import Existing, JobOf, Only
from api.http.models import RequestBody
from api.operations.cohort.wanted import By

# Names of 1,000 sessions fit into a request's 64 kB; a larger cohort is one for the command line and its cluster.
MOST_IN_COHORT = 1000


class CohortParams(RequestBody):
    """Sessions, or the parts of each, each worked on by itself."""

    sessions: list[Existing] = Field(min_length=1, max_length=MOST_IN_COHORT)
    only: Only = ""
    by: By | None = Field(default=None, description="works on each part of a session that this label tells apart")

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        if len(set(self.sessions)) < len(self.sessions):
            raise ValueError("give each session once")
        return self


class FitCohortParams(CohortParams):
    """Tissue laws on each session, and what subjects share."""

    laws: list[Annotated[str, Field(max_length=40)]] = Field(default=[], max_length=40, description="further laws")
    known: dict[str, float] = Field(default={}, max_length=20, description="parameters that are not fitted")
    model: str = Field(default="index", max_length=40, description="the law that is summarised over subjects")


class DiagnoseCohortParams(CohortParams):
    """What the simulation gets wrong on each session."""

    simulation: Literal["index", "constant"] = "index"
    detectability: bool = Field(default=False, description="plants causes not found, to see from what size")


class FitCohortJob(JobOf[Literal["fit-cohort"], FitCohortParams]):
    """Fits each session of a cohort by itself, and says what subjects share."""


class DiagnoseCohortJob(JobOf[Literal["diagnose-cohort"], DiagnoseCohortParams]):
    """Diagnoses each session of a cohort by itself."""


class ReportCohortJob(JobOf[Literal["report-cohort"], CohortParams]):
    """Writes a page about each session of a cohort."""
