"""`rig calibrate force` as a person does it, on a sensor that is right and on ones that are not."""

import json
import re
from datetime import UTC, datetime
from pathlib import Path

import pytest

from api.cli.mock_bench import plug_into
from api.cli.mock_calibration import force_file
from api.cli.options import built_in
from controller.commissioning.refusals import contradictions
from mock_devices.testing.commands import EXAMPLES, PATIENCE_S, Running, Said, ServedBench, rig, until
from rig.config.calibration_files import read_force, text_of
from rig.errors import CheckFailed
from tests.calibrations import force_calibration
from tests.system.test_stop import asked

pytestmark = pytest.mark.xdist_group("commands")

WEIGHTS = ["--weights", "2 N,5 N,10 N", "--load", "pressed", "--pause", "0.3"]
PORT = re.compile(r"POST http://127.0.0.1:(\d+)/estop")
REQUEST = re.compile(r"put (\d+) N on the tip|take every weight off")


def guided(bench: ServedBench, folder: Path, *options: str) -> Said:
    """The command, and somebody who puts on what it asks for."""
    port = f"force.port={bench.endpoints.devices['force']['serial']}"
    running = Running(["calibrate", "force", "--set", port, *WEIGHTS, *options], folder)
    assert running.process.stdout
    said = ""
    for line in running.process.stdout:
        said += line
        asked = REQUEST.match(line)
        if asked:
            bench.control.set({"load.axial_N": float(asked[1] or 0)})
    ended = running.end()
    return Said(ended.code, said, ended.err)


def test_a_person_is_led_through_and_the_file_and_its_line_are_there(bench: ServedBench, tmp_path: Path) -> None:
    said = guided(bench, tmp_path, "--json", "result.json")
    assert said.code == 0, said.err
    result = json.loads((tmp_path / "result.json").read_text())
    found = read_force(tmp_path / result["file"])
    assert (found.product, found.serial, found.channel, found.compression) == (
        "BFT-SENS-SER-M8", "000271", "fz", "negative",
    )  # fmt: skip
    assert f'[calibration]\nforce = "{result["file"]}"' in said.out
    assert [load.load_N for load in found.loads] == [0, 2, 5, 10, 5, 2, 0]
    assert found.matrix[2][2] == pytest.approx(1.0, abs=0.002)
    # Weights within 0.5 %: 0.29 %; noise of 5 mN in means of a thousand samples is nothing beside that.
    assert found.uncertainty.combined == pytest.approx(0.005 / 3**0.5, rel=0.1)
    assert (datetime.now(UTC) - found.date).total_seconds() < 60


@pytest.mark.parametrize(
    ("fault", "value", "sentence"),
    [
        ("polarity", True, "compression is positive on fz, and force.compression is negative"),
        ("dead", 2, "2 N change no force channel"),
        ("crossed", True, "2 N change fx most"),
        ("saturate", 1.0, "is saturated"),
    ],
)
def test_a_sensor_that_is_wrong_is_named_with_the_first_weight_and_nothing_is_written(
    bench: ServedBench, tmp_path: Path, fault: str, value: float | bool, sentence: str
) -> None:
    bench.control.fault("force", fault, value)
    said = guided(bench, tmp_path)
    assert said.code == 1
    assert sentence in said.sentence
    assert not list(tmp_path.rglob("*.json*"))


