"""A force without a sign gets it from a column beside it that says it; where one may say it, the keys are shown."""

import tomllib
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest

from rig.config.table import parse
from rig.errors import DataError
from rig.intake.mapping import DataMapping
from rig.intake.proposal import propose
from rig.intake.session import import_folder
from tests.rig.intake.test_foreign import came_in
from tests.rig.recording.measured import NOW

HEAD = "Time (s),Position (mm),Force (N),"
TIME_S = np.arange(200) * 0.02
TURN = np.sin(np.pi * TIME_S)  # two cycles of 2 s


def cycles(pressed_mm: float, pulled_mm: float) -> pd.DataFrame:
    """Specimens of 2 N/mm between two plates, pressed and pulled by turns."""
    way_mm = np.round(np.where(TURN > 0, pressed_mm, pulled_mm) * TURN, 5)
    return pd.DataFrame({"time": TIME_S, "way": way_mm, "force": 2 * way_mm})


def write(folder: Path, name: str, pressed: str, pulled: str, made: pd.DataFrame) -> None:
    said = np.where(made.force >= 0, pressed, pulled)
    table = pd.DataFrame({"Time (s)": made.time, "Position (mm)": made.way, "Force (N)": made.force.abs(), name: said})
    table.to_csv(folder / "a.csv", index=False)


@pytest.mark.parametrize(
    ("name", "pressed", "pulled"),
    [
        ("Direction", "Compression", "Tension"), ("Mode", "press", "pull"), ("Load type", "C", "T"),
        ("Richtung", "Druck", "Zug"), ("", "1-Compress", "2-Pull"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("made", [cycles(5.0, 2.0), cycles(2.0, 5.0)], ids=["mostly pressed", "mostly pulled"])
def test_words_say_which_force_presses(folder: Path, name: str, pressed: str, pulled: str, made: pd.DataFrame) -> None:
    write(folder, name, pressed, pulled, made)
    tables = came_in(folder).recording("a").tables
    assert tables["force"]["fz_N"] == pytest.approx(made.force, abs=1e-4)
    assert tables["axis"]["position_mm"] == pytest.approx(made.way, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "pressed", "pulled"),
    [
        ("Sign", "0", "1"), ("sign bit", "0", "1"), ("Vorzeichen", "+", "-"), ("polarity", "1", "-1"),
        ("F sign", "+", "\u2212"), ("negative", "False", "True"),
    ],
)  # fmt: skip
def test_a_sign_is_one_whose_largest_force_presses(folder: Path, name: str, pressed: str, pulled: str) -> None:
    made = cycles(5.0, 2.0)
    write(folder, name, pressed, pulled, made)
    tables = came_in(folder).recording("a").tables
    assert tables["force"]["fz_N"] == pytest.approx(made.force, abs=1e-4)
    assert tables["axis"]["position_mm"] == pytest.approx(made.way, abs=1e-4)


def test_a_sign_bit_in_a_workbook(folder: Path) -> None:
    book, made = openpyxl.Workbook(), cycles(5.0, 2.0)
    book["Sheet"].append(["Time (s)", "Position (mm)", "Force (N)", "Sign bit"])
    for time_s, way_mm, force_N in made.to_numpy().tolist():
        book["Sheet"].append([time_s, way_mm, abs(force_N), int(force_N < 0)])
    book.save(folder / "a.xlsx")
    assert came_in(folder).recording("a-Sheet").tables["force"]["fz_N"] == pytest.approx(made.force, abs=1e-4)


def test_two_values_that_only_their_maker_knows_are_a_doubt_with_the_keys_that_say_it(folder: Path) -> None:
    made = cycles(5.0, 2.0)
    write(folder, "direction", "1", "0", made)
    proposal = propose(folder)
    (said,) = (doubt for doubt in proposal.doubts if "has no sign" in doubt)
    assert "is read alike throughout; if 'direction' says it, add to columns.force: sign = " in said
    keys = said.partition("columns.force: ")[2].replace("0 = 1, 1 = -1", "0 = -1, 1 = 1")
    force = 'columns.force = { column = "Force (N)"'
    text = proposal.text.replace(force, f"{force}, {keys}")
    session = import_folder(folder, parse(DataMapping, tomllib.loads(text), "mine"), folder.parent / "mine", NOW)
    assert session.recording("a").tables["force"]["fz_N"] == pytest.approx(made.force, abs=1e-4)
    assert came_in(folder).recording("a").tables["force"]["fz_N"] == pytest.approx(made.force.abs(), abs=1e-4)


@pytest.mark.parametrize(
    ("name", "words", "doubted"), [("Phase", ("push", "pull"), True), ("Direction", ("up", "down"), False)]
)
def test_words_for_the_way_there_and_back_are_no_signs(
    folder: Path, name: str, words: tuple[str, str], doubted: bool
) -> None:
    way_mm = np.round(5 * np.abs(TURN), 5)
    said = np.where(np.gradient(np.abs(TURN)) >= 0, *words)
    rows = zip(TIME_S, way_mm, 2 * way_mm, said, strict=True)
    (folder / "a.csv").write_text(f"{HEAD}{name}\n" + "".join(f"{t:.2f},{w},{f},{s}\n" for t, w, f, s in rows))
    assert any("has no sign" in doubt for doubt in propose(folder).doubts) == doubted
    assert came_in(folder).recording("a").tables["force"]["fz_N"] == pytest.approx(2 * way_mm, abs=1e-4)


def test_another_word_further_down_is_refused_with_its_place(folder: Path) -> None:
    write(folder, "Direction", "Compression", "Tension", cycles(5.0, 2.0))
    mapping = parse(DataMapping, propose(folder).tree, "proposed")
    with (folder / "a.csv").open("a") as file:
        file.write("4.0,0.1,0.2,Overload\n")
    with pytest.raises(DataError, match=r"a\.csv line 202: 'Overload' is none of the signs 'Compression', 'Tension'; "):
        import_folder(folder, mapping, folder.parent / "out", NOW)


def test_a_column_is_not_a_sign_and_a_number_at_once(folder: Path) -> None:
    write(folder, "Sign", "0", "1", cycles(5.0, 2.0))
    text = propose(folder).text.replace('sign = "Sign"', 'sign = "Position (mm)"')
    with pytest.raises(DataError, match="'Position \\(mm\\)' is named twice in the mapping"):
        import_folder(folder, parse(DataMapping, tomllib.loads(text), "mine"), folder.parent / "out", NOW)
