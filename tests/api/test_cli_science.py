"""`rig fit` and `rig report` from the command line."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from api.cli.app import build
from mock_devices.testing.made.synthetic import Bench, index_force, write_made_session
from rig.errors import DataError, UsageError
from rig.tissue.model import load_model
from rig.tissue.registry import LAWS


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of two trials at two speeds."""
    cycles = Bench(rate_Hz=500.0).cycles(trials=2, speeds_mm_s=(5.0, 20.0))
    return write_made_session(tmp_path_factory.mktemp("made") / "session", cycles)


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
        "fit.json", "fit.png", "fit.svg", "residuals.png", "residuals.svg", "table.csv", "model.json"
    }  # fmt: skip
    assert (session / "fit" / "fit.png").read_bytes().startswith(b"\x89PNG")
    assert load_model(session / "fit" / "model.json").law.name == "index"


def test_fit_writes_elsewhere_and_over_older_results(session: Path, tmp_path: Path) -> None:
    for _ in range(2):
        run("fit", session, "--out", tmp_path / "deep" / "results")
    assert (tmp_path / "deep" / "results" / "table.csv").read_text().startswith("force_N,measured_mm")


def test_fit_compares_further_laws_with_known_parameters_and_saves_the_one_asked_for(
    session: Path, tmp_path: Path
) -> None:
    wanted = ["--laws", "fung,layer,kelvin_voigt", "--known", "thickness_mm=25", "--model", "fung"]
    output = run("fit", session, "--out", tmp_path, "--json", tmp_path / "fit.json", *wanted)
    values = json.loads((tmp_path / "fit.json").read_text())
    assert [name for name in values if isinstance(values[name], dict) and "rows" in values[name]] == [
        "constant", "index", "fung", "layer"
    ]  # fmt: skip
    assert values["layer"]["parameters"]["thickness_mm"]["value"] == 25
    assert load_model(tmp_path / "model.json").law.name == "fung"
    assert "K and B for control (fung)" in output
    assert "speed: B = " in output


def test_fit_takes_what_a_diagnosis_named_as_known(session: Path, tmp_path: Path) -> None:
    run(
        "fit",
        session,
        "--out",
        tmp_path / "first",
        "--laws",
        "extended",
        "--known",
        "frame_compliance_mm_N=0.05",
        "--model",
        "extended",
    )
    named = tmp_path / "first" / "model.json"
    output = run("fit", session, "--out", tmp_path / "second", "--with", named, "--model", "extended")
    law = load_model(tmp_path / "second" / "model.json").law
    assert law.name == "extended"
    assert law.values == pytest.approx(load_model(named).law.values)
    assert re.search(r"frame_compliance_mm_N +│ 0.05 +│ known", output)


def test_fit_prints_many_laws_in_80_columns_without_a_cell_broken(session: Path, tmp_path: Path) -> None:
    output = run("fit", session, "--out", tmp_path, "--laws", "fung,power")
    assert output.count("Displacement in mm at given forces") == 2
    assert max(len(line) for line in output.splitlines() if "│" in line or "━" in line) <= 80
    assert not re.search(r"│ +\d +│ *$", output.split("Worst errors")[0], re.MULTILINE)


def test_fit_of_every_law_draws_them_all(session: Path, tmp_path: Path) -> None:
    run("fit", session, "--out", tmp_path, "--laws", "all")
    for picture in ("fit.png", "residuals.png"):
        assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")
    assert all(name in (tmp_path / "fit.svg").read_text() for name in LAWS)


BAD = [
    (["--laws", "cubic"], r"unknown tissue law 'cubic'; nearest .*; all: .*fung.*sls"),
    (["--with", "nowhere.json"], r"nowhere.json: no such file"),
    (["--model", "cubic"], r"unknown tissue law 'cubic'"),
    (["--known", "k=1"], r"--known k=1: the laws compared have k_N_mm, damping_N_s_mm, a_N_mm, b_per_mm; add"),
    (["--known", "k_N_mm=soft"], r"--known k_N_mm=soft: write NAME=NUMBER"),
    (["--known", "k_N_mm=nan"], r"--known k_N_mm=nan: constant takes 1e-06 to 10000 N/mm"),
    (["--known", "k_N_mm=0"], r"--known k_N_mm=0: constant takes 1e-06 to 10000 N/mm"),
    (["--laws", "layer", "--known", "thickness_mm=0.5"], r"tip radius over tissue thickness is 6; .* not above 3"),
    (["--lattice", "--block", "9x9"], r"--block 9x9: write vertices in x, y and z and their spacing in mm, like"),
    (["--lattice", "--block", "8x9x12"], r"x and y need an odd number"),
    (["--lattice", "--block", "9x9x12@0"], r"lattice spacing is 0.0 mm; it must be above 0"),
    (["--lattice", "--block", "9x9x4@2"], r"a block 6 mm high is simulated to 5.1 mm at most"),
    (["--lattice", "--springs", "soft"], r"--springs soft: choose study or stabilised"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "says"), BAD, ids=[" ".join(options) for options, _ in BAD])
