"""`rig calibrate` without a bench: what is asked, what is refused before anybody moves a weight, what files hold."""

import contextlib
import json
import sys
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import cast

import pytest
from typer.testing import CliRunner

from api.cli import mock_calibration
from api.cli.app import build
from api.cli.asking import Person
from api.cli.calibrate import say_use
from api.cli.calibrate_axis import calibrate_axis
from api.cli.calibrate_dynamics import calibrate_dynamics
from api.cli.mock_bench import bench_for, plug_into
from api.cli.mock_calibration import done_by_mock, force_file
from api.cli.options import built_in, calibrated, wiring_from
from api.http.jobs.worker import function_at
from api.operations.calibrate import AxisAsked
from api.operations.calibrations import keep, refuse_out, refuse_unfit
from controller.commissioning.refusals import refuse_unstated_scale
from rig.config.calibration import Calibration, Uncertainty
from rig.config.calibration_files import read_force, text_of
from rig.config.endpoints import Endpoints
from rig.config.products.roles import AxisProduct
from rig.config.wiring import Wiring
from rig.errors import CheckFailed, DeviceError, UsageError
from tests.calibrations import axis_calibration, force_calibration

runner = CliRunner()
ENDPOINTS = Endpoints.model_validate({
    "force": {"serial": "/dev/pts/90"}, "force_modbus": {"serial": "/dev/pts/91"}, "axis": {"slcan": "/dev/pts/92"},
    "tracker": {"tcp": "127.0.0.1:8765"}, "control": "127.0.0.1:1", "latency_ms": {"force": 0.5, "force_modbus": 3.0,
    "tracker": 15.0}, "serials": {"force": "000271", "force_modbus": "FTS-1234", "axis": "A1"}, "pid": 1,
})  # fmt: skip
REAL = ["--set", "force.port=/dev/null"]
AXIS = ["--set", "axis.port=/dev/null", "--set", "axis.increments_per_mm=2000"]


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(mock_calibration, "_measured_axis", lambda *_: None)
    return tmp_path


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ([], "which weights will you use.*: no terminal to answer at; give --weights"),
        (["--weights", "1 N,2 N"], "do they press on the tip or hang from it.*; give --load pressed or hung"),
        (["--weights", "1 N,99 N", "--load", "hung"], "99 N is above limits.force_N, 20 N"),
        (["--weights", "1 stone", "--load", "hung"], "'1 stone' is no weight"),
    ],
)
def test_without_a_terminal_an_open_question_names_the_option(
    options: list[str], sentence: str, own_state: Path
) -> None:
    answer = runner.invoke(build("calibrate"), ["calibrate", "force", *REAL, *options])
    assert isinstance(answer.exception, UsageError)
    assert answer.exception.exit_code == 2
    with pytest.raises(UsageError, match=sentence):
        raise answer.exception
    assert not list(own_state.rglob("*.json"))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["force", "--gauge-block-mm", "10"], "--gauge-block-mm says nothing to `rig calibrate force`"),
        (["force", "--clear"], "--clear says nothing to `rig calibrate force`"),
        (["axis", "--weights", "1 N,2 N"], "--weights says nothing to `rig calibrate axis`"),
        (["axis", "--to-mm", "99"], "the axis would go to 99 mm, outside 0 to 60 mm"),
        (["axis", "--to-mm", "9"], "--from-mm 2 --to-mm 9: 8 mm of travel or more are needed"),
        (["axis", "--gauge-block-mm", "10", "--near-mm", "8"], "the axis would go to -3 mm, outside 0 to 60 mm"),
        (["axis", *AXIS], "is the tip's way free .*: no terminal to answer at; give --clear"),
        (["axis", *AXIS, "--clear", "--gauge-block-mm", "5"], "give --near-mm"),
    ],
)
def test_what_cannot_be_calibrated_is_refused_before_anything_is_opened(
    arguments: list[str], sentence: str, monkeypatch: pytest.MonkeyPatch, own_state: Path
) -> None:
    monkeypatch.setattr("api.cli.mock_bench.bench_process", lambda *_: pytest.fail("a bench was started"))
    answer = runner.invoke(build("calibrate"), ["calibrate", *arguments])
    assert isinstance(answer.exception, UsageError)
    with pytest.raises(UsageError, match=sentence):
        raise answer.exception
    assert list(own_state.iterdir()) == []


def test_without_tracker_and_block_there_is_nothing_to_compare_the_axis_with(own_state: Path) -> None:
    (own_state / "rig.toml").write_text("[force]\n")
    wiring = wiring_from(Path("rig.toml"), None).model_copy(update={"tracker": None})
    with pytest.raises(UsageError, match=r"there is no \[tracker\] .* give --gauge-block-mm"):
        calibrate_axis(wiring, AxisAsked(2.0, 14.0, True, None, None, None), Person())


