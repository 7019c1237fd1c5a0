"""Units that stand in a README beside the data, or in a sheet that explains the others, are read from there."""

from pathlib import Path

import numpy as np
import openpyxl
import pytest
import scipy.io

from rig.intake.proposal import propose
from rig.intake.questions import OpenQuestion
from tests.rig.intake.instruments import text
from tests.rig.intake.test_foreign import FORCE_N, ROWS, TIME_S, WAY_MM, came_in, check, lines

SMALL = lines("{:.0f},{:.2f},{:.4f}", TIME_S * 1e3, WAY_MM * 1e3, FORCE_N * 1e3)
HEAD = "Time,Displacement,Force\n"
READMES = {
    "in sentences": "Pressed at 10 mm/s up to 5 N.\nForce in mN, time in ms.\nDisplacement [um] of the tip.\n",
    "with colons": "time: ms\ndisplacement: µm\nforce: mN\n",
    "as a list": "The columns are:\n - Time (ms)\n - Displacement, micrometres\n - Force = mN\n",
    "units first": "Units: ms for time, um for displacement, mN for force\n",
    "respectively": "Time, displacement and force are given in ms, um and mN.\n",
    "as a table": "| column | unit |\n|---|---|\n| `Time` | ms |\n| `Displacement` | um |\n| `Force` | mN |\n",
    "as a codebook": "column,unit,what\nTime,ms,since start\nDisplacement,um,of the axis\nForce,mN,of the cell\n",
    "other words": "# Data\nLoads are in millinewtons, positions in microns, all times in milliseconds.\n",
}  # fmt: skip


@pytest.mark.parametrize("name", ["README.txt", "readme.md", "Read me.txt", "LEGEND", "units.csv"])
@pytest.mark.parametrize("said", READMES)
def test_a_readme_says_the_units_of_columns_that_carry_none(folder: Path, said: str, name: str) -> None:
    text(HEAD, SMALL)(folder)
    (folder / name).write_text(READMES[said])
    check(came_in(folder))
    assert any(f"'Force' is taken to be in mN by {name} line" in doubt for doubt in propose(folder).doubts)
    (folder.parent / "out").rename(folder.parent / "whole")
    check(came_in(folder / "a.csv"))


def test_a_name_that_nobody_knows_is_told_by_what_is_said_of_it(folder: Path) -> None:
    text("t,ch1,ch2\n", SMALL)(folder)
    (folder / "README.txt").write_text("t is the time in ms\nch1: travel of the stage [um]\nch2: load cell, mN\n")
    check(came_in(folder))


@pytest.mark.parametrize("title", ["Units", "Legend", "Info", "README"])
def test_a_sheet_explains_the_others_of_its_workbook(folder: Path, title: str) -> None:
    book = openpyxl.Workbook()
    for row in [HEAD.strip().split(","), *((1e3 * t, 1e3 * x, 1e3 * f) for t, x, f in ROWS)]:
        book["Sheet"].append(row)
    for row in [("Column", "Unit"), ("Time", "ms"), ("Displacement", "um"), ("Force", "mN")]:
        book[title if title in book else book.create_sheet(title).title].append(row)
    book.save(folder / "a.xlsx")
    check(came_in(folder))


def test_the_nearest_readme_counts(folder: Path) -> None:
    (folder / "README.txt").write_text("force in N, displacement in mm, time in s\n")
    (folder / "b").mkdir()
    text(HEAD, SMALL)(folder / "b")
    (folder / "b" / "README.txt").write_text("force in mN, displacement in um, time in ms\n")
    check(came_in(folder))


def test_prose_that_contradicts_itself_is_asked_and_yes_takes_nothing(folder: Path) -> None:
    text("Time (ms),Displacement (um),Force\n", SMALL)(folder)
    (folder / "README.txt").write_text("force in mN\nForce: N\n")
    (question,) = propose(folder).questions
    assert question.usual == "" and "is in mN by README.txt line 1 and in N by README" in question.text
    check(came_in(folder, "mN"))


def test_a_header_s_own_unit_wins_over_prose_with_a_doubt(folder: Path) -> None:
    text("Time (ms),Displacement (um),Force (mN)\n", SMALL)(folder)
    (folder / "README.txt").write_text("figures show force in N\nForce: N\n")
    check(came_in(folder))
    assert any("in mN by its header and in N by README.txt line" in doubt for doubt in propose(folder).doubts)


