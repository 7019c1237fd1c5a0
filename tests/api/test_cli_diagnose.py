"""`rig diagnose` and `rig protocol check` from the command line: files, report, and the model that control takes."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from api.cli.app import build
from benchmarks.hidden.draw import draw_secret, recorded, session_of
from controller.experiments import tracked
from rig.config.wiring import Wiring
from rig.intake.mapping import MAPPING_FILE
from rig.report.diagnosed import Diagnosed, diagnosis_section, read_diagnosis
from rig.tissue.model import load_model
from tests.rig.diagnosis.test_bad_input import write_csv
from tests.rig.recording.measured import TABLES, write

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(*arguments: str | Path, exit_code: int = 0) -> str:
    """The command's output; a failure is raised as it is."""
    result = CliRunner().invoke(build(str(arguments[0])), [str(part) for part in arguments], catch_exceptions=False)
    assert result.exit_code == exit_code, result.output
    return result.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six strokes with friction in them as CSV files, diagnosed into the folder a session keeps its diagnosis in."""
    made = tmp_path_factory.mktemp("measured")
    bench, strokes = recorded(501, draw_secret(np.random.default_rng([501, 5]), "friction"), 6)
    for k, trial in enumerate(session_of(bench, strokes).trials):
        write_csv(made / f"trial_{k}", trial)
    write(made, {MAPPING_FILE: 'recording = "{recording}"' + TABLES})
    run("diagnose", made, "--out", made / "diagnosis", "--json", made / "said.json")
    return made


def test_a_csv_folder_is_diagnosed_and_pictures_json_and_model_are_left(folder: Path) -> None:
    said = json.loads((folder / "said.json").read_text())
    assert said["findings"][0]["effects"][0] == "friction"
    assert said == json.loads((folder / "diagnosis" / "diagnosis.json").read_text())
    names = {path.name for path in (folder / "diagnosis").glob("*.png")}
    assert names == {"share.png", "simulation.png", "residuals.png", "evidence.png", "confusability.png"}


def test_the_extended_model_goes_into_gains_and_inverse_model(folder: Path) -> None:
    model = load_model(folder / "diagnosis" / "model.json")
    found = json.loads((folder / "said.json").read_text())["findings"][0]["parameters"]["friction_N"]["value"]
    assert model.effects[0].parameters["friction_N"].value == found
    program = tracked.plan((0.5 * model.valid.force_N,), 2.0, model, Wiring())
    assert {step.friction_N for step in program.steps if step.step == "track"} == {found}


def test_the_report_gives_the_statement_the_pictures_and_what_could_not_be_tested(folder: Path) -> None:
    found = read_diagnosis(folder)
    assert isinstance(found, Diagnosed)
    html = diagnosis_section(found)
    assert found.result.statement in html and "friction of" in found.result.statement
    assert html.count("<svg") == 5
    assert html.index("explained:") < html.index("% of its power") < html.index("measured - simulated")
    assert "hang a known weight" in html


def test_one_stroke_is_answered_without_a_verdict_in_its_favour(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    shutil.copytree(folder / "trial_0", tmp_path / "one" / "trial_0")
    shutil.copy(folder / MAPPING_FILE, tmp_path / "one")
    said = run("diagnose", tmp_path / "one", "--json", tmp_path / "said.json", exit_code=1)
    assert said.splitlines()[1].startswith("explained: Nothing could be judged: 1 recording of one cycle")
    assert said.count("cannot be tested") == 1
    found = json.loads((tmp_path / "said.json").read_text())
    assert found["findings"] == [] and found["detectable"] == {}
    assert "examples/diagnosis.toml" in found["next_experiment"]["do"]


def test_a_session_that_was_not_diagnosed_says_how_to(tmp_path: Path) -> None:
    assert "rig diagnose" in diagnosis_section(read_diagnosis(tmp_path))


def test_a_protocol_is_checked_and_its_confusability_drawn(tmp_path: Path) -> None:
    said = run("protocol", "check", EXAMPLES / "diagnosis.toml", "--out", tmp_path / "pictures")
    assert "friction" in said
    assert (tmp_path / "pictures" / "confusability.png").read_bytes().startswith(b"\x89PNG")


def test_a_protocol_is_checked_on_the_tissue_of_a_diagnosis(folder: Path, tmp_path: Path) -> None:
    model = folder / "diagnosis" / "model.json"
    said = run("protocol", "check", EXAMPLES / "diagnosis.toml", "--model", model, "--json", tmp_path / "check.json")
    found = json.loads((tmp_path / "check.json").read_text())
    assert found["tissue"].startswith("extended of ") and f"On {found['tissue']}" in said
    assert "friction" not in found["detectable"] and found["detectable"]["backlash"]["trials"] == 0
