"""A run with another person's model is no run of that person: it goes into a session of its own."""

import re
from pathlib import Path
from typing import cast

import pytest

from api.http.jobs.kinds import AnyJob, ThresholdJob, TrackJob
from api.http.jobs.motion import planned
from api.http.jobs.params import ModelRef, ThresholdParams, TrackParams
from api.http.jobs.places import Places
from controller.experiments.capture import new_session
from controller.supervisor import Supervisor
from rig.config.wiring import Wiring
from tests.api.jobs.test_verbs import WiredBench

MODEL = Path(__file__).parents[3] / "examples" / "forearm-model.json"
THEIRS = ModelRef(session="arm")


def wired(subject: str) -> Wiring:
    return Wiring.model_validate({"subject": {"id": subject}})


@pytest.fixture
def places(tmp_path: Path) -> Places:
    """With the session of S07 and its model."""
    found = Places(*(tmp_path / name for name in ("sessions", "protocols", "uploads", "files")))
    new_session(found.sessions / "arm", "capture", {"kind": "indentation"}, wired("S07"))
    (found.sessions / "arm" / "fit").mkdir()
    (found.sessions / "arm" / "fit" / "model.json").write_text(MODEL.read_text())
    return found


def session_of(body: AnyJob, subject: str, places: Places) -> str:
    bench = WiredBench()
    bench.wiring = wired(subject)
    return planned(body, cast(Supervisor, bench), places).session or ""


@pytest.mark.parametrize(
    "body",
    [
        TrackJob(kind="track", params=TrackParams(model=THEIRS, forces_N=[1.0])),
        ThresholdJob(kind="threshold", params=ThresholdParams(model=THEIRS, up_to_N=5.0)),
    ],
)
def test_it_goes_into_the_model_s_session_only_for_whom_that_is_of(body: AnyJob, places: Places) -> None:
    assert session_of(body, "S07", places) == "arm"
    assert re.fullmatch(r"\d{8}-\d{6}", session_of(body, "S99", places))


def test_a_session_that_is_stated_is_the_one(places: Places) -> None:
    body = TrackJob(kind="track", params=TrackParams(model=THEIRS, forces_N=[1.0], session="arm"))
    assert session_of(body, "S99", places) == "arm"
