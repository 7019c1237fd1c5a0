"""Commands that move refuse what cannot be before any device is opened: number, bound, next step."""

import contextlib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import pytest
from typer.testing import CliRunner

from api.cli import demo
from api.cli.app import build
from api.cli.demo import forces_within
from controller.law.gain_table import DampingUnknown
from mock_devices.testing.commands import free_port
from mock_devices.testing.models import index_model, known_session
from rig.config.calibration_files import text_of
from rig.config.wiring import Wiring
from rig.errors import DataError, SafetyStop, UsageError
from rig.tissue.model import none_to_track_with
from tests.calibrations import axis_dynamics

runner = CliRunner()


@pytest.fixture(autouse=True)
def nothing_is_opened(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def opened(*_: object) -> None:
        raise AssertionError("a bench was started")

    monkeypatch.setattr("api.cli.live.bench_for", opened)
    monkeypatch.chdir(tmp_path)
    index_model(0.12, 0.22, 0.01, force_N=11.0).save(tmp_path / "model.json")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("--table --force 1", "--force 1: --table compares jumps of 1 N; give the first and the last force"),
        ("--table --force 1,2,5", "--force 1,2,5: --table compares jumps of 1 N"),
        ("--table --force 1,1.5", "at least 1 N apart, for example 1,10"),
        ("--table --force 1,12", "12 N is above what the subjects are learnt to, 10.3 N"),
        ("--table --force 1,5 --set subject.pain_threshold_N=4", "5 N is above the force limit, 4 N"),
        ("--table --force 0.01,3", "falls to 0.01 N, below the contact force 0.05 N"),
        ("--table --force nan,3", "nan N is not a force to press with"),
        ("--table --seconds 0.5", "--seconds 0.5: each jump needs more than 0.7 s to be judged"),
        ("--table --seconds nan", "--seconds nan: each jump needs more than 0.7 s"),
        ("--table --seconds inf", "each_s: Input should be a finite number"),
        ("--table --subjects nobody", "--subjects nobody: there are average, firm"),
        ("--table --set limits.depth_mm=5", "goes 14 mm deep, above limits.depth_mm 5 mm"),
        ("--table --set axis.delay_ms=60", "the axis answers 58.7 ms late, above the 46 ms that a force law can hold"),
        ("--table --set loop.gains=secant", "unknown key loop.gains"),
        ("--table --model model.json", "--table learns its own models"),
        ("--force 1", "tracking needs --model"),
        ("--model model.json", "either --force or --reference"),
        ("--model model.json --force 1 --reference step:5", "either --force or --reference"),
        ("--model model.json --force 1 --subjects firm", "--table, which has --subjects"),
        ("--model model.json --force one", "--force one: write one force in N"),
        ("--model model.json --force 0", "0 N is not a force to press with"),
        ("--model model.json --force inf", "inf N is not a force to press with"),
        ("--model model.json --force 1,12", "12 N is outside what the model was fitted to, 0 to 11 N"),
        ("--model model.json --force 1 --seconds nan", "for more than 1 s each, not 1 N for nan s"),
        ("--model model.json --reference step:5 --seconds 3", "--seconds goes with --force"),
        ("--model model.json --force 1 --out model.json", "model.json: is a file; give a new folder"),
        ("--model model.json --force 1 --out .", "is not empty; give a new folder"),
    ],
)
def test_track_is_refused_before_any_device_is_opened(arguments: str, sentence: str) -> None:
    answer = runner.invoke(build("track"), ["track", *arguments.split()])
    assert isinstance(answer.exception, UsageError), answer.exception
    assert sentence in str(answer.exception)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("--up-to nan", "--up-to nan N must be above the 0.5 N"),
        ("--up-to 0.3", "--up-to 0.3 N must be above the 0.5 N"),
        ("--up-to inf", "force_N: Input should be a finite number"),
        ("--up-to 5 --rate 0", "rate_N_s: Input should be greater than 0"),
        ("--up-to 5 --rate 100", "mm/s on this tissue, above the 24 mm/s of the force loop"),
        ("--up-to 12", "12 N is outside what the model was fitted to"),
        ("--up-to 8 --set subject.pain_threshold_N=5", "reference force 8 N is above the force limit, 5 N"),
        ("--up-to 5 --out .", "is not empty; give a new folder"),
    ],
)
def test_a_threshold_session_is_refused_before_any_device_is_opened(arguments: str, sentence: str) -> None:
    answer = runner.invoke(build("threshold"), ["threshold", "--model", "model.json", *arguments.split()])
    assert isinstance(answer.exception, UsageError), answer.exception
    assert sentence in str(answer.exception)