def test_a_request_that_nobody_can_say_is_done_names_the_option() -> None:
    with pytest.raises(UsageError, match=r"put 2 N on the tip, alone: no terminal .*; give --pause SECONDS"):
        Person().do("put 2 N on the tip, alone")


def test_with_a_pause_a_request_is_said_and_waited_for(capsys: pytest.CaptureFixture[str]) -> None:
    waited: list[float] = []
    Person(5.0, waited.append).do("put 2 N on the tip, alone")
    assert waited == [5.0]
    assert "put 2 N on the tip, alone (5 s)" in capsys.readouterr().out


def test_at_a_terminal_the_answer_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr("typer.prompt", lambda *_, **__: "pressed")
    assert Person().answer("pressed or hung", "--load") == "pressed"
    Person().do("put 2 N on the tip, alone")


def test_a_calibration_is_written_whole_and_its_line_is_relative_to_the_wiring(
    own_state: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = force_calibration(date=datetime(2026, 3, 1, 9, tzinfo=UTC))
    path = keep("force", found, None)
    say_use("force", path, Path("bench"))
    assert path == Path("calibration/force-000271-20260301T090000Z.json")
    assert read_force(path) == found
    assert 'force = "../calibration/force-000271-20260301T090000Z.json"' in capsys.readouterr().out
    assert [file.name for file in (own_state / "calibration").iterdir()] == [path.name]
    with pytest.raises(UsageError, match="exists already"):
        refuse_out(path)


def test_one_less_certain_than_the_wiring_states_is_not_written() -> None:
    unsure = Uncertainty(combined=0.03, repeatability=0.001, weights=0.029, linearity=0.002)
    with pytest.raises(CheckFailed, match=r"is uncertain by 3 %, calibration.max_uncertainty is 2 %"):
        refuse_unfit(Calibration(), force_calibration(uncertainty=unsure), datetime.now(UTC))
    refuse_unfit(Calibration(max_uncertainty=0.05), force_calibration(uncertainty=unsure), datetime.now(UTC))
    with pytest.raises(CheckFailed, match=r"calibration.max_uncertainty is 0.1 %"):
        refuse_unfit(Calibration(max_uncertainty=0.001), axis_calibration(), datetime.now(UTC))


def test_calibration_paths_are_beside_the_wiring_file(own_state: Path) -> None:
    (own_state / "bench").mkdir()
    (own_state / "bench" / "force.json").write_text(text_of(force_calibration()))
    (own_state / "bench" / "rig.toml").write_text('[calibration]\nforce = "force.json"\n')
    found = calibrated(wiring_from(Path("bench/rig.toml"), None)).calibration.of_force
    assert found is not None
    assert found.serial == "000271"


@pytest.mark.parametrize(
    ("edit", "sentence"),
    [
        (lambda file: file.unlink(), "no such file; run `rig calibrate`"),
        (lambda file: file.write_text("{"), "cannot be read as JSON"),
        (lambda file: file.write_text("[" * 100_000), "cannot be read as JSON"),
        (lambda file: file.write_text("[]"), "holds no calibration"),
        (lambda file: edited(file, version=2), "format version 2 is newer than 1, which this program reads; update"),
        (lambda file: edited(file, serial=5), "serial: Input should be a valid string"),
        (lambda file: edited(file, date="2026-03-01T09:00:00"), "date: .*timezone"),
        (lambda file: edited(file, chanel="fz"), "unknown key chanel; nearest valid key: channel"),
        (lambda file: edited(file, compression="positive"), "its own loads do not come out of its matrix"),
        (lambda file: edited(file, channel="fx"), "its own loads do not come out of its matrix"),
        (lambda file: edited(file, matrix=[[1, 0, 0], [0, 1, 0], [0, 0, 1.07]]), "its own loads do not come out"),
        (lambda file: edited(file, matrix=[[1, 0, 0.3], [0, 1, 0], [0, 0, 1]]), "matrix corrects by 0.3"),
    ],
)
def test_a_file_that_is_not_as_it_was_written_is_refused(edit: object, sentence: str, own_state: Path) -> None:
    file = own_state / "force.json"
    file.write_text(text_of(force_calibration()))
    edit(file)  # type: ignore[operator]
    with pytest.raises(UsageError, match=sentence):
        calibrated(built_in([f"calibration.force={file}"]))


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"scale": 1.02}, "scale 1.02 is off from 1 by more than 0.01"),
        ({"steps": [{"axis_mm": 0.0, "reference_mm": 0.0}, {"axis_mm": 10.0, "reference_mm": 20.0}]}, "its own steps"),
        ({"direction": 0}, "direction: Input should be 1 or -1"),
        ({"steps": []}, "steps: Tuple should have at least 2 items"),
    ],
)
def test_an_axis_file_that_is_not_as_it_was_written_is_refused(
    changes: dict[str, object], sentence: str, own_state: Path
) -> None:
    file, known = own_state / "axis.json", axis_calibration()
    file.write_text(text_of(known))
    assert calibrated(built_in([f"calibration.axis={file}"])).calibration.of_axis == known
    edited(file, **changes)
    with pytest.raises(UsageError, match=sentence):
        calibrated(built_in([f"calibration.axis={file}"]))


