"""Force tracked on subjects whose benches are played: what a stall or a cancel of the operation does."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from api.cli import comparison as command
from api.operations import compare as comparing
from api.operations.compare import Comparison, compare, comparison_operation
from controller.experiments import capture, tracked
from controller.experiments.comparison import compared_run
from controller.experiments.recorded import Recorded
from controller.experiments.references import parse_reference
from controller.loop.messages import Outcome
from controller.loop.steps import Program, TrackForce
from controller.operation import Cancelled, Operation
from controller.simulated.alternatives import alternative_runs as alternatives
from controller.simulated.alternatives.alternative_laws import tuning_for
from controller.simulated.alternatives.alternative_runs import alternative_runs
from controller.supervisor import Supervisor
from mock_devices.testing.models import index_model
from rig.config.calibration import Calibration
from rig.config.wiring import Wiring
from rig.errors import DataError, DeviceError, SafetyStop
from rig.results.compared_tables import alternatives_table
from rig.results.tracking import AlternativeRun, CompareResult
from tests.calibrations import axis_dynamics

DONE = Outcome("complete", "", 5.0, 20.0, 0.0)
LATE = Outcome("loop_overrun", "the loop was late", 5.0, 20.0, 0.0)


class PlayedRuns:
    """In place of runs on a bench: each ends as it is told, at last well."""

    def __init__(self, *ends: Outcome | DeviceError) -> None:
        self.ends, self.made, self.programs = list(ends), list[str](), list[Program]()

    def __call__(self, _bench: object, program: Program, folder: Path, _model: str) -> Recorded:
        self.made.append(folder.name)
        self.programs.append(program)
        end = self.ends.pop(0) if self.ends else DONE
        if isinstance(end, DeviceError):
            raise end
        return Recorded(folder / "track_001.mcap", end, {}, {})


def comparison(out: Path) -> Comparison:
    """Two subjects of one tissue, whose model is learnt already."""
    index_model(0.12, 0.22, 0.01, force_N=11.0).save(out / "average.json")

    @contextmanager
    def bench(_: str) -> Iterator[Supervisor]:
        known = Calibration(of_dynamics=axis_dynamics())
        yield cast(Supervisor, SimpleNamespace(wiring=Wiring().model_copy(update={"calibration": known})))

    subjects = {"average": "average", "breathing": "average"}
    return Comparison(Wiring(), out, subjects, parse_reference("stairs:5"), bench)


@pytest.fixture(autouse=True)
def no_jumps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparing, "_jumps", lambda _: ())


@pytest.fixture(autouse=True)
def simulated(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, tuple[float, float]]]:
    """In place of simulations: whose were asked for, and how they breathe."""
    asked: list[tuple[str, tuple[float, float]]] = []
    nothing = compared_run("", ()).worst

    def runs(subject: str, _program: object, _model: object, breathing: tuple[float, float], *_: object) -> object:
        asked.append((subject, breathing))
        return [AlternativeRun(subject=subject, law="force law", worst=nothing, worst_of_wrong=nothing)]

    monkeypatch.setattr(alternatives, "alternative_runs", runs)
    monkeypatch.setattr(alternatives, "tuning_for", lambda *_: None)
    return asked


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
    assert (operation.progress.total, found.models["breathing"]["a_N_mm"]) == (4, 0.12)
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


def test_the_bench_plays_the_law_of_the_axis_that_answered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not that of what the configuration says of an axis that was never identified."""
    runs, wanted = PlayedRuns(), comparison(tmp_path)
    monkeypatch.setattr(tracked, "recorded_run", runs)
    compare(comparison_operation(wanted), wanted)
    identified = axis_dynamics().response
    for program in runs.programs:
        laws = [step for step in program.steps if isinstance(step, TrackForce)]
        assert {(law.delay_s, law.lag1_s, law.lag2_s) for law in laws} == {identified[:3]}


