"""Exports of instruments come in without a mapping, with what they hold; what they do not say is asked or refused."""

from pathlib import Path

import pytest

from rig.errors import DataError
from rig.intake.proposal import propose
from tests.rig.intake.instruments import FORMS, PRESS, text
from tests.rig.intake.instruments_logged import LOGGED
from tests.rig.intake.test_foreign import FORCE_N, TIME_S, WAY_MM, came_in, check, lines

ALL = FORMS | LOGGED


@pytest.mark.parametrize("form", ALL)
def test_what_an_instrument_wrote_comes_in(folder: Path, form: str) -> None:
    write, recordings, answers = ALL[form]
    write(folder)
    session = came_in(folder, *answers)
    assert len(session.trials) == recordings
    check(session)


@pytest.mark.parametrize("form", [form for form, (_, recordings, _) in ALL.items() if recordings == 2])
def test_no_specimen_is_taken_for_another(folder: Path, form: str) -> None:
    ALL[form][0](folder)
    session = came_in(folder)
    peaks_N = sorted(trial.peak_force_N for trial in session.trials)
    assert peaks_N == pytest.approx([FORCE_N.max(), FORCE_N.max() + 1e-5], abs=2e-6)


@pytest.mark.parametrize(
    ("head", "asked"),
    [
        ("Time (s),Strain (%),Load (N)\n", "no name tells which column is the position"),
        ("Zeit,CH1,Kraft [N]\n", "no name tells which column is the position"),
        ("Time (s),Position,Force (N)\n", "has no unit"),
        ("Time (s),Position (mm),Force (count)\n", "needs a scale"),
    ],
)
def test_what_no_file_says_is_asked(folder: Path, head: str, asked: str) -> None:
    text(head)(folder)
    assert any(asked in question.text for question in propose(folder).questions)


def test_a_damaged_line_of_json_is_named(folder: Path) -> None:
    FORMS["lines of JSON"][0](folder)
    (folder / "a.jsonl").write_text((folder / "a.jsonl").read_text().replace('"t_s": 0.06,', '"t_s": 0.06;'))
    with pytest.raises(DataError, match=r"a\.jsonl line 4: no JSON object"):
        propose(folder)


def test_times_that_jump_back_by_no_counter_are_refused(folder: Path) -> None:
    back = TIME_S.copy()
    back[20:] -= 0.3
    text("Time (s),Position (mm),Force (N)\n", lines("{:.3f},{:.5f},{:.5f}", back, WAY_MM, FORCE_N))(folder)
    assert "wraps_at" not in propose(folder).text
    with pytest.raises(DataError, match="time must increase from row to row"):
        came_in(folder)


def test_vectors_are_no_specimens_beside_each_other(folder: Path) -> None:
    head = "time_s,force_x_N,force_y_N,force_z_N,pos_x_mm,pos_y_mm,pos_z_mm\n"
    rows = lines("{:.3f},0.1,0.2,{:.5f},1.0,2.0,{:.5f}", TIME_S, FORCE_N, WAY_MM)
    text(head, rows)(folder)
    check(came_in(folder))


def test_a_row_above_that_contradicts_the_names_is_no_row_of_units(folder: Path) -> None:
    text("N,N,mm\nTime (s),Position (mm),Force (N)\n", PRESS)(folder)
    assert propose(folder).tree["tables"][0]["unit_row"] == 0
    check(came_in(folder))


def test_another_table_below_is_not_read_as_more_of_it(folder: Path) -> None:
    below = lines("{:.3f},{:.5f},{:.5f}", TIME_S + 5, 30 + TIME_S, WAY_MM)
    text("Time (s),Position (mm),Force (N)\n", f"{PRESS}\nClimate\nTime (s),Temperature (C),Humidity (%)\n{below}")(
        folder
    )
    assert any("begins another table, which is not read" in doubt for doubt in propose(folder).doubts)
    check(came_in(folder))


def test_the_same_names_in_another_order_are_another_table(folder: Path) -> None:
    turned = lines("{:.3f},{:.5f},{:.5f}", TIME_S + 5, FORCE_N, WAY_MM)
    text("Time (s),Position (mm),Force (N)\n", f"{PRESS}Time (s),Force (N),Position (mm)\n{turned}")(folder)
    check(came_in(folder))
