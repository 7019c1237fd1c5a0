"""Sessions as a laboratory leaves them: lists, results and the bytes of recordings, and none was recorded."""

import math
import shutil
from collections.abc import Mapping
from pathlib import Path

from pydantic import JsonValue

from rig.diagnosis.estimates import ErrorGain, Estimate, NamedCause
from rig.recording.sessions import SessionInfo, TrialInfo, write_session
from rig.results.diagnosis import DiagnosisResult
from rig.results.recorded import Quality
from rig.results.tracking import Threshold

MODEL = Path(__file__).parents[3] / "examples" / "forearm-model.json"
CREATED = "2026-11-20T10:00:00+00:00"
# What a closed recording ends with.
CLOSED = b"\x89MCAP0\r\n" * 2


def trial(number: int, quality: Quality = "good", repeats: str = "") -> TrialInfo:
    """An entry of a session's list; a bad one has a reason, a lost sample and no peak."""
    name = f"trial_{number:03d}" if not repeats else f"{repeats}_repeat_{number}"
    return TrialInfo(
        name=name,
        file=f"{name}.mcap",
        speed_mm_s=10.0,
        depth_mm=8.0,
        outcome="complete",
        peak_force_N=math.nan if quality == "bad" else 4.5,
        samples={"force": 1000, "axis": 500},
        dropped={"force": 1} if quality == "bad" else {},
        quality=quality,
        reasons=("force scatters by 0.3 N in the air",) if quality == "bad" else (),
        repeats=repeats,
    )


def make_session(
    root: Path,
    name: str,
    subject: Mapping[str, JsonValue] | None = None,
    created: str = CREATED,
    trials: tuple[TrialInfo, ...] = (),
) -> Path:
    """A session with its list and a file for each recording."""
    folder = root / name
    folder.mkdir(parents=True)
    listed = trials or (trial(1),)
    for each in listed:
        (folder / each.file).write_bytes(b"recorded" + CLOSED)
    about = {"id": "S01", "site": "forearm"} if subject is None else subject
    info = SessionInfo(
        id=name,
        kind="capture",
        created=created,
        software="tissue-rig 0.1.0",
        protocol={"name": "indentation"},
        subject=dict(about),
        trials=listed,
    )
    write_session(folder, info)
    return folder


def fitted(folder: Path) -> Path:
    """The session with a model."""
    (folder / "fit").mkdir()
    shutil.copy(MODEL, folder / "fit" / "model.json")
    (folder / "fit" / "fit.json").write_text("{}")
    return folder


def diagnosed(folder: Path, *causes: str) -> Path:
    """The session with a diagnosis that names ``causes`` as what cannot be told apart."""
    found = NamedCause(
        effects=causes,
        statement=f"it is {causes[0]}",
        confidence=0.97,
        parameters={},
        gain=ErrorGain(0.2, 0.1, 0.5, 0.4, 0.6),
        evidence_nats=40.0,
        p_value=0.001,
        repair="mend it",
        provisional=False,
    )
    result = DiagnosisResult(
        verdict="explained",
        statement=f"the simulation lacks {causes[0]}",
        simulation="index",
        session=folder.name,
        recordings=1,
        findings=(found,),
        unexplained=None,
        detectable={},
        not_testable={},
        next_experiment=None,
        data_quality=(),
        parameters={},
        simulation_error=(),
        explained_share=Estimate(0.8, 0.7, 0.9),
    )
    (folder / "diagnosis").mkdir()
    result.write(folder / "diagnosis" / "diagnosis.json")
    return folder


def with_threshold(folder: Path, force_N: float | None, recording: str = "track_001") -> Path:
    """The session with what `rig threshold` found."""
    Threshold(force_N=force_N, up_to_N=12.0, recording=f"{recording}.mcap").write(
        folder / f"{recording}.threshold.json"
    )
    return folder