@pytest.mark.parametrize("command", ["track --force 1", "threshold --up-to 5"])
@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("axis.port=/dev/ttyACM0", "no dynamics of the axis at /dev/ttyACM0: run `rig calibrate axis --dynamics`"),
        ("calibration.dynamics=elsewhere.json", "of EPOS4 A1 were identified on lab-7-0badcafe, this is "),
    ],
)
def test_an_axis_that_was_not_identified_here_is_refused_before_it_homes(
    command: str, setting: str, sentence: str, tmp_path: Path
) -> None:
    elsewhere = axis_dynamics().model_copy(update={"computer": "lab-7-0badcafe"})
    (tmp_path / "elsewhere.json").write_text(text_of(elsewhere))
    name, *options = command.split()
    asked = [name, "--model", "model.json", *options, "--out", "session", "--set", setting]
    answer = runner.invoke(build(name), asked)
    assert isinstance(answer.exception, UsageError), answer.exception
    assert sentence in str(answer.exception)
    assert answer.exception.exit_code == 2
    assert not (tmp_path / "session").exists()


def test_a_table_that_was_interrupted_while_learning_is_refused_with_the_folder_in_its_way(tmp_path: Path) -> None:
    (tmp_path / "table" / "learn-firm").mkdir(parents=True)
    (tmp_path / "table" / "learn-firm" / "trial_001.mcap").touch()
    answer = runner.invoke(build("track"), ["track", "--table", "--out", "table"])
    assert "learn-firm: is not empty" in str(answer.exception)


def test_a_capture_into_a_used_folder_is_refused_before_any_device_is_opened(tmp_path: Path) -> None:
    (tmp_path / "protocol.toml").write_text('kind = "indentation"\ndepth_mm = 5\n')
    answer = runner.invoke(build("capture"), ["capture", "protocol.toml", "--out", "."])
    assert "is not empty; give a new folder" in str(answer.exception)


@pytest.mark.parametrize(
    ("written", "sentence"),
    [
        ("", "no such file"),
        ('kind = "indentation"\ndepth_mm = 50\n', "50"),
        ('kind = "indentation"\ndeep = 5\n', "deep"),
    ],
)
def test_a_demonstration_of_a_wrong_protocol_is_refused_and_removes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, written: str, sentence: str
) -> None:
    monkeypatch.setattr("api.cli.live.bench_for", lambda *_: pytest.fail("a bench was started"))
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "report.html").touch()
    if written:
        (tmp_path / "protocol.toml").write_text(written)
    answer = runner.invoke(build("demo"), ["demo", "--protocol", "protocol.toml", "--out", "demo"])
    assert isinstance(answer.exception, UsageError), answer.exception
    assert sentence in str(answer.exception)
    assert (tmp_path / "demo" / "report.html").exists()


@pytest.mark.parametrize(
    ("stops", "begun"),
    [(["axis_lost"], 2), (["force_lost", "drive_fault"], 3), (["axis_lost"] * 3, 3), (["pain_stop"], 1)],
)
def test_a_demonstration_begins_again_where_the_computer_was_late_and_for_no_other_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stops: list[str], begun: int
) -> None:
    left, begins = list(stops), list[str]()

    def captured(_bench: object, _plan: object, session: Path) -> None:
        session.mkdir()
        begins.append(str(session))
        if left:
            raise SafetyStop("stopped", left.pop(0))

    monkeypatch.setattr("api.cli.live.running", lambda *_: contextlib.nullcontext())
    monkeypatch.setattr(demo, "captured", captured)
    monkeypatch.setattr(demo, "fit_session", lambda _: "fitted")
    monkeypatch.setattr(demo, "model_to_track_with", lambda _: demo.MODEL)
    monkeypatch.setattr(demo, "_forces", lambda *_: "forces")
    monkeypatch.setattr(demo, "followed", lambda *_: "tracked")
    refused = pytest.raises(SafetyStop) if begun <= len(stops) else contextlib.nullcontext()
    with refused:
        found: object = demo.measured(Wiring(), (), demo.PLAN, tmp_path / "demo")
        assert found == ("fitted", "tracked")
    assert len(begins) == begun


