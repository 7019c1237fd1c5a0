"""Operations on a bench whose recorder is played: what they return, what they say, and how they are cancelled."""

from pathlib import Path
from typing import cast

import pytest

from api.operations import motion
from api.operations.motion import TrackPlan
from controller.experiments import capture as experiment
from controller.experiments import threshold as ramp
from controller.experiments import tracked
from controller.law.inverse_model import GainRow
from controller.loop.messages import Outcome
from controller.loop.steps import Program, Retract, TrackForce
from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.config.protocol import Indentation
from rig.config.quality import QualityLimits
from rig.config.wiring import Limits, Wiring
from rig.errors import SafetyStop
from rig.results.tracking import Followed, LoopCount, TrackResult
from tests.controller.experiments.test_verdicts import BAD, GOOD, FakeRecorder

PLAN = Indentation(name="short", speeds_mm_s=(10.0,), trials=2, quality=QualityLimits(repeats=1))


class PlayedBench:
    """A bench that runs nothing, and ends every program as it is told."""

    def __init__(self, cause: str = "", limits: Limits | None = None) -> None:
        self.cause, self.programs = cause, list[Program]()
        self.wiring = Wiring(limits=limits or Limits())

    def run(self, program: Program, _timeout_s: float) -> Outcome:
        self.programs.append(program)
        return Outcome("pain_stop" if self.cause else "complete", self.cause, 0.0, None, None)


def bench(cause: str = "") -> Supervisor:
    return cast(Supervisor, PlayedBench(cause))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(experiment, "metadata", lambda *_: {})
    monkeypatch.setattr(experiment, "refuse_bench", lambda *_: None)
    return tmp_path / "session"


def test_a_capture_returns_what_was_recorded_and_says_a_line_a_trial(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(experiment, "record", FakeRecorder(GOOD, BAD, BAD))
    operation = motion.capture_operation(PLAN)
    assert (operation.progress.total, operation.progress.unit) == (2, "trials")
    found = motion.capture(operation, bench(), PLAN, folder)
    assert (found.session, found.recordings, found.samples, found.dropped) == (str(folder), 3, 3, 0)
    assert [(trial.name, trial.quality, trial.repeats) for trial in found.trials] == [
        ("trial_001", "good", ""), ("trial_002", "bad", ""), ("trial_002_repeat_1", "bad", "trial_002")
    ]  # fmt: skip
    assert found.bad == ("trial_002_repeat_1",)
    lines = [line for line in operation.progress.log if line.startswith("trial")]
    assert [line.split()[0] for line in lines] == ["trial_001", "trial_002", "trial_002_repeat_1"]
    assert lines[0].endswith("1 samples  0 dropped  complete  good")
    assert any("the loop missed of its cycles 66.7 %" in line for line in operation.progress.log)
    assert operation.progress.done == 2
    written = found.model_dump(mode="json")
    assert "info" not in written and written["trials"][0]["speed_mm_s"] == 10.0


def test_a_capture_that_is_cancelled_keeps_the_trials_so_far(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    operation, recorder = motion.capture_operation(PLAN), FakeRecorder()

    def first_only(*arguments: object) -> object:
        operation.cancel()
        return recorder(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(experiment, "record", first_only)
    with pytest.raises(SafetyStop, match="stopped by the operator after 1 of 2 trials"):
        operation.run(lambda: motion.capture(operation, bench(), PLAN, folder))
    assert operation.progress.state == "stopped"
    assert sorted(path.name for path in folder.glob("*.mcap")) == ["trial_001.mcap"]


def followed(rms_error_N: float) -> TrackResult:
    return TrackResult(
        recording="track_001.mcap", model="model.json", max_error_percent=None, rms_error_N=None, levels=(),
        followed=Followed(rms_error_N=rms_error_N, largest_error_N=1.0, amplitude_ratio=None, lag_s=None),
        samples=1, dropped=0, loop=LoopCount(cycles=1, missed=0),
    )  # fmt: skip


def requests() -> tuple[TrackPlan, TrackPlan]:
    program = Program(name="step", steps=(Retract(clearance_mm=1.0, speed_mm_s=1.0),))
    return TrackPlan(program, "new.json"), TrackPlan(program, "old.json")


def test_what_a_model_gains_over_another_is_part_of_the_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    errors = {"old.json": 0.4, "new.json": 0.1}
    monkeypatch.setattr(tracked, "run", lambda _bench, _program, _folder, model: followed(errors[model]))
    new, old = requests()
    operation = Operation("track", total=2, unit="runs")
    found = motion.track(operation, bench(), new, tmp_path, old)
    assert found.model_dump()["gain"] == {
        "rms_error_before_N": 0.4, "rms_error_after_N": 0.1, "reduction": pytest.approx(0.75)
    }  # fmt: skip
    assert operation.progress.done == 2
    alone = motion.track(Operation("track"), bench(), new, tmp_path)
    assert alone.gain is None and alone.against is None


def held(seconds: float) -> TrackPlan:
    gains = [GainRow(force_N=force_N, depth_mm=force_N, tangent_N_mm=1.0, damping_N_s_mm=0.1) for force_N in (0.0, 9.0)]
    step = TrackForce(times_s=(0.0, seconds), forces_N=(1.0, 1.0), gains=tuple(gains), crossover_rad_s=10.0)
    return TrackPlan(Program(name="hold", steps=(step,)), "model.json")


def test_the_time_left_of_what_moves_is_known_from_its_beginning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = list[float | None]()

    def follow(*_: object) -> TrackResult:
        told.append(operation.progress.time_left_s)
        return followed(0.1)

    monkeypatch.setattr(tracked, "run", follow)
    monkeypatch.setattr(ramp, "run", follow)
    monkeypatch.setattr(PlayedBench, "run", lambda *_: follow() and Outcome("complete", "", 0.0, None, None))
    operation = Operation("track", total=2, now_s=lambda: 100.0)
    motion.track(operation, bench(), held(20.0), tmp_path, held(30.0))
    motion.threshold(operation, bench(), held(12.0), 6.0, tmp_path)
    motion.retract(operation, bench())
    assert told == [50.0, 20.0, 12.0, motion.RETRACT_MM / motion.RETRACT_MM_S]


def test_a_comparison_that_is_cancelled_starts_no_second_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    operation, runs = Operation("track", total=2, unit="runs"), list[str]()

    def run(_bench: object, _program: object, _folder: Path, model: str) -> TrackResult:
        runs.append(model)
        operation.cancel()
        return followed(0.1)

    monkeypatch.setattr(tracked, "run", run)
    new, old = requests()
    with pytest.raises(SafetyStop, match="before the second run"):
        motion.track(operation, bench(), new, tmp_path, old)
    assert runs == ["old.json"]


def test_a_retraction_keeps_to_the_limits_of_the_bench() -> None:
    played = PlayedBench(limits=Limits(retract_speed_mm_s=4.0, position_min_mm=1.5))
    assert motion.retract(Operation("retract"), cast(Supervisor, played)).outcome == "complete"
    (step,) = played.programs[0].steps
    assert isinstance(step, Retract)
    assert (step.clearance_mm, step.speed_mm_s, step.floor_mm) == (20.0, 4.0, 1.5)
    with pytest.raises(SafetyStop, match="stopped: the subject's pain stop"):
        motion.retract(Operation("retract"), bench("the subject's pain stop"))
