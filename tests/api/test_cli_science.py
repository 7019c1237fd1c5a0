"""`rig fit` and `rig report` from the command line."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from api.cli.app import build
from rig.errors import DataError, UsageError
from rig.tissue.model import load_model
from tests.rig.tissue.synthetic import Bench, write_made_session


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of two trials at two speeds."""
    strokes = Bench(rate_Hz=500.0).strokes(trials=2, speeds_mm_s=(5.0, 20.0))
    return write_made_session(tmp_path_factory.mktemp("made") / "session", strokes)


def run(*arguments: str | Path) -> str:
    """The command's output; a failure is raised as it is."""
    result = CliRunner().invoke(build(str(arguments[0])), [str(part) for part in arguments], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def test_fit_writes_picture_table_and_model_beside_the_session(session: Path, tmp_path: Path) -> None:
    run("fit", session, "--json", tmp_path / "fit.json")
    values = json.loads((tmp_path / "fit.json").read_text())
    assert values["model"] == str(session / "fit" / "model.json")
    assert values["constant"]["max_error_percent"] > 10 * values["index"]["max_error_percent"]
    assert {path.name for path in (session / "fit").iterdir()} == {
        "fit.png", "fit.svg", "residuals.png", "table.csv", "model.json"
    }  # fmt: skip
    assert (session / "fit" / "fit.png").read_bytes().startswith(b"\x89PNG")
    assert load_model(session / "fit" / "model.json").law.name == "index"


def test_fit_writes_elsewhere_and_over_older_results(session: Path, tmp_path: Path) -> None:
    for _ in range(2):
        run("fit", session, "--out", tmp_path / "deep" / "results")
    assert (tmp_path / "deep" / "results" / "table.csv").read_text().startswith("force_N,measured_mm")


def test_fit_refuses_a_place_that_is_a_file(session: Path, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(UsageError, match=r"taken: cannot be made"):
        run("fit", session, "--out", tmp_path / "taken")


def test_fit_refuses_a_folder_that_is_no_session(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"no such session folder"):
        run("fit", tmp_path / "nowhere")


def test_report_writes_one_file(session: Path, tmp_path: Path) -> None:
    run("report", session, "--out", tmp_path / "first.html")
    assert (tmp_path / "first.html").read_text().startswith("<!DOCTYPE html>")
    run("report", session)
    assert (session / "report.html").exists()


@pytest.mark.parametrize("command", ["fit", "report"])
def test_help_has_an_example(command: str) -> None:
    assert f"Example: rig {command} sessions/first" in " ".join(run(command, "--help").split())
