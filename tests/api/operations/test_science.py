"""Operations that compute: how far they are, what they leave where they are cancelled, and what they return."""

from pathlib import Path

import pytest

from api.operations import diagnose as diagnosing
from api.operations.diagnose import check_protocol, diagnose
from api.operations.fit import Laws, fit, fit_operation
from api.operations.report import report
from api.operations.simulate import SimulatedRun, simulate
from controller.experiments.references import parse_reference
from controller.operation import Cancelled, Operation, Progress
from mock_devices.testing.made.synthetic import Bench, write_made_session
from mock_devices.testing.models import index_model
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.config.wiring import Wiring
from rig.errors import DataError, UsageError
from rig.intake.mapping import DataMapping
from rig.intake.session import import_folder
from rig.results.fit import FitResult
from rig.tissue.registry import law_named
from tests.data import recording
from tests.rig.intake.test_real_folders import MAPPINGS
from tests.rig.recording.measured import NOW

LAWS = Laws(compared=(law_named("constant"), law_named("index")))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cycles = Bench(rate_Hz=500.0).cycles(trials=2, speeds_mm_s=(5.0, 20.0))
    return write_made_session(tmp_path_factory.mktemp("made") / "session", cycles)


def cancelled_at(operation: Operation, message: str) -> None:
    """Cancels where it says ``message``."""

    def watch(now: Progress) -> None:
        if now.message == message:
            operation.cancel()

    operation.watch = watch


def test_a_fit_tells_each_law_and_returns_what_it_saved(session: Path, tmp_path: Path) -> None:
    operation, told = fit_operation(), list[tuple[float, str]]()
    operation.watch = lambda now: told.append((round(now.done, 3), now.message))
    found = operation.run(lambda: fit(operation, [session], tmp_path, LAWS))
    assert told == [
        (0.0, "fitting constant"), (0.1, "fitting index"), (0.2, "evaluating constant"), (0.6, "evaluating index"),
        (0.6, "done"),
    ]  # fmt: skip
    assert found == FitResult.read(tmp_path / "fit.json")
    assert operation.progress.result is found


def test_a_fit_that_a_bound_stopped_is_refused_and_writes_nothing(tmp_path: Path) -> None:
    """A joint's torque over its angle, called no axis: the recordings of an arm, where they are at hand."""
    mapping = load(DataMapping, MAPPINGS / "franka_joint.toml").model_copy(update={"axis": None})
    place = import_folder(recording("franka_joint"), mapping, tmp_path / "session", NOW).place
    with pytest.raises(DataError, match=r"tell no stiffness: fitting F = .* pushed a_N_mm to its bound, 1e-06 N/mm"):
        fit_operation().run(lambda: fit(fit_operation(), [place], tmp_path / "out", LAWS))
    assert not (tmp_path / "out").exists()


def test_a_fit_that_is_cancelled_writes_nothing(session: Path, tmp_path: Path) -> None:
    operation = fit_operation()
    cancelled_at(operation, "evaluating constant")
    with pytest.raises(Cancelled, match="fit was cancelled before: evaluating index"):
        operation.run(lambda: fit(operation, [session], tmp_path / "out", LAWS))
    assert operation.progress.state == "stopped" and not (tmp_path / "out").exists()


def test_a_diagnosis_that_is_cancelled_writes_nothing(session: Path, tmp_path: Path) -> None:
    operation = Operation("diagnose")
    cancelled_at(operation, "fit of the simulation as it is")
    with pytest.raises(Cancelled, match="diagnose was cancelled before: "):
        operation.run(lambda: diagnose(operation, session, out=tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_diagnosis_that_could_not_be_written_is_refused_before_the_work(
    session: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(diagnosing, "trials_of", lambda *_: pytest.fail("the work began"))
    (tmp_path / "file").touch()
    with pytest.raises(UsageError, match="is a file, not a folder; give another place"):
        diagnose(Operation("diagnose"), session, out=tmp_path / "file" / "out")


def test_a_report_and_a_check_that_are_cancelled_write_nothing(session: Path, tmp_path: Path) -> None:
    operation = Operation("report")
    operation.cancel()
    with pytest.raises(Cancelled):
        report(operation, session, tmp_path / "report.html")
    with pytest.raises(Cancelled):
        check_protocol(operation, Indentation(), True, 1000.0, tmp_path / "check")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("said", "next_"),
    [("reading trial_500.mcap", "reading trial_501.mcap"), ("drawing", "writing report.html")],
)
def test_a_report_that_is_cancelled_between_two_steps_writes_nothing(
    session: Path, tmp_path: Path, said: str, next_: str
) -> None:
    operation = Operation("report")
    cancelled_at(operation, said)
    with pytest.raises(Cancelled, match=f"report was cancelled before: {next_}"):
        operation.run(lambda: report(operation, session, tmp_path / "report.html"))
    assert not list(tmp_path.iterdir())


def test_a_simulation_that_is_cancelled_draws_nothing(tmp_path: Path) -> None:
    operation = Operation("simulate")
    cancelled_at(operation, "playing, 1 of 3")
    wanted = SimulatedRun(parse_reference("step:2"), index_model(0.12, 0.22, 0.01, force_N=11.0))
    with pytest.raises(Cancelled, match="simulate was cancelled before: playing, 2 of 3"):
        operation.run(lambda: simulate(operation, Wiring(), wanted, tmp_path / "out"))
    assert not (tmp_path / "out").exists()