@pytest.mark.parametrize("why", [DampingUnknown("0 to 0.004 N s/mm"), DataError(none_to_track_with("index", 76.0))])
@pytest.mark.parametrize(("refusals", "trials"), [(0, [2]), (1, [2, 3]), (2, [2, 3, 4]), (3, [2, 3, 4])])
def test_a_demonstration_whose_trials_give_no_law_to_track_with_begins_again_with_more_and_not_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refusals: int, trials: list[int], why: UsageError
) -> None:
    captures, left = list[int](), [why] * refusals

    def forces(*_: object) -> None:
        if left:
            raise left.pop()

    monkeypatch.setattr("api.cli.live.running", lambda *_: contextlib.nullcontext())
    monkeypatch.setattr(demo, "captured", lambda _, plan, __: captures.append(plan.trials))
    monkeypatch.setattr(demo, "fit_session", lambda _: "fitted")
    monkeypatch.setattr(demo, "model_to_track_with", lambda _: demo.MODEL)
    monkeypatch.setattr(demo, "_forces", forces)
    monkeypatch.setattr(demo, "followed", lambda *_: "tracked")
    refused = pytest.raises(type(why)) if refusals > demo.AGAIN else contextlib.nullcontext()
    with refused:
        demo.measured(Wiring(), (), demo.PLAN, tmp_path / "demo")
    assert captures == trials


@pytest.mark.parametrize(("worst_percent", "taken"), [(20.0, demo.MODEL), (90.0, demo.EXTENDED)])
def test_a_demonstration_whose_law_errs_too_much_to_track_with_tracks_with_what_its_diagnosis_extends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, worst_percent: float, taken: Path
) -> None:
    model, diagnoses = index_model(0.12, 0.22, 0.01), list[Path | None]()
    known_session(tmp_path / "session")
    errors = model.quality.model_copy(update={"max_error_percent": worst_percent})
    replace(model, quality=errors).save(tmp_path / "session" / demo.MODEL)
    monkeypatch.setattr(demo, "diagnosed", lambda _, out: diagnoses.append(out))
    assert demo.model_to_track_with(tmp_path / "session") == taken
    assert diagnoses == ([tmp_path / "session" / "diagnosis"] if taken == demo.EXTENDED else [])


@pytest.mark.parametrize(("option", "ends"), [((), []), (("--serve", "--port", "PORT"), ["demo"])])
def test_a_demonstration_is_served_at_its_end_where_that_is_asked_for(
    option: tuple[str, ...], ends: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    port, done = free_port(), list[str]()
    told = SimpleNamespace(hide=(), effect="", knobs={}, found_in=lambda _: None, inside=lambda _: {}, sentence=str)
    stands_for: dict[str, object] = {"draw": told, "measured": ("fitted", "tracked"), "track_parts": ()}
    for name in ("check", "experiment", "diagnosed", "verify", "refuse_incomplete", "derive", "HiddenTruth"):
        monkeypatch.setattr(demo, name, MagicMock())
    for name, found in stands_for.items():
        monkeypatch.setattr(demo, name, MagicMock(return_value=found))
    monkeypatch.setattr(demo, "_reported", lambda *_: done.append("reported"))
    monkeypatch.setattr(demo, "served", lambda out, _, at: done.append(str(out)) if at == port else None)
    answer = runner.invoke(build("demo"), ["demo", *(str(port) if one == "PORT" else one for one in option)])
    assert (answer.exit_code, done) == (0, ["reported", *ends]), answer.exception


@pytest.mark.parametrize(("largest_N", "forces_N"), [(5.2, (1, 2, 3, 4, 5)), (2.0, (0.34, 0.68, 1.02, 1.36, 1.7))])
def test_the_demonstration_presses_no_harder_than_its_model_was_fitted_to(
    largest_N: float, forces_N: tuple[float, ...]
) -> None:
    assert forces_within(largest_N) == pytest.approx(forces_N)