def test_a_mock_bench_is_calibrated_once_without_what_is_hidden_in_it(
    bench: ServedBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    bench.control.hide({"gain_error.gain": 0.2})
    found = plug_into(built_in(), bench.endpoints).calibration
    assert found.of_force is not None
    assert found.of_axis is not None
    assert found.of_force.matrix[2][2] == pytest.approx(1.0, abs=0.002)
    assert found.of_axis.scale == pytest.approx(1.0, abs=0.005)
    assert bench.control.truth() == {"gain_error": {"gain": 0.2}}
    assert bench.control.get("load.axial_N", "tissue.present") == {"load.axial_N": 0.0, "tissue.present": True}
    assert plug_into(built_in(), bench.endpoints).calibration == found
    said = capsys.readouterr().err
    assert said.count("000271 was calibrated by itself; kept in") == 1
    # Its scale, and how it follows its set-point.
    assert said.count("62014711 was calibrated by itself; kept in") == 2
    assert force_file(built_in(), bench.endpoints).is_file()


def test_a_wiring_with_a_wrong_scale_is_refused_by_the_first_run_and_by_later_ones(
    bench: ServedBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    wrong = built_in(["axis.increments_per_mm=4000"])
    with pytest.raises(CheckFailed, match="the axis says it went 2 mm and the tracker saw"):
        plug_into(wrong, bench.endpoints)
    assert plug_into(built_in(), bench.endpoints).calibration.of_axis is not None
    assert contradictions(plug_into(wrong, bench.endpoints)) == [
        "axis.increments_per_mm 4000, axis.direction 1: the axis was calibrated with 2000 and 1; correct the wiring, or"
        " calibrate again"
    ]


def test_the_calibration_of_another_sensor_moves_nothing_and_leaves_no_session(
    bench: ServedBench, tmp_path: Path
) -> None:
    (tmp_path / "other.json").write_text(text_of(force_calibration(serial="000999")))
    settings = bench.settings(f"calibration.force={tmp_path / 'other.json'}")
    said = rig("capture", EXAMPLES / "quick.toml", "--out", tmp_path / "session", *settings, folder=tmp_path)
    assert said.code == 2
    assert "is of BFT-SENS-SER-M8 000999, but BFT-SENS-SER-M8 000271 answered" in said.sentence
    assert not (tmp_path / "session").exists()


def axis(folder: Path, *options: str) -> Said:
    """The axis of the built-in mock bench."""
    return rig("calibrate", "axis", "--json", "result.json", *options, folder=folder)


def test_the_axis_of_the_mock_bench_is_calibrated_against_its_tracker(tmp_path: Path) -> None:
    said = axis(tmp_path)
    assert said.code == 0, said.err
    result = json.loads((tmp_path / "result.json").read_text())
    result |= result["calibration"]
    assert result["scale"] == pytest.approx(1.0, abs=0.005)
    assert (result["direction"], result["direction_known_by"]) == (1, "limb marker")
    assert f'[calibration]\naxis = "{result["file"]}"' in said.out


def test_a_press_stops_the_axis_while_it_is_calibrated(bench: ServedBench, tmp_path: Path) -> None:
    settings = bench.settings("tracker.product=ndi-polaris")
    running = Running(["calibrate", "axis", *settings, "--clear", "--toward-limb"], tmp_path)
    assert running.process.stdout
    port = int(next(found[1] for line in running.process.stdout if (found := PORT.search(line))))

    def moves() -> bool:
        return abs(float(bench.control.get("axis.velocity_mm_s")["axis.velocity_mm_s"])) > 1.0

    until(moves, PATIENCE_S, "the axis under way")
    assert asked(port, "/estop")[1]["done"] == "braked while the drive moved by itself: nothing starts"
    ended = running.end()
    assert ended.code == 3 and "stopped on request" in ended.sentence
    assert not moves() and bench.control.get("axis.powered")["axis.powered"] is False
    assert not list(tmp_path.rglob("*.json"))


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("axis.increments_per_mm=4000", r"the axis says it went 2 mm and the tracker saw (3\.9\d*|4|4\.0\d*) mm"),
        ("axis.increments_per_mm=1000", r"the axis says it went 2 mm and the tracker saw (0\.9\d*|1|1\.0\d*) mm"),
        ("axis.direction=-1", "the tip goes away from the limb's marker"),
    ],
)
def test_a_scale_or_sense_that_is_wrong_stops_at_the_first_step(tmp_path: Path, setting: str, sentence: str) -> None:
    said = axis(tmp_path, "--set", setting)
    assert said.code == 1
    assert re.search(sentence, said.sentence)
    written = tmp_path / "result.json"
    assert list(tmp_path.rglob("*.json")) == [written]
    assert re.search(sentence, json.loads(written.read_text())["reason"])
