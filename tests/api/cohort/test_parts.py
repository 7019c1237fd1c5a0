"""Files of a laboratory that measured several sites, each worked on by itself."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from api.cli.app import build
from api.operations.cohort.task import Task
from mock_devices.testing.made.synthetic import Bench, index_force
from rig.errors import CheckFailed, UsageError
from rig.intake.mapping import MAPPING_FILE
from rig.results.cohort import CohortResult
from rig.trials.opening import AS_IT_IS
from tests.rig.recording.measured import TABLES, pressed

# Recorded in turn, as a plate is: a site's recordings do not follow each other.
SITES = ("A1", "B[2]", "A1", "B[2]", "A1", "B[2]")
STIFFNESS = {"A1": 0.08, "B[2]": 0.24}
LABELS = 'recording = "{site}_{run}"\nsite = "{site}"\n' + TABLES.replace("{recording:trial_*}", "{site}_{run}")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cycles = [
        Bench(rate_Hz=100.0, force=index_force(a_N_mm=STIFFNESS[site])).cycle(speed_mm_s, seed)
        for seed, (site, speed_mm_s) in enumerate(zip(SITES, (10.0, 10.0, 20.0, 20.0, 15.0, 15.0), strict=True))
    ]
    plate = pressed(tmp_path_factory.mktemp("lab") / "plate", cycles)
    for number, site in enumerate(SITES):
        (plate / f"trial_{number}").rename(plate / f"{site}_{number}")
    (plate / MAPPING_FILE).write_text(LABELS)
    return plate


@pytest.fixture
def plate(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "plate"))


def run(*arguments: str | Path) -> Any:
    return CliRunner().invoke(build(str(arguments[0])), [str(part) for part in arguments], catch_exceptions=True)


def stiffness(folder: Path) -> float:
    return float(json.loads((folder / "fit.json").read_text())["index"]["parameters"]["a_N_mm"]["value"])


def by_site(plate: Path, out: Path, *more: str | Path) -> CohortResult:
    found = run("fit", plate, *more, "--by", "site", "--out", out)
    assert found.exit_code == 0, found.output
    return CohortResult.read(out / "cohort.json")


def test_each_site_is_fitted_by_itself(plate: Path, tmp_path: Path) -> None:
    found = by_site(plate, tmp_path / "out")
    assert [(each.subject, each.folder, each.state) for each in found.sessions] == [
        ("A1", "A1", "done"), ("B[2]", "B_2", "done")
    ]  # fmt: skip
    for each in found.sessions:
        assert each.parameters["a_N_mm"] == pytest.approx(STIFFNESS[each.subject], rel=0.05)
        assert each.worst_percent is not None and each.worst_percent < 10.0
        assert stiffness(tmp_path / "out" / each.folder) == each.parameters["a_N_mm"]
    assert found.by == "site" and found.parameters["a_N_mm"].subjects == 2
    assert str(plate) in found.sessions[0].session, "what is made of it for the work is gone"
    pooled = run("fit", plate, "--out", tmp_path / "pooled")
    assert "2 sites (A1, B[2]) are taken as one tissue under one hand: --by site takes each" in pooled.output
    assert abs(stiffness(tmp_path / "pooled") / STIFFNESS["A1"] - 1) > 0.2, "or nothing is shown by the above"


def test_a_part_that_is_forgotten_gives_all_sites_one_stiffness(
    plate: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("api.operations.cohort.runners.cores", lambda: 1)
    monkeypatch.setattr(Task, "at_hand", property(lambda task: (Path(task.near), AS_IT_IS)))
    first, second = (each.parameters["a_N_mm"] for each in by_site(plate, tmp_path / "out").sessions)
    assert first == second != pytest.approx(STIFFNESS["A1"], rel=0.05)


def test_a_site_can_be_chosen_by_its_label(plate: Path, tmp_path: Path) -> None:
    assert run("fit", plate, "--only", "site=A*", "--out", tmp_path / "one").exit_code == 0
    assert stiffness(tmp_path / "one") == pytest.approx(STIFFNESS["A1"], rel=0.05)
    found = run("fit", plate, "--only", "site=C*", "--out", tmp_path / "none")
    assert isinstance(found.exception, UsageError)
    assert str(found.exception).endswith("no recording matches --only 'site=C*'; their sites are A1, B[2]")


def test_what_was_fitted_is_kept_for_each_part(plate: Path, tmp_path: Path) -> None:
    session = tmp_path / "session"
    assert run("import", plate, "--out", session).exit_code == 0
    for place in (plate, session):
        by_site(place, tmp_path / "one")
        assert [each.state for each in by_site(place, tmp_path / "two").sessions] == ["kept", "kept"]
    assert by_site(session, tmp_path / "two", "--only", "A1*").sessions[0].parameters["a_N_mm"] == pytest.approx(
        STIFFNESS["A1"], rel=0.05
    )


def test_each_recording_needs_no_label(plate: Path, tmp_path: Path) -> None:
    found = run("fit", plate, "--by", "recording", "--out", tmp_path / "out")
    assert found.exit_code == 0, found.output
    result = CohortResult.read(tmp_path / "out" / "cohort.json")
    assert [each.subject for each in result.sessions] == ["A1_0", "A1_2", "A1_4", "B_2__1", "B_2__3", "B_2__5"]


def test_one_that_cannot_be_read_costs_the_others_nothing(plate: Path, tmp_path: Path) -> None:
    session = tmp_path / "session"
    assert run("import", plate, "--out", session).exit_code == 0
    (session / "A1_0.mcap").write_bytes(b"no recording")
    found = run("fit", session, "--by", "site", "--out", tmp_path / "out")
    assert isinstance(found.exception, CheckFailed)
    assert "1 of 3 sites have no result" in str(found.exception)
    result = CohortResult.read(tmp_path / "out" / "cohort.json")
    assert [each.folder for each in result.sessions] == ["", "A1", "B_2"]
    assert "not a recording" in result.sessions[0].reason


def test_a_reason_names_the_place_and_nothing_that_was_made_of_it(plate: Path, tmp_path: Path) -> None:
    for file in plate.glob("A1_*/force.csv"):
        head, *rows = file.read_text().splitlines()
        file.write_text("\n".join([head, *(f"{row.split(',')[0]},0.7" for row in rows), ""]))
    run("fit", plate, "--by", "site", "--out", tmp_path / "out")
    failed, other = CohortResult.read(tmp_path / "out" / "cohort.json").sessions
    assert (failed.state, other.state) == ("failed", "done")
    assert failed.reason.startswith(f"{plate}: no trial gives a curve")


def test_a_label_that_no_recording_has_is_refused_with_what_to_do(plate: Path, tmp_path: Path) -> None:
    found = run("fit", plate, "--by", "specimen", "--out", tmp_path / "out")
    assert isinstance(found.exception, CheckFailed)
    assert (
        'no recording says its specimen, so none are told apart by it; name it in the mapping (specimen = "{...}")'
        in (str(found.exception))
    )
    assert not (tmp_path / "out" / "plate").exists()


def test_two_parts_that_would_share_a_folder_are_refused(plate: Path, tmp_path: Path) -> None:
    (plate / "B[2]_1").rename(plate / "B_2_7")
    (plate / MAPPING_FILE).write_text(LABELS.replace("{site}_{run}/", "{site}_{run:?}/"))
    found = run("fit", plate, "--by", "site", "--out", tmp_path / "out")
    assert isinstance(found.exception, UsageError)
    assert "site=B[2]: would both be written to B_2; take one after the other with --only" in str(found.exception)


def test_what_is_left_out_of_a_place_is_said(plate: Path, tmp_path: Path) -> None:
    shutil.copytree(plate / "B[2]_1", plate / "C1_7")
    found = by_site(plate, tmp_path / "out")
    assert [each.subject for each in found.sessions] == ["A1", "B[2]"]
    assert "C1_7" in "; ".join(found.remarks)


def test_parts_have_no_one_place_for_results(plate: Path) -> None:
    found = run("diagnose", plate, "--by", "site")
    assert isinstance(found.exception, UsageError)
    assert "parts by site have no one place for results: give a folder with --out" in str(found.exception)