@pytest.mark.parametrize(
    ("said", "unit", "other"), [("age, height (cm)", "cm", "um"), ("Tip travel in mm\n", "mm", "um")]
)
def test_a_phrase_with_other_words_suggests_a_unit_that_yes_does_not_take(
    folder: Path, said: str, unit: str, other: str
) -> None:
    text("Time (ms),Displacement,Force (mN)\n", SMALL)(folder)
    (folder / "README.txt").write_text(said)
    (question,) = propose(folder).questions
    assert isinstance(question, OpenQuestion) and (question.usual, question.example) == ("", unit)
    assert f"is perhaps in {unit} by README.txt line 1" in question.text
    check(came_in(folder, other))


def test_a_time_of_something_else_is_not_that_of_the_rows(folder: Path) -> None:
    text("Time,Displacement (um),Force (mN)\n", SMALL)(folder)
    (folder / "README.txt").write_text("Hold time in s\n")
    check(came_in(folder))


def test_a_told_unit_of_time_in_which_nobody_records_is_asked(folder: Path) -> None:
    text("Time,Displacement (um),Force (mN)\n", SMALL)(folder)
    (folder / "README.txt").write_text("Time in s\n")
    (question,) = propose(folder).questions
    assert question.usual == ""
    check(came_in(folder, "ms"))


@pytest.mark.parametrize("name", ["unit_3.csv", "reinforced.csv", "variable_load.csv", "info.csv"])
def test_a_table_of_the_folder_explains_no_other(folder: Path, name: str) -> None:
    text("Time (ms),Displacement (um),Force\n", SMALL)(folder)
    (folder / name).write_text(f"Time (ms),Displacement (um),Force (mN)\n{SMALL}")
    said = [question.text for question in propose(folder).questions]
    assert len(said) == 1 and "has no unit" in said[0]


def test_a_readme_that_nobody_may_read_ends_no_import(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text("Time (ms),Displacement (um),Force (mN)\n", SMALL)(folder)
    (folder / "README.md").write_text("force in mN\n")
    read = Path.read_bytes

    def refuse(path: Path) -> bytes:
        if path.name == "README.md":
            raise PermissionError(13, "Permission denied", str(path))
        return read(path)

    monkeypatch.setattr(Path, "read_bytes", refuse)
    check(came_in(folder))


@pytest.mark.parametrize(
    "said",
    [
        "The force range was 50 mN, N = 20 specimens.\n", "maximum force in mN\nforce resolution in mN\n",
        "force constant in N/mm, diameter in um\n", "Force, by the load cell\nMeasured in Jena (N)\n", "forces 10 mN\n",
    ],
)  # fmt: skip
def test_what_is_said_of_something_else_is_no_unit_of_a_column(folder: Path, said: str) -> None:
    text("Time (ms),Displacement (um),Force\n", SMALL)(folder)
    (folder / "README.txt").write_text(said)
    (question,) = propose(folder).questions
    assert "has no unit" in question.text


@pytest.mark.parametrize(
    "said", ["force in mN, displacement in um, time in ms", "time, ms; force, mN; displacement, um"]
)
def test_a_sentence_above_the_names_says_their_units_and_is_no_name_of_a_column(folder: Path, said: str) -> None:
    text(f"# pressed in room 2\n# {said}\n{HEAD}", SMALL)(folder)
    check(came_in(folder))


def test_a_struct_of_texts_beside_an_array_of_structs_says_the_units_of_its_fields(folder: Path) -> None:
    trials = np.zeros((1, 2), dtype=[("time", "O"), ("force", "O"), ("position", "O")])
    for number in range(2):
        trials[0, number] = (1e3 * TIME_S[:, None], 1e3 * FORCE_N[:, None] + 1e-3 * number, 1e3 * WAY_MM[:, None])
    units = {"time": "ms", "force": "mN", "position": "um"}
    scipy.io.savemat(folder / "study.mat", {"trial": trials, "units": units})
    session = came_in(folder)
    assert len(session.trials) == 2
    check(session)