def edited(file: Path, **changes: object) -> None:
    file.write_text(json.dumps(json.loads(file.read_text()) | changes))


# The mock sensor's own calibration


def stored(date: datetime | None = None) -> None:
    file = force_file(built_in(), ENDPOINTS)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text_of(force_calibration(date=date)))


def test_a_mock_sensor_uses_the_calibration_that_is_kept_for_its_serial_number(
    monkeypatch: pytest.MonkeyPatch, own_state: Path
) -> None:
    monkeypatch.setattr(mock_calibration, "_measured_force", lambda *_: pytest.fail("calibrated again"))
    stored()
    assert force_file(built_in(), ENDPOINTS).parent == own_state / "state" / "tissue-rig"
    found = plug_into(built_in(), ENDPOINTS).calibration.of_force
    assert found is not None
    assert found.serial == "000271"


@pytest.mark.parametrize("why", ["none", "other sensor", "old", "damaged"])
def test_it_is_made_once_where_none_may_be_used_and_said(
    why: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    endpoints = ENDPOINTS
    if why == "other sensor":
        stored()
        endpoints = ENDPOINTS.model_copy(
            update={"serials": {"force": "000300", "force_modbus": "FTS-1234", "axis": "A1"}}
        )
    elif why == "old":
        stored(datetime.now(UTC) - timedelta(days=400))
    elif why == "damaged":
        stored()
        force_file(built_in(), ENDPOINTS).write_text("{")
    made: list[str] = []

    def make(*_: object) -> object:
        made.append("made")
        return force_calibration(serial=endpoints.serials["force"])

    monkeypatch.setattr(mock_calibration, "_measured_force", make)
    for _ in range(2):
        assert plug_into(built_in(), endpoints).calibration.of_force is not None
    assert made == ["made"]
    assert capsys.readouterr().err.count("was calibrated by itself") == 1


def test_a_mock_axis_is_calibrated_once_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stored()
    made: list[str] = []

    def make(*_: object) -> object:
        made.append("made")
        return axis_calibration()

    monkeypatch.setattr(mock_calibration, "_measured_axis", make)
    for _ in range(2):
        assert plug_into(built_in(), ENDPOINTS).calibration.of_axis is not None
    assert made == ["made"]
    assert capsys.readouterr().err.count("the mock axis EPOS4 A1 was calibrated by itself; kept in") == 1
    assert plug_into(built_in(["tracker.port=tcp://10.0.0.1:8765"]), ENDPOINTS).calibration.of_axis is None


def test_a_computer_too_busy_to_calibrate_the_mock_axis_is_told_and_goes_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def late(*_: object) -> object:
        raise DeviceError("its heartbeat is missing")

    stored()
    monkeypatch.setattr(mock_calibration, "_measured_axis", late)
    assert plug_into(built_in(), ENDPOINTS).calibration.of_axis is None
    assert "the mock axis was not calibrated, next time again: its heartbeat is missing" in capsys.readouterr().err


def test_where_it_cannot_be_kept_that_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], own_state: Path
) -> None:
    force_file(built_in(), ENDPOINTS).mkdir(parents=True)
    monkeypatch.setattr(mock_calibration, "_measured_force", lambda *_: force_calibration())
    assert plug_into(built_in(), ENDPOINTS).calibration.of_force is not None
    assert "and again next time: " in capsys.readouterr().err


def test_a_wiring_that_contradicts_what_is_kept_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    stored()
    monkeypatch.setattr("api.cli.mock_bench.bench_process", lambda *_: contextlib.nullcontext((None, ENDPOINTS)))
    wrong = built_in(["force.compression=positive"])
    with (
        pytest.raises(UsageError, match=r"force.compression positive: the calibration found compression negative"),
        bench_for(wrong),
    ):
        pass
    with bench_for(wrong, refuses=False) as (live, _):
        assert live.calibration.of_force is not None  # for the loop, which refuses the approach


