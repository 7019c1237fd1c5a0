"""A bad trial is made again, under a name of its own; one that stays bad ends the command with a code of its own."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from controller.experiments import capture as experiment
from controller.experiments import tracked
from controller.experiments.recorded import Recorded
from controller.experiments.verdicts import refuse_bad, remaining_bad, with_quality
from controller.loop.messages import Outcome
from controller.operation import Operation
from controller.supervisor import Supervisor
from mock_devices.testing.made.synthetic import Bench, metadata, tables, write_recording
from rig.config.protocol import Indentation
from rig.config.quality import QualityLimits
from rig.config.wiring import Wiring
from rig.errors import BadTrial, SafetyStop
from rig.recording.mcap_file import RecordingFailed
from rig.recording.sessions import SessionInfo, TrialInfo, open_session
from rig.results.tracking import Followed, LoopCount, TrackResult

NOISY = ("fx_N", "fy_N", "mx_N_m", "my_N_m", "mz_N_m")
GOOD, BAD = 1, 3
"""Of how many cycles of the loop one is there."""


def write(file: Path, every: int) -> None:
    """A trial without fault but for the cycles that were missed."""
    stroke = Bench().cycle(10.0)
    made = tables(stroke)
    for name in NOISY:
        made["force"][name] = 0.001 * (np.arange(len(made["force"])) % 3)
    made["loop"] = made["loop"][::every]
    write_recording(file, made, metadata(stroke))


class FakeRecorder:
    """In place of a bench: writes the trials that ``planned`` says, good ones after that."""

    def __init__(self, *planned: int, cause: str = "") -> None:
        self.planned, self.cause = list(planned), cause

    def __call__(self, _bench: object, _program: object, file: Path, *_: object) -> Recorded:
        write(file, self.planned.pop(0) if self.planned else GOOD)
        return Recorded(file, Outcome("complete", self.cause, 5.0, 20.0, 0.7), {"force": 1}, {})


@pytest.fixture
def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(experiment, "metadata", lambda *_: {})
    monkeypatch.setattr(experiment, "refuse_bench", lambda *_: None)
    return tmp_path / "session"


class WiredOnly:
    """A bench that is asked for nothing but its wiring."""

    wiring = Wiring()


def captured(folder: Path, recorder: FakeRecorder, monkeypatch: pytest.MonkeyPatch, repeats: int = 2) -> SessionInfo:
    monkeypatch.setattr(experiment, "record", recorder)
    protocol = Indentation(speeds_mm_s=(10.0,), trials=2, quality=QualityLimits(repeats=repeats))
    bench = cast(Supervisor, WiredOnly())
    return experiment.capture(bench, protocol, folder, Operation("capture", total=2, unit="trials"))


def test_where_the_folder_is_gone_the_recorder_s_own_sentence_is_the_last(
    session: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Removed(FakeRecorder):
        def __call__(self, *_: object) -> Recorded:
            shutil.rmtree(session)
            raise RecordingFailed("was removed while it was recorded")

    with pytest.raises(RecordingFailed, match="was removed while it was recorded"):
        captured(session, Removed(), monkeypatch)
    assert not session.exists()


def test_a_bad_trial_is_made_again_and_kept_and_marked(session: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = captured(session, FakeRecorder(BAD), monkeypatch)
    entries = [(trial.name, trial.quality, trial.repeats) for trial in info.trials]
    assert entries == [
        ("trial_001", "bad", ""), ("trial_001_repeat_1", "good", "trial_001"), ("trial_002", "good", "")
    ]  # fmt: skip
    assert info.trials[0].reasons == ("the loop missed of its cycles 66.7 % (good up to 5 %)",)
    assert all((session / trial.file).exists() for trial in info.trials)
    assert open_session(session).trials == info.trials
    assert remaining_bad(info) == ()
    refuse_bad(info)


def test_one_that_stays_bad_ends_with_a_code_of_its_own(session: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = captured(session, FakeRecorder(GOOD, BAD, BAD, BAD), monkeypatch)
    assert [trial.name for trial in remaining_bad(info)] == ["trial_002_repeat_2"]
    with pytest.raises(
        BadTrial, match=r"1 of 2 trials stayed bad \(trial_002_repeat_2\); .* missed .* 66.7 %"
    ) as error:
        refuse_bad(info)
    assert error.value.exit_code == 4


def test_as_often_as_the_protocol_says(session: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    info = captured(session, FakeRecorder(BAD, BAD), monkeypatch, repeats=0)
    assert [trial.name for trial in info.trials] == ["trial_001", "trial_002"]
    assert len(remaining_bad(info)) == 2


def test_a_stopped_trial_is_not_made_again(session: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SafetyStop, match="force limit"):
        captured(session, FakeRecorder(BAD, cause="force limit"), monkeypatch)
    assert [trial.name for trial in open_session(session).trials] == ["trial_001"]


def test_a_recording_that_cannot_be_read_is_bad(tmp_path: Path) -> None:
    (tmp_path / "trial_001.mcap").write_bytes(b"nothing of the kind")
    trial = with_quality(TrialInfo("trial_001", "trial_001.mcap", 10.0, 8.0, "complete"), tmp_path, QualityLimits())
    assert trial.quality == "bad" and "not a recording" in trial.reasons[0]


def test_a_trial_is_compared_with_those_before_that_reached_the_same_depth(tmp_path: Path) -> None:
    stroke = Bench().cycle(10.0)
    made = tables(stroke)
    for name in NOISY:
        made["force"][name] = 0.001 * (np.arange(len(made["force"])) % 3)
    write_recording(tmp_path / "trial_002.mcap", made, metadata(stroke), peak_force_N="5.0")
    entry = TrialInfo("trial_002", "trial_002.mcap", 10.0, 8.0, "complete", 5.0)
    before = TrialInfo("trial_001", "trial_001.mcap", 10.0, 8.0, "complete", 10.0, quality="good")
    others = (replace(before, quality="bad"), replace(before, depth_mm=4.0), replace(before, outcome="force limit"))
    assert with_quality(entry, tmp_path, QualityLimits(), others).quality == "good"
    found = with_quality(entry, tmp_path, QualityLimits(), (*others, before))
    assert found.quality == "usable" and found.measured["peak_off"] == pytest.approx(0.5)


def test_a_run_of_force_of_bad_quality_ends_with_the_same_code() -> None:
    followed = Followed(rms_error_N=0.1, largest_error_N=0.2, amplitude_ratio=None, lag_s=None)
    run = TrackResult(
        recording="track_001.mcap", model="model.json", max_error_percent=None, rms_error_N=None, levels=(),
        followed=followed, samples=1, dropped=0, loop=LoopCount(cycles=1, missed=0), quality="usable",
        reasons=("axis: a gap of 58 ms",),
    )  # fmt: skip
    tracked.refuse_bad(run)
    with pytest.raises(BadTrial, match=r"track_001.mcap is of bad quality: axis: a gap of 58 ms"):
        tracked.refuse_bad(run.model_copy(update={"quality": "bad"}))