def test_fit_refuses_what_it_cannot_do_in_one_sentence(
    session: Path, tmp_path: Path, options: list[str], says: str
) -> None:
    with pytest.raises((UsageError, DataError), match=says):
        run("fit", session, "--out", tmp_path, *options)


def test_fit_of_several_subjects_needs_a_place_and_leaves_each_out(session: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    cycles = Bench(rate_Hz=500.0, force=index_force(a_N_mm=0.2)).cycles(trials=1, speeds_mm_s=(5.0, 20.0))
    write_made_session(other, cycles, subject={"id": "8"})
    with pytest.raises(UsageError, match=r"2 sessions have no one place for results: give a folder with --out"):
        run("fit", session, other)
    output = run("fit", session, other, "--out", tmp_path / "both", "--json", tmp_path / "fit.json")
    values = json.loads((tmp_path / "fit.json").read_text())
    assert values["index"]["held_out"]["subjects"]["max_error_mm"] > values["index"]["max_error_mm"] > 0
    assert "subject" in output
    assert load_model(tmp_path / "both" / "model.json").data.subject == ""


def test_the_lattice_is_fitted_to_an_imported_session(tmp_path: Path) -> None:
    source = Path(__file__).parents[2] / "examples" / "measured"
    run("import", source, "--out", tmp_path / "measured")
    block = ["--lattice", "--block", "9x9x12@2"]
    run("fit", tmp_path / "measured", *block, "--json", tmp_path / "fit.json")
    assert {"model.json", "fit.json", "lattice.png", "table.csv"} <= {
        path.name for path in (tmp_path / "measured" / "fit").iterdir()
    }
    found = json.loads((tmp_path / "fit.json").read_text())["lattice"]
    assert found["vertices"] == [9, 9, 12]
    worst = {name: model["max_error_percent"] for name, model in found["models"].items()}
    assert worst["lattice index"] < 0.5 * worst["lattice constant"]
    for point in found["points"]:
        assert point["k_loop_N_mm"] == pytest.approx(point["k_exact_N_mm"], rel=0.01)


def test_springs_alone_are_refused_where_the_block_collapses(session: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"depth of 7\.\d+ mm lies outside 0 \.\.\. .* mm, which this lattice carries"):
        run("fit", session, "--out", tmp_path, "--lattice", "--block", "9x9x12@2", "--springs", "study")


def test_fit_refuses_a_place_that_is_a_file(session: Path, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(UsageError, match=r"taken is a file, not a folder; give another place"):
        run("fit", session, "--out", tmp_path / "taken")


def test_fit_of_a_drive_axis_names_the_command_for_it(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.csv").write_text("t,F,x\n0,1,0\n1,2,1\n")
    columns = 'columns = { force = { column = "F", unit = "N" }, position = { column = "x", unit = "mm" } }'
    table = f'[[tables]]\nfiles = "*.csv"\ntime = {{ column = "t", unit = "s" }}\n{columns}\n[axis]\n'
    (tmp_path / "in" / "mapping.toml").write_text(table)
    with pytest.raises(UsageError, match=r"in: is a drive axis, as \[axis\] in its mapping says.*`rig diagnose`"):
        run("fit", tmp_path / "in", "--out", tmp_path / "out")


def test_fit_refuses_a_folder_that_is_no_session(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"no such file or folder; give the one that holds the data"):
        run("fit", tmp_path / "nowhere")


def test_report_writes_one_file(session: Path, tmp_path: Path) -> None:
    run("report", session, "--out", tmp_path / "first.html")
    assert (tmp_path / "first.html").read_text().startswith("<!DOCTYPE html>")
    run("report", session)
    assert (session / "report.html").exists()


@pytest.mark.parametrize("command", ["fit", "report"])
def test_help_has_an_example(command: str) -> None:
    assert f"Example: rig {command} sessions/first" in " ".join(run(command, "--help").split())
