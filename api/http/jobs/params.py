"""What each kind of job is asked for: strict, bounded, named as the command's options are, with units."""

from typing import Annotated, Generic, Literal, Self, TypeVar

from pydantic import Field, model_validator

from api.http.models import Name, RequestBody
from rig.recording.export import Format

Existing = Annotated[str, Field(min_length=1, max_length=255, description="name of a session as /sessions lists it")]
Upload = Annotated[str, Field(pattern=r"^[0-9a-f]{12}$", description="id as /uploads gave it")]
Only = Annotated[str, Field(max_length=200, description="of the recordings those called so, for example pork*")]
MappingText = Annotated[str, Field(max_length=30_000, description="mapping of an upload as TOML; empty: its own")]
Protocol = Annotated[Name, Field(description="name of a protocol as /protocols lists it")]
NewSession = Annotated[Name, Field(description="name of the new session")]
Force = Annotated[float, Field(gt=0, le=1000)]
Point = Annotated[list[float], Field(min_length=2, max_length=2)]
# As of a reference's file (`controller.experiments.references.MOST_POINTS`); they fit into a request's 64 kB.
MOST_POINTS = 4000
# A person compares a handful of sessions; twenty are a study's.
MOST_SESSIONS = 20
KindName = TypeVar("KindName", bound=str)
Params = TypeVar("Params", bound=RequestBody)


class JobBody(RequestBody):
    """Root of what starts a job."""


class JobOf(JobBody, Generic[KindName, Params]):
    """One kind of job, by its name, and what that is asked for."""

    kind: KindName
    params: Params


class ModelRef(RequestBody):
    """A model: of a fit, or the extended one of a diagnosis."""

    session: Existing
    file: Literal["fit", "diagnosis"] = "fit"


class NothingAsked(RequestBody):
    """No parameters."""


class DataPlace(RequestBody):
    """What is worked on: a session, or files of any laboratory as they were uploaded."""

    session: Existing | None = None
    upload: Upload | None = None
    only: Only = ""
    mapping: MappingText = ""

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.session is None) == (self.upload is None):
            raise ValueError("give either session or upload")
        if self.mapping and self.upload is None:
            raise ValueError("mapping says what an upload holds; a session says it itself")
        return self


class ForceOverTime(RequestBody):
    """A force over time; one of the three."""

    reference: str = Field(default="", max_length=300, description="as of --reference: step:5,duration_s=3")
    points: list[Point] = Field(default=[], max_length=MOST_POINTS, description="[time_s, force_N], joined by lines")


class CaptureParams(RequestBody):
    """A protocol, recorded into a new session."""

    protocol: Protocol
    session: NewSession


class TrackParams(ForceOverTime):
    """Force tracking with a law made from a model."""

    model: ModelRef
    session: Existing | None = Field(default=None, description="where it is recorded; null: the model's, if theirs")
    forces_N: list[Force] = Field(default=[], max_length=20)
    seconds: float = Field(default=10.0, gt=1, le=600, description="on each of forces_N")
    against: ModelRef | None = Field(default=None, description="another model, tracked with first")

    @model_validator(mode="after")
    def _one(self) -> Self:
        if sum(map(bool, (self.forces_N, self.reference, self.points))) != 1:
            raise ValueError("give one of forces_N, reference and points")
        return self


class ThresholdParams(RequestBody):
    """A slow ramp that the subject stops."""

    model: ModelRef
    up_to_N: Force
    rate_N_s: float = Field(default=0.5, gt=0, le=10)
    session: Existing | None = Field(default=None, description="where it is recorded; null: the model's, if theirs")


class GloveThresholdParams(RequestBody):
    """Three presses with the glove at the subject's site; nothing of the bench moves."""

    session: Existing = Field(description="where it is recorded")
    input: str = Field(default="", max_length=24, description="name of the glove, where there are several")


class LatticeParams(RequestBody):
    """The mass-spring lattice, spring by spring."""

    block: str = Field(default="51x51x40@1", max_length=40, description="vertices, and their spacing in mm")
    springs: Literal["stabilised", "study"] = "stabilised"
    per_spring: bool = False


class FitParams(RequestBody):
    """Tissue laws on sessions, or on an upload."""

    sessions: list[Existing] = Field(default=[], max_length=MOST_SESSIONS)
    upload: Upload | None = None
    only: Only = ""
    mapping: MappingText = ""
    laws: list[Annotated[str, Field(max_length=40)]] = Field(
        default=[], max_length=40, description="further laws to compare; all: every one there is"
    )
    known: dict[str, float] = Field(default={}, max_length=20, description="parameters that are not fitted")
    model: str = Field(default="index", max_length=40, description="the law that the model holds")
    extended: ModelRef | None = Field(default=None, description="also the law of this model, its causes as known")
    lattice: LatticeParams | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if bool(self.sessions) == (self.upload is not None):
            raise ValueError("give either sessions or upload")
        if self.mapping and self.upload is None:
            raise ValueError("mapping says what an upload holds; a session says it itself")
        return self


class DiagnoseParams(DataPlace):
    """What the simulation gets wrong, and why."""

    simulation: Literal["index", "constant"] = "index"
    detectability: bool = Field(default=False, description="plants causes not found, to see from what size")
    reference: MappingText = Field(default="", description="TOML: models of others to simulate a drive axis with")


class ProtocolCheckParams(RequestBody):
    """Which causes a protocol could show."""

    protocol: Protocol
    model: ModelRef | None = Field(default=None, description="of the tissue; null: a limb like the mock bench's")
    tracker: bool = True
    rate_Hz: float = Field(default=1000.0, ge=10, le=100_000)


class SimulateParams(ForceOverTime):
    """A reference on a model, on a virtual clock."""

    model: ModelRef
    stiffness: float = Field(default=1.0, ge=0.1, le=10, description="how much stiffer the tissue is than the model")
    breathing_mm: float = Field(default=0.0, ge=0, le=10)

    @model_validator(mode="after")
    def _one(self) -> Self:
        if bool(self.reference) == bool(self.points):
            raise ValueError("give either reference or points")
        return self


class ExportParams(DataPlace):
    """Recordings in other formats."""

    formats: list[Format] = Field(default=[], max_length=4, description="empty: all")


class VerifyParams(RequestBody):
    """Every byte of a session, or of one recording."""

    session: Existing
    recording: Annotated[str, Field(max_length=255)] = ""


class RepairParams(RequestBody):
    """Every good sample of a recording that is not whole."""

    session: Existing
    recording: Annotated[str, Field(min_length=1, max_length=255)]


class ProposeParams(RequestBody):
    """What an upload seems to hold."""

    upload: Upload


class ImportParams(RequestBody):
    """A session made of an upload."""

    upload: Upload
    session: NewSession
    mapping: MappingText = Field(default="", description="as TOML; empty: that of the files, else the one proposed")
    answers: list[Annotated[str, Field(max_length=200)]] = Field(
        default=[], max_length=20, description="to the questions of a proposal, in their order"
    )
    usual: bool = Field(default=False, description="takes the usual answers")
