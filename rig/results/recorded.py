"""What commands on recordings say: capture, verify, repair, import, export, report."""

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from rig.recording.sessions import TrialInfo
from rig.recording.verify import StreamVerdict
from rig.results.base import Number, Result, SavedResult
from rig.results.came_in import CameInResult
from rig.results.tracking import LoopCount

Quality = Literal["", "good", "usable", "bad"]


class CapturedTrial(Result):
    """One trial of a capture; ``surface_mm`` is where the surface was found, with its 95 % interval."""

    name: str
    speed_mm_s: Number
    outcome: str
    peak_force_N: Number
    quality: Quality
    reasons: tuple[str, ...]
    measured: Mapping[str, Number]
    repeats: str
    surface_mm: tuple[Number, Number, Number]


def captured_trial(info: TrialInfo) -> CapturedTrial:
    """What a session lists of a trial."""
    surface_mm = (info.surface_mm, info.surface_low_mm, info.surface_high_mm)
    return CapturedTrial.model_validate({**vars(info), "surface_mm": surface_mm})


class CaptureResult(SavedResult):
    """A session that was captured."""

    session: str
    recordings: int
    samples: int
    dropped: int
    trials: tuple[CapturedTrial, ...]
    bad: tuple[str, ...] = Field(default=(), description="trials that stayed bad, however often they were made again")


class RecordingResult(Result):
    """What a recording proves about itself."""

    state: Literal["complete", "incomplete", "damaged"]
    ok: bool
    sentence: str
    damage: tuple[str, ...]
    streams: Mapping[str, StreamVerdict]


class RepairResult(SavedResult, RecordingResult):
    """The recording that was made of the good samples of another."""


class VerifiedTrial(RecordingResult):
    """A recording with the quality of its trial; empty where nobody judged it."""

    quality: Quality = ""
    reasons: tuple[str, ...] = ()
    measured: Mapping[str, Number] = {}


class VerifyResult(SavedResult):
    """Whether a session, or one recording, is whole."""

    ok: bool
    remarks: tuple[str, ...]
    recordings: Mapping[str, VerifiedTrial]


class ImportResult(SavedResult):
    """A session that was made of measured files; ``samples`` by stream."""

    session: str
    recordings: int
    samples: Mapping[str, int]
    remarks: tuple[str, ...]
    trials: tuple[TrialInfo, ...] = Field(default=(), exclude=True)
    came_in: CameInResult | None = Field(default=None, description="null in files of earlier versions")


class ExportResult(SavedResult):
    """What was written, by format."""

    session: str
    written: Mapping[str, str]
    remarks: tuple[str, ...] = Field(default=(), description="what was doubtful or not as it should be")


class ReportResult(SavedResult):
    """The page that was written about a session, and what its recordings hold and lost."""

    session: str
    file: str
    recordings: int
    samples: int
    dropped: int
    loop: LoopCount | None = Field(description="null where no loop ran")
