"""What a ramp found is kept beside its recording, one file each, and nothing where the ramp was stopped otherwise."""

from pathlib import Path
from unittest.mock import Mock

import pytest

from controller.experiments import threshold, tracked
from controller.experiments.recorded import Recorded
from controller.loop.messages import Outcome
from controller.loop.steps import Hold, Program
from controller.supervisor import Supervisor
from rig.errors import RigError
from rig.results.tracking import Threshold

RAMP = Program(name="ramp", steps=(Hold(duration_s=1.0),))


def played(folder: Path, patch: pytest.MonkeyPatch, name: str, outcome: Outcome, force_N: float | None) -> Threshold:
    done = Recorded(folder / f"{name}.mcap", outcome, {}, {})
    patch.setattr(tracked, "recorded_run", lambda *_: done)
    patch.setattr(threshold, "force_at_stop", lambda _: force_N)
    return threshold.run(Mock(spec=Supervisor), RAMP, 10.0, folder, "model.json")


def test_each_ramp_of_a_session_keeps_its_own_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pain, whole = Outcome("pain_stop", "the subject", 6.2, None, None), Outcome("complete", "", 10.0, None, None)
    first = played(tmp_path, monkeypatch, "track_001", pain, 6.1)
    played(tmp_path, monkeypatch, "track_002", whole, None)
    assert Threshold.read(tmp_path / "track_001.threshold.json") == first
    assert (first.force_N, first.recording) == (6.1, "track_001.mcap")
    assert Threshold.read(tmp_path / "track_002.threshold.json").force_N is None


def test_another_stop_is_no_threshold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RigError):
        played(tmp_path, monkeypatch, "track_001", Outcome("force_limit", "force 12 N", 12.0, None, None), None)
    assert list(tmp_path.iterdir()) == []
