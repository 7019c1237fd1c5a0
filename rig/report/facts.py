"""What a session has to tell, read from its recordings; a part that is missing is a sentence in place of the part."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from rig.errors import DataError, UsageError
from rig.progress import Progress, silent
from rig.recording.reader import Recording
from rig.recording.sessions import Session, TrialInfo
from rig.recording.verify import Verdict, verdict_of
from rig.report.came_in import CameIn, came_in_of
from rig.report.diagnosed import Diagnosed, read_diagnosis
from rig.report.figures import Tracked
from rig.report.fitted import Fitted, read_fit
from rig.report.values import json_table
from rig.results.tracking import FILE, TrackResult
from rig.tissue.laws import FloatArray

AGES = {"force": "force_age_ns", "axis": "axis_age_ns", "marker": "marker_age_ns"}
# An input that never came has no age; the loop says so with a number no age can be.
OLDEST_NS = 3_600_000_000_000

Part = TypeVar("Part")


@dataclass(frozen=True)
class TrialFacts:
    """One recording of the session with its verdict."""

    info: TrialInfo
    verdict: Verdict | str

    @property
    def samples(self) -> int:
        """Of all streams; as the session lists them where the recording cannot be read."""
        if isinstance(self.verdict, str):
            return sum(self.info.samples.values())
        return sum(stream.samples for stream in self.verdict.streams.values())

    @property
    def dropped(self) -> int:
        """As above."""
        if isinstance(self.verdict, str):
            return sum(self.info.dropped.values())
        return sum(stream.dropped for stream in self.verdict.streams.values())


@dataclass(frozen=True)
class LoopFacts:
    """The loop over all recordings: times in microseconds a cycle, shape (n,); ages by input."""

    wake_us: FloatArray
    execution_us: FloatArray
    period_us: float
    ages_us: Mapping[str, FloatArray]
    cycles: int
    missed: int


@dataclass(frozen=True)
class TrackingFacts:
    """A force-tracking run: its columns, and what `rig track` said of it."""

    run: Tracked
    result: TrackResult | str


@dataclass(frozen=True)
class Facts:
    """Everything the report shows. A text in place of a part says why the part is missing."""

    session: Session
    trials: tuple[TrialFacts, ...]
    fit: Fitted | str
    tracking: TrackingFacts | str
    loop: LoopFacts | str
    devices: Mapping[str, Mapping[str, object]]
    realtime: Mapping[str, str]
    metadata: Mapping[str, Mapping[str, str]]
    diagnosis: Diagnosed | str
    came_in: CameIn


def gather(session: Session, results: Path, tell: Progress = silent) -> Facts:
    """Reads the session, and what was found of it and is kept in the folder ``results``."""
    recordings, trials = _read(session, tell)
    metadata = next((recording.metadata for recording in recordings.values() if recording.metadata), {})
    return Facts(
        session=session, trials=trials, fit=read_fit(session, results), tracking=_tracking(results, recordings),
        loop=_loop(list(recordings.values())),
        devices={role: json_table(text) for role, text in metadata.get("devices", {}).items() if role != "crc32"},
        realtime=metadata.get("realtime", {}), metadata=metadata, diagnosis=read_diagnosis(results, session.place),
        came_in=came_in_of(session),
    )  # fmt: skip


def _read(session: Session, tell: Progress) -> tuple[dict[str, Recording], tuple[TrialFacts, ...]]:
    """The recordings that open, and what is known of each trial."""
    found: dict[str, Recording] = {}
    trials: list[TrialFacts] = []
    for number, info in enumerate(session.trials):
        tell(f"reading {info.file}", 0.9 * number / len(session.trials))
        try:
            found[info.name] = session.recording(info.name)
        except DataError as error:
            trials.append(TrialFacts(info, str(error)))
        else:
            trials.append(TrialFacts(info, verdict_of(found[info.name])))
    return found, tuple(trials)


def _tracking(results: Path, recordings: Mapping[str, Recording]) -> TrackingFacts | str:
    runs = [name for name, recording in recordings.items() if recording.tracks_force]
    if not runs:
        return "No force was tracked in this session; `rig track --model MODEL --force 5 --out SESSION` adds a run."
    loop = recordings[runs[-1]].tables["loop"]
    loop = loop[np.isfinite(loop["reference_N"])]
    if not len(loop):
        return f"The tracking run {runs[-1]} never came into contact."
    time_s = (loop["capture_ns"] - loop["capture_ns"][0]) * 1e-9
    return TrackingFacts(Tracked(time_s, loop["reference_N"], loop["force_N"]), _result(results / FILE))


def _result(path: Path) -> TrackResult | str:
    try:
        return TrackResult.read(path)
    except (OSError, UsageError) as error:
        return f"No table of reference and actual force: {error}."


def _loop(recordings: Sequence[Recording]) -> LoopFacts | str:
    tables = [recording.tables["loop"] for recording in recordings if len(recording.tables["loop"]) > 1]
    if not tables:
        return "No loop ran in this session (it was imported), so there is no timing to show."
    rows = np.concatenate(tables)
    return LoopFacts(
        wake_us=rows["wake_latency_ns"] * 1e-3,
        execution_us=rows["execution_ns"] * 1e-3,
        period_us=float(np.median(np.concatenate([np.diff(table["scheduled_ns"]) for table in tables]))) * 1e-3,
        ages_us={name: ages for name, field in AGES.items() if len(ages := _ages(rows[field]))},
        cycles=len(rows),
        missed=sum(int(table["missed"][-1] - table["missed"][0]) for table in tables),
    )


def _ages(ages_ns: FloatArray) -> FloatArray:
    return np.asarray(ages_ns[(ages_ns >= 0) & (ages_ns < OLDEST_NS)] * 1e-3)
