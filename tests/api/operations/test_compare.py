"""Force tracked on subjects whose benches are played: what a stall or a cancel of the operation does."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import cast

import pytest

from api.operations import compare as comparing
from api.operations.compare import Comparison, compare, comparison_operation
from controller.experiments import capture, tracked
from controller.experiments.recorded import Recorded
from controller.experiments.references import parse_reference
from controller.loop.messages import Outcome
from controller.operation import Cancelled
from controller.supervisor import Supervisor
from mock_devices.testing.models import index_model
from rig.config.wiring import Wiring
from rig.errors import DeviceError, SafetyStop

DONE = Outcome("complete", "", 5.0, 20.0, 0.0)
LATE = Outcome("loop_overrun", "the loop was late", 5.0, 20.0, 0.0)


class PlayedRuns:
    """In place of runs on a bench: each ends as it is told, at last well."""

    def __init__(self, *ends: Outcome | DeviceError) -> None:
        self.ends, self.made = list(ends), list[str]()

    def __call__(self, _bench: object, _program: object, folder: Path, _model: str) -> Recorded:
        self.made.append(folder.name)
        end = self.ends.pop(0) if self.ends else DONE
        if isinstance(end, DeviceError):
            raise end
        return Recorded(folder / "track_001.mcap", end, {}, {})


def comparison(out: Path) -> Comparison:
    """Two subjects of one tissue, whose model is learnt already."""
    index_model(0.12, 0.22, 0.01, force_N=11.0).save(out / "average.json")

    @contextmanager
    def bench(_: str) -> Iterator[Supervisor]:
        yield cast(Supervisor, None)

    subjects = {"average": "average", "breathing": "average"}
    return Comparison(Wiring(), out, subjects, parse_reference("stairs:5"), bench)


@pytest.fixture(autouse=True)
def no_jumps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparing, "_jumps", lambda _: ())


def test_what_a_stall_of_the_computer_stopped_is_said_and_done_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = PlayedRuns(LATE, DeviceError("the force sensor is silent"))
    monkeypatch.setattr(tracked, "recorded_run", runs)
    wanted = comparison(tmp_path)
    operation = comparison_operation(wanted)
    found = compare(operation, wanted)
    assert runs.made == ["average", "average", "average", "breathing"]
    assert [(run.subject, run.stopped) for run in found.runs] == [("average", ""), ("breathing", "")]
    assert operation.progress.log[:2] == (
        "average: the loop was late; once more",
        "average: the force sensor is silent; once more",
    )
    assert (operation.progress.total, found.models["breathing"]["a_N_mm"]) == (2, 0.12)
    assert (tmp_path / "comparison.svg").exists()


def test_one_that_stalls_each_time_is_given_up_with_its_reason(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runs = PlayedRuns(LATE, LATE, LATE)
    monkeypatch.setattr(tracked, "recorded_run", runs)
    wanted = comparison(tmp_path)
    found = compare(comparison_operation(wanted), wanted)
    assert [run.stopped for run in found.runs] == ["the loop was late", ""]
    assert runs.made == ["average"] * 3 + ["breathing"]


@pytest.mark.parametrize("code", ["operator_stop", "pain_stop", "emergency_stop"])
def test_a_persons_stop_ends_the_comparison(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str) -> None:
    runs = PlayedRuns(Outcome(code, "stopped by the operator", 5.0, 20.0, 0.0))
    monkeypatch.setattr(tracked, "recorded_run", runs)
    wanted = comparison(tmp_path)
    with pytest.raises(SafetyStop, match="stopped: stopped by the operator"):
        compare(comparison_operation(wanted), wanted)
    assert runs.made == ["average"]


@pytest.mark.parametrize(("code", "attempts"), [("loop_overrun", 3), ("force_limit", 1), ("operator_stop", 1)])
def test_learning_is_done_again_only_where_the_computer_was_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, attempts: int
) -> None:
    wanted, folders = comparison(tmp_path), list[str]()
    (tmp_path / "average.json").unlink()

    def stopped_capture(_bench: object, _protocol: object, folder: Path, _operation: object) -> None:
        folders.append(folder.name)
        raise SafetyStop("stopped", code)

    monkeypatch.setattr(capture, "capture", stopped_capture)
    with pytest.raises(SafetyStop, match="stopped"):
        compare(comparison_operation(wanted), wanted)
    assert len(folders) == len(set(folders)) == attempts


def test_one_that_is_cancelled_starts_no_further_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = comparison(tmp_path)
    operation, runs = comparison_operation(wanted), PlayedRuns()

    def run(*arguments: object) -> Recorded:
        operation.cancel()
        return runs(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(tracked, "recorded_run", run)
    with pytest.raises(Cancelled, match="compare was cancelled before: learning breathing"):
        operation.run(lambda: compare(operation, wanted))
    assert runs.made == ["average"] and not (tmp_path / "comparison.svg").exists()
