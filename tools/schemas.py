"""Writes the JSON Schema of every result: `python -m tools.schemas docs/reference/schemas`."""

import json
import sys
from collections.abc import Mapping
from pathlib import Path

from rig.results.base import Failure, Result
from rig.results.bench import CalibrateResult, DoctorResult, ResetResult, RetractResult
from rig.results.came_in import CameInResult
from rig.results.catalogue import (
    CatalogueResult,
    CauseList,
    DiagnosisList,
    ErasureResult,
    ModelList,
    NamesResult,
    SessionList,
    SiteList,
    SubjectExport,
    SubjectHistory,
    SubjectList,
    TrialList,
    WorkList,
)
from rig.results.cohort import CohortResult
from rig.results.demo import DemoSummary
from rig.results.devices import DevicesResult, FindResult
from rig.results.diagnosis import DiagnosisResult, ProtocolCheckResult
from rig.results.fit import FitResult
from rig.results.glove import GloveCalibrated, GloveThreshold
from rig.results.recorded import CaptureResult, ExportResult, ImportResult, RepairResult, ReportResult, VerifyResult
from rig.results.replay import ReplayResult
from rig.results.tracking import CompareResult, SimulateResult, Threshold, TrackResult

DIALECT = "https://json-schema.org/draft/2020-12/schema"
WRITTEN: Mapping[str, type[Result]] = {
    "capture": CaptureResult,
    "calibrate": CalibrateResult,
    "calibrate-glove": GloveCalibrated,
    "catalogue-causes": CauseList,
    "catalogue-diagnoses": DiagnosisList,
    "catalogue-models": ModelList,
    "catalogue-names": NamesResult,
    "catalogue-operations": WorkList,
    "catalogue-rebuild": CatalogueResult,
    "catalogue-sessions": SessionList,
    "catalogue-sites": SiteList,
    "catalogue-trials": TrialList,
    "cohort": CohortResult,
    "compare": CompareResult,
    "demo": DemoSummary,
    "diagnosis": DiagnosisResult,
    "devices": DevicesResult,
    "doctor": DoctorResult,
    "find": FindResult,
    "came-in": CameInResult,
    "export": ExportResult,
    "failure": Failure,
    "fit": FitResult,
    "import": ImportResult,
    "protocol-check": ProtocolCheckResult,
    "repair": RepairResult,
    "replay": ReplayResult,
    "report": ReportResult,
    "reset": ResetResult,
    "retract": RetractResult,
    "simulate": SimulateResult,
    "subject-erase": ErasureResult,
    "subject-export": SubjectExport,
    "subject-list": SubjectList,
    "subject-show": SubjectHistory,
    "threshold": Threshold,
    "threshold-glove": GloveThreshold,
    "track": TrackResult,
    "verify": VerifyResult,
}


def schemas() -> dict[str, str]:
    """The text of each schema by file name."""
    return {f"{name}.schema.json": _schema(kind) for name, kind in WRITTEN.items()}


def _schema(kind: type[Result]) -> str:
    return json.dumps({"$schema": DIALECT, **kind.model_json_schema(mode="serialization")}, indent=1) + "\n"


def main(folder: Path) -> None:
    """Replaces the schemas in ``folder``."""
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.schema.json"):
        old.unlink()
    for name, text in schemas().items():
        (folder / name).write_text(text)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
