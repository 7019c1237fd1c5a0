"""Import, fit, diagnose, report and export take a session, a recording, a foreign folder and a foreign file alike."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from api.cli.app import build
from rig.errors import UsageError

PLACES = ("session", "recording", "folder", "file")
MAPPING = """
stated = { speed_mm_s = 4.0 }

[[tables]]
files = "*.txt"
delimiter = ";"
decimal = ","
unit_row = 2
time = { column = "t", unit = "ms" }
columns.force = { column = "Kraft", positive = "tension" }
columns.position = { column = "Weg", positive = "out" }
"""
# What each command leaves in the folder it is given, and how it ends: four strokes of one speed tell no causes apart.
LEFT = {"import": "run_1.mcap", "fit": "model.json", "diagnose": "", "report": "", "export": "session.h5"}


def rig(*arguments: object) -> Result:
    return CliRunner().invoke(build(str(arguments[0])), [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Strokes of a machine that counts pulls as positive, as its files and as a session."""
    root = tmp_path_factory.mktemp("lab")
    (root / "machine").mkdir()
    random = np.random.default_rng(3)
    time_s = np.arange(0, 6, 0.01)
    for number in range(1, 3):
        place_mm = np.interp(time_s, [0, 0.5, 3, 3.5, 6], [0, 0, 10, 10, 0])
        depth_mm = np.maximum(place_mm - 2.0 - 0.01 * number, 0.0)
        force_N = 0.2 * depth_mm * np.exp(0.12 * depth_mm) + random.normal(0, 0.004, len(time_s))
        rows = zip(1e3 * time_s, -force_N, -place_mm, strict=True)
        body = "".join(f"{at:.1f};{force:.5f};{place:.5f}\n".replace(".", ",") for at, force, place in rows)
        (root / "machine" / f"run_{number}.txt").write_text(f"t;Kraft;Weg\nms;N;mm\n{body}")
    (root / "machine.toml").write_text(MAPPING)
    made = rig("import", root / "machine", "--mapping", root / "machine.toml", "--out", root / "made")
    assert made.exit_code == 0, made.output
    return {
        "session": root / "made",
        "recording": root / "made" / "run_1.mcap",
        "folder": root / "machine",
        "file": root / "machine" / "run_1.txt",
    }


def asked(command: str, place: str, places: dict[str, Path], out: Path) -> tuple[Result, dict[str, object]]:
    """The command on the place, with its mapping where the files do not say what they hold, and its JSON."""
    mapping = ["--mapping", places["folder"].parent / "machine.toml"] if place in ("folder", "file") else []
    target = out / "page.html" if command == "report" else out / "out"
    formats = ["--format", "hdf5"] if command == "export" else []
    result = rig(command, places[place], *mapping, "--out", target, *formats, "--json", out / "said.json")
    return result, json.loads((out / "said.json").read_text())


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("command", LEFT)
def test_every_place_is_taken(command: str, place: str, places: dict[str, Path], tmp_path: Path) -> None:
    result, said = asked(command, place, places, tmp_path)
    assert result.exit_code == (1 if command == "diagnose" else 0), result.output
    assert "error" not in said
    if LEFT[command]:
        assert (tmp_path / "out" / LEFT[command]).is_file()
    if command == "report":
        assert "run_1" in (tmp_path / "page.html").read_text()
    if command == "diagnose":
        assert said["verdict"] == "not judged"


def test_a_fit_of_the_files_is_that_of_their_session(places: dict[str, Path], tmp_path: Path) -> None:
    laws = []
    for place in ("session", "folder"):
        (tmp_path / place).mkdir()
        laws.append(asked("fit", place, places, tmp_path / place)[1]["index"])
    assert laws[0] and laws[0] == laws[1]


@pytest.mark.parametrize("command", LEFT)
def test_a_mapping_for_other_columns_is_refused_and_the_reason_is_in_the_json(
    command: str, places: dict[str, Path], tmp_path: Path
) -> None:
    (tmp_path / "other.toml").write_text(MAPPING.replace('"Kraft"', '"Force"'))
    target = tmp_path / ("page.html" if command == "report" else "out")
    options = ["--mapping", tmp_path / "other.toml", "--out", target, "--json", tmp_path / "said.json"]
    result = rig(command, places["folder"], *options)
    reason = json.loads((tmp_path / "said.json").read_text())["reason"]
    assert result.exit_code != 0 and not target.exists()
    assert "run_1.txt: no column 'Force'; there are 't', 'Kraft', 'Weg'" in reason


@pytest.mark.parametrize("command", ["import", "fit", "diagnose", "export", "report"])
def test_a_question_that_nobody_answers_is_exit_2_and_in_the_json_with_the_line_that_answers_it(
    command: str, tmp_path: Path
) -> None:
    rows = "".join(f"0.{k},{k / 3},{2 * k},{-k / 7}\n" for k in range(10))
    (tmp_path / "a.csv").write_text(f"time_s,a,depth_mm,b\n{rows}")
    target = tmp_path / ("page.html" if command == "report" else "out")
    result = rig(command, tmp_path / "a.csv", "--out", target, "--json", tmp_path / "said.json")
    said = json.loads((tmp_path / "said.json").read_text())
    assert isinstance(result.exception, UsageError) and said["exit_code"] == result.exception.exit_code == 2
    assert not target.exists()
    assert 'give the line columns.force = { column = "?", unit = "?" } in' in said["reason"]


@pytest.mark.parametrize("command", ["import", "export"])
def test_what_the_terminal_doubts_is_in_the_json(command: str, tmp_path: Path) -> None:
    rows = "".join(f"{0.01 * k:.2f},{0.2 * k:.1f},{0.1 * k:.1f},{0.1 * k:.1f}\n" for k in range(40))
    (tmp_path / "a.csv").write_text(f"time_s,force_N,depth_mm,gap_mm\n{rows}")
    result = rig(command, tmp_path / "a.csv", "--out", tmp_path / "out", "--json", tmp_path / "said.json")
    assert result.exit_code == 0, result.output
    shown, said = " ".join(result.output.split()), json.loads((tmp_path / "said.json").read_text())["remarks"]
    for doubt in ("as if pressed; pulled, write the other", "position is taken to be 'depth_mm'; it may be 'gap_mm'"):
        assert doubt in shown and any(doubt in one for one in said)