def test_whoever_only_looks_or_retracts_needs_no_calibration(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mock_calibration, "_measured_force", lambda *_: pytest.fail("calibrated"))
    ports = ("force.port=/dev/ttyUSB0", "axis.port=/dev/ttyACM0", "tracker.port=/dev/ttyUSB1")
    real = built_in([*ports, "axis.increments_per_mm=2000"])
    with bench_for(real, approaches=False) as (live, _):
        assert live == real
    with bench_for(real, refuses=False) as (live, _):
        assert live == real


def test_a_real_axis_whose_scale_nobody_stated_is_refused_before_a_bench_starts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The usual scale of another screw would move the tip, and write its limits, by another length than it says."""
    monkeypatch.setattr("api.cli.mock_bench.bench_process", lambda *_: pytest.fail("a bench was started"))
    for product in ("maxon-epos4", "zaber-ascii"):
        with (
            pytest.raises(UsageError, match=rf"axis.increments_per_mm is not stated for the {product} at /dev/ttyACM0"),
            bench_for(built_in([f"axis.product={product}", "axis.port=/dev/ttyACM0"])),
        ):
            pass


def test_whoever_recovers_is_not_refused_for_a_scale_that_is_not_stated() -> None:
    """The screw may have the 2000 that were used so far, and the tip must come out before a file is edited."""
    real = built_in([*(f"{role}.port=/dev/{role}" for role in ("force", "axis", "tracker"))])
    with bench_for(real, approaches=False) as (live, _):
        assert live == real
    with (
        pytest.raises(UsageError, match=r"used so far is `axis.increments_per_mm = 2000`"),
        bench_for(real, refuses=False),
    ):
        pass


@pytest.mark.parametrize("moves", [
    lambda wiring: calibrate_axis(wiring, AxisAsked(1.0, 11.0, True, True, None, None), cast(Person, None)),
    lambda wiring: calibrate_dynamics(wiring, 1.0, True, cast(Person, None)),
])  # fmt: skip
def test_an_axis_is_not_moved_for_its_own_calibration_by_a_scale_that_is_not_stated(
    moves: Callable[[Wiring], object],
) -> None:
    with pytest.raises(UsageError, match=r"axis.increments_per_mm is not stated"):
        moves(built_in(["axis.port=/dev/a", "tracker.port=/dev/b", "force.port=/dev/c"]))


def test_a_plug_in_s_own_scale_is_one() -> None:
    class Speaks(AxisProduct):
        increments_per_mm: float = 1.0

    refuse_unstated_scale(Wiring.model_construct(axis=Speaks(port="/dev/a")))


def test_a_scale_that_is_stated_or_said_by_the_drive_or_the_mock_bench_is_none_of_these() -> None:
    real = "axis.port=/dev/a"
    for settings in ((real, "axis.increments_per_mm=2000"), (real, "axis.product=cia402"), ()):
        refuse_unstated_scale(built_in(list(settings)))


def test_a_real_sensor_beside_a_mock_axis_is_never_calibrated_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mock_calibration, "_measured_force", lambda *_: pytest.fail("calibrated"))
    known = force_calibration(serial="real")
    wiring = built_in(["force.port=/dev/ttyUSB0"])
    wiring = wiring.model_copy(update={"calibration": wiring.calibration.model_copy(update={"of_force": known})})
    live = plug_into(wiring, ENDPOINTS)
    assert (live.force.port, live.axis.port, live.calibration.of_force) == ("/dev/ttyUSB0", "/dev/pts/92", known)


def test_a_real_sensor_without_calibration_is_refused_before_a_bench_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("api.cli.mock_bench.bench_process", lambda *_: pytest.fail("a bench was started"))
    with (
        pytest.raises(UsageError, match="no force calibration of the sensor at /dev/ttyUSB0"),
        bench_for(built_in(["force.port=/dev/ttyUSB0"])),
    ):
        pass


@pytest.mark.parametrize(
    ("settings", "kinds"),
    [
        ((), {"axis", "dynamics", "force"}),
        (("axis.port=/dev/ttyACM0",), {"force"}),
        (("force.port=/dev/ttyUSB0", "axis.port=/dev/ttyACM0"), set[str]()),
        (("input.a.product=firmata-glove",), {"axis", "dynamics", "force", "glove"}),
        (("input.a.product=firmata-glove", "input.b.product=firmata-glove", "input.b.port=/dev/ttyUSB1"),
         {"axis", "dynamics", "force"}),
    ],
)  # fmt: skip
def test_a_service_asks_nobody_for_what_the_mock_bench_does_with_its_own_devices(
    settings: tuple[str, ...], kinds: set[str]
) -> None:
    found = done_by_mock(built_in(list(settings)))
    assert set(found) == {f"calibrate-{kind}" for kind in kinds}
    assert all(callable(function_at(name)) for name in found.values())
