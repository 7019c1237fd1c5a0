"""Every kind of job: what it is asked for, what it gives, which command it is, and what does it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from pydantic import Field

from api.http.cohorts.params import DiagnoseCohortJob, FitCohortJob, ReportCohortJob
from api.http.commissioning.params import CALIBRATIONS, AnyCalibrated, AnyCalibrationJob
from api.http.jobs.params import (
    CaptureParams,
    DataPlace,
    DiagnoseParams,
    ExportParams,
    FitParams,
    GloveThresholdParams,
    ImportParams,
    JobBody,
    JobOf,
    NothingAsked,
    ProposeParams,
    ProtocolCheckParams,
    RepairParams,
    SimulateParams,
    ThresholdParams,
    TrackParams,
    VerifyParams,
)
from api.http.jobs.proposal import ProposalResult
from api.http.models import RequestBody
from rig.results.base import SavedResult
from rig.results.bench import DoctorResult, RetractResult
from rig.results.cohort import CohortResult
from rig.results.diagnosis import DiagnosisResult, ProtocolCheckResult
from rig.results.fit import FitResult
from rig.results.glove import GloveThreshold
from rig.results.recorded import CaptureResult, ExportResult, ImportResult, RepairResult, ReportResult, VerifyResult
from rig.results.tracking import SimulateResult, Threshold, TrackResult

AnyResult = (
    CaptureResult | TrackResult | RetractResult | GloveThreshold | Threshold | DoctorResult | FitResult
    | DiagnosisResult | ProtocolCheckResult | SimulateResult | ReportResult | ExportResult | VerifyResult | RepairResult
    | ProposalResult | ImportResult | CohortResult | AnyCalibrated
)  # fmt: skip


class CaptureJob(JobOf[Literal["capture"], CaptureParams]):
    """Runs a protocol and records every trial."""


class TrackJob(JobOf[Literal["track"], TrackParams]):
    """Tracks a force with a law made from a model."""


class RetractJob(JobOf[Literal["retract"], NothingAsked]):
    """Moves the tip out, after a stop that was acknowledged."""

    params: NothingAsked = NothingAsked()


class ThresholdJob(JobOf[Literal["threshold"], ThresholdParams]):
    """Raises force slowly until the subject stops it."""


class GloveThresholdJob(JobOf[Literal["threshold-glove"], GloveThresholdParams]):
    """Takes the subject's pain threshold at a site from presses with a glove."""


class DoctorJob(JobOf[Literal["doctor"], NothingAsked]):
    """Looks at each device without moving anything."""

    params: NothingAsked = NothingAsked()


class FitJob(JobOf[Literal["fit"], FitParams]):
    """Fits tissue laws, and the lattice where asked for."""


class DiagnoseJob(JobOf[Literal["diagnose"], DiagnoseParams]):
    """Says what the simulation gets wrong, names the cause and extends the model."""


class ProtocolCheckJob(JobOf[Literal["protocol-check"], ProtocolCheckParams]):
    """Says before any recording which causes a protocol can show."""


class SimulateJob(JobOf[Literal["simulate"], SimulateParams]):
    """Plays a reference on a model before anything real moves."""


class ReportJob(JobOf[Literal["report"], DataPlace]):
    """Writes one self-contained page."""


class ExportJob(JobOf[Literal["export"], ExportParams]):
    """Writes recordings as CSV, Parquet, HDF5 and MAT."""


class VerifyJob(JobOf[Literal["verify"], VerifyParams]):
    """Reads every byte and says what is complete, missing or damaged."""


class RepairJob(JobOf[Literal["repair"], RepairParams]):
    """Saves every good sample of a recording as a new one."""


class ProposeJob(JobOf[Literal["propose"], ProposeParams]):
    """Proposes a mapping for an upload, with what is doubtful and what to ask."""


class ImportJob(JobOf[Literal["import"], ImportParams]):
    """Makes a session of an upload."""


AnyJob = Annotated[
    CaptureJob | TrackJob | RetractJob | ThresholdJob | GloveThresholdJob | DoctorJob | FitJob | DiagnoseJob
    | ProtocolCheckJob | SimulateJob | ReportJob | ExportJob | VerifyJob | RepairJob | ProposeJob | ImportJob
    | FitCohortJob | DiagnoseCohortJob | ReportCohortJob | AnyCalibrationJob,
    Field(discriminator="kind"),
]  # fmt: skip


@dataclass(frozen=True)
class Kind:
    """``work`` names the function that a process of its own calls; without one it uses the bench of the service.

    One with ``work`` that ``moves`` has the bench's ports to itself meanwhile: the service's loop ends.
    """

    body: type[JobBody]
    result: type[SavedResult]
    command: str
    work: str = ""
    moves: bool = False
    pausable: bool = False
    """Between two parts of it, with the tip out."""

    @property
    def name(self) -> str:
        """As requests and views say it."""
        (name,) = get_args(self.body.model_fields["kind"].annotation)
        return str(name)

    @property
    def params(self) -> type[RequestBody]:
        """What it is asked for."""
        found = self.body.model_fields["params"].annotation
        assert isinstance(found, type) and issubclass(found, RequestBody)
        return found


RECORDINGS, SCIENCE = (f"api.http.jobs.work_{part}" for part in ("recordings", "science"))
COHORT, COMMISSIONING = "api.http.cohorts.work", "api.http.commissioning.work"
KINDS: Mapping[str, Kind] = {
    kind.name: kind
    for kind in (
        Kind(CaptureJob, CaptureResult, "capture", moves=True, pausable=True),
        Kind(TrackJob, TrackResult, "track", moves=True),
        Kind(RetractJob, RetractResult, "reset", moves=True),
        Kind(ThresholdJob, Threshold, "threshold", moves=True),
        Kind(GloveThresholdJob, GloveThreshold, "threshold", moves=True),
        Kind(DoctorJob, DoctorResult, "doctor", f"{COMMISSIONING}:doctor"),
        Kind(FitJob, FitResult, "fit", f"{SCIENCE}:fit"),
        Kind(DiagnoseJob, DiagnosisResult, "diagnose", f"{SCIENCE}:diagnose"),
        Kind(ProtocolCheckJob, ProtocolCheckResult, "protocol", f"{SCIENCE}:protocol_check"),
        Kind(SimulateJob, SimulateResult, "simulate", f"{SCIENCE}:simulate"),
        Kind(ReportJob, ReportResult, "report", f"{RECORDINGS}:report"),
        Kind(ExportJob, ExportResult, "export", f"{RECORDINGS}:export"),
        Kind(VerifyJob, VerifyResult, "verify", f"{RECORDINGS}:verify"),
        Kind(RepairJob, RepairResult, "repair", f"{RECORDINGS}:repair"),
        Kind(ProposeJob, ProposalResult, "import", f"{RECORDINGS}:propose_mapping"),
        Kind(ImportJob, ImportResult, "import", f"{RECORDINGS}:import_upload"),
        Kind(FitCohortJob, CohortResult, "fit", f"{COHORT}:fit_cohort"),
        Kind(DiagnoseCohortJob, CohortResult, "diagnose", f"{COHORT}:diagnose_cohort"),
        Kind(ReportCohortJob, CohortResult, "report", f"{COHORT}:report_cohort"),
        *(Kind(body, result, command, f"{COMMISSIONING}:{does}", moves=True)
          for body, result, command, does in CALIBRATIONS),
    )
}  # fmt: skip