def test_what_a_subjects_bench_was_asked_for_is_simulated_and_who_was_refused_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, simulated: list[tuple[str, tuple[float, float]]]
) -> None:
    monkeypatch.setattr(tracked, "recorded_run", PlayedRuns())
    wanted = replace(comparison(tmp_path), breathing={"breathing": (1.5, 0.25)})
    found = compare(comparison_operation(wanted), wanted)
    assert simulated == [("average", (0.0, 1.0)), ("breathing", (1.5, 0.25))]
    assert [run.subject for run in found.alternatives] == ["average", "breathing"]
    index_model(18.0, 0.22, 0.01, force_N=11.0).save(tmp_path / "average.json")  # 23 N/mm at 11 N
    simulated.clear()
    refused = compare(comparison_operation(wanted), wanted)
    assert "above the 20 N/mm up to which the force limit holds" in refused.runs[0].stopped
    assert (simulated, refused.alternatives) == ([], ())


def simulation_that_ends(by: Exception, subject: str) -> Callable[..., object]:
    """One law is simulated of everyone, and then it ends so on ``subject``."""
    nothing = compared_run("", ()).worst

    def runs(of: str, *_: object) -> Iterator[AlternativeRun]:
        yield AlternativeRun(subject=of, law="force law", worst=nothing, worst_of_wrong=nothing)
        if of == subject:
            raise by

    return runs


@pytest.mark.parametrize("end", [KeyboardInterrupt(), IndexError("an error of its own")])
def test_what_the_benches_gave_is_kept_before_anything_is_simulated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: Exception
) -> None:
    monkeypatch.setattr(tracked, "recorded_run", PlayedRuns())
    monkeypatch.setattr(alternatives, "alternative_runs", simulation_that_ends(end, "average"))
    kept = list[CompareResult]()
    wanted = replace(comparison(tmp_path), keep=kept.append)
    with pytest.raises(type(end)):
        compare(comparison_operation(wanted), wanted)
    assert [(run.subject, run.stopped) for run in kept[0].runs] == [("average", ""), ("breathing", "")]
    assert "force law on the bench" in (tmp_path / "comparison.svg").read_text()


def test_a_subject_that_cannot_be_simulated_costs_neither_bench_nor_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tracked, "recorded_run", PlayedRuns())
    monkeypatch.setattr(alternatives, "alternative_runs", simulation_that_ends(DataError("no jump"), "average"))
    wanted = comparison(tmp_path)
    operation = comparison_operation(wanted)
    found = compare(operation, wanted)
    assert [run.subject for run in found.runs] == ["average", "breathing"]
    assert [run.subject for run in found.alternatives] == ["average", "breathing"]
    assert found.not_simulated == {"average": "no jump"}
    assert "average is not simulated by all laws: no jump" in operation.progress.log


def test_a_cancel_while_simulating_leaves_tables_and_json_of_the_benches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def work(operation: Operation, wanted: Comparison) -> CompareResult:
        wanted.keep(CompareResult(reference="stairs", models={}, runs=(compared_run("firm", ()),)))
        operation.cancel()
        operation.refuse_cancelled("simulating each law on firm")
        raise AssertionError("it was cancelled")

    monkeypatch.setattr(command, "work", work)
    file = tmp_path / "table.json"
    with pytest.raises(Cancelled):
        command.compare(Wiring(), tmp_path, ["firm"], parse_reference("stairs:5"), file)
    assert CompareResult.model_validate_json(file.read_text()).runs[0].subject == "firm"
    assert "firm" in capsys.readouterr().out


def test_each_law_stands_beside_the_bench_in_numbers_table_and_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tracked, "recorded_run", PlayedRuns())
    monkeypatch.setattr(alternatives, "alternative_runs", alternative_runs)
    monkeypatch.setattr(alternatives, "tuning_for", tuning_for)
    wanted = replace(comparison(tmp_path), subjects={"average": "average"})
    found = compare(comparison_operation(wanted), wanted)
    laws = [run.law for run in found.alternatives]
    assert len(laws) == len(set(laws)) == 6
    table = alternatives_table(CompareResult.model_validate_json(found.model_dump_json()).alternatives)
    assert [row[:2] for row in table.rows] == [["average", law] for law in laws]
    picture = (tmp_path / "comparison.svg").read_text()
    assert all(f"{law}, simulated" in picture for law in laws)
