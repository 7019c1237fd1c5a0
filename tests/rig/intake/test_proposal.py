"""What `rig import` understands of files nobody described, what it doubts, and what it asks."""

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from rig.config.table import parse
from rig.errors import DataError
from rig.intake.layout import encoding_of
from rig.intake.mapping import DataMapping
from rig.intake.proposal import Proposal, propose
from rig.intake.session import import_folder
from rig.recording.sessions import Session
from tests.data import recording
from tests.rig.intake.test_real_folders import imported
from tests.rig.recording.measured import NOW, write

ROWS = [(0.1 * k, 2.0 * k, 0.5 * k) for k in range(8)]


def forces(session: Session) -> list[tuple[int, float]]:
    """How many rows each recording has, and the force that is largest whatever its sign."""
    found = (session.recording(trial.name).tables["force"]["fz_N"] for trial in session.trials[:30])
    return [(force.size, float(force[np.argmax(np.abs(force))])) for force in found]


def session_of(proposal: Proposal, folder: Path, out: Path) -> Session:
    return import_folder(folder, parse(DataMapping, tomllib.loads(proposal.text), "proposed"), out, NOW)


def table_of(header: str, rows: Sequence[Sequence[float]] = ROWS, mark: str = ",") -> str:
    return "\n".join([header, *(mark.join(f"{value:.3f}" for value in row) for row in rows)]) + "\n"


def test_settings_above_units_below_semicolons_and_decimal_commas(tmp_path: Path) -> None:
    text = "Machine;Z 100\nDate;2026\n\n" + table_of("Zeit;Kraft;Weg\ns;mN;um", mark=";").replace(".", ",")
    proposal = propose(write(tmp_path / "in", {"a.csv": text}))
    (table,) = proposal.tree["tables"]
    assert {key: table[key] for key in ("delimiter", "decimal", "header_row", "unit_row")} == {
        "delimiter": ";", "decimal": ",", "header_row": 4, "unit_row": 5
    }  # fmt: skip
    assert proposal.questions == ()
    tables = session_of(proposal, tmp_path / "in", tmp_path / "out").recording("a").tables
    assert tables["force"]["fz_N"] == pytest.approx([0.002 * k for k in range(8)])
    assert tables["axis"]["position_mm"] == pytest.approx([0.0005 * k for k in range(8)])


def test_a_force_and_a_way_that_go_down_are_turned_round_and_that_is_said(tmp_path: Path) -> None:
    rows = [(t, -force, -way) for t, force, way in ROWS]
    proposal = propose(write(tmp_path / "in", {"a.csv": table_of("time_s,force_N,position_mm", rows)}))
    assert [item["positive"] for item in proposal.tree["tables"][0]["columns"].values()] == ["tension", "out"]
    assert any(
        "positive force as tension, positive position as out, as if pressed" in doubt for doubt in proposal.doubts
    )


def test_a_unit_nobody_states_is_a_question_with_its_line(tmp_path: Path) -> None:
    proposal = propose(write(tmp_path / "in", {"a.csv": table_of("time_s,Force,Position")}))
    assert [question.line for question in proposal.questions] == [
        'tables.columns.force.unit = "N"', 'tables.columns.position.unit = "mm"'
    ]  # fmt: skip
    assert "# open: nothing says the unit of force ('Force'); one of N, kN" in proposal.text
    for question, unit in zip(proposal.questions, ("kN", "cm"), strict=True):
        question.answer(proposal.tree, unit)
    tables = session_of(proposal, tmp_path / "in", tmp_path / "out").recording("a").tables
    assert tables["force"]["fz_N"].max() == pytest.approx(14000)
    assert tables["axis"]["position_mm"].max() == pytest.approx(35)


def test_rows_without_time_ask_for_their_rate(tmp_path: Path) -> None:
    proposal = propose(write(tmp_path / "in", {"a.csv": table_of("force_N,x_mm", [row[1:] for row in ROWS])}))
    (question,) = proposal.questions
    question.answer(proposal.tree, "200")
    tables = session_of(proposal, tmp_path / "in", tmp_path / "out").recording("a").tables
    assert np.diff(tables["force"]["capture_ns"]).tolist() == [5_000_000] * 7


def test_a_chinese_header_is_told_from_what_else_its_bytes_may_be() -> None:
    assert encoding_of("时间,位移,力\n(s),(mm),(N)\n".encode("gbk")) == ("gb18030", ())
    assert encoding_of("时间,位移,力\n".encode())[0] == "utf-8"


def test_a_header_whose_words_nobody_knows_is_a_doubt_with_each_reading() -> None:
    encoding, (doubt,) = encoding_of("Größe,Höhe\n1,2\n".encode("cp1252"))
    assert encoding in doubt
    assert "cp1252: 'Größe,Höhe'" in doubt


def test_two_columns_of_one_kind_are_a_doubt(tmp_path: Path) -> None:
    text = table_of("t_s,force_N,gap_mm,extension_mm", [(*row, row[2]) for row in ROWS])
    proposal = propose(write(tmp_path / "in", {"a.csv": text}))
    assert "a.csv: position is taken to be 'extension_mm'; it may be 'gap_mm'" in proposal.doubts


def test_of_a_workbook_with_ten_sheets_the_two_with_data_are_taken(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    for number in range(10):
        sheet = book.create_sheet(f"S{number}")
        sheet.append(["Test", f"no. {number}"])
        if number in (3, 7):
            for row in [("Time", "Force", "Stroke"), ("s", "N", "mm"), *[(*row[:2], row[2] + number) for row in ROWS]]:
                sheet.append(row)
    (tmp_path / "in").mkdir()
    book.save(tmp_path / "in" / "all.xlsx")
    session = session_of(propose(tmp_path / "in"), tmp_path / "in", tmp_path / "out")
    assert [trial.name for trial in session.trials] == ["all-S3", "all-S7"]
    assert session.recording("all-S7").tables["axis"]["position_mm"][0] == 7.0


def test_a_folder_with_no_force_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no table with force and position was found"):
        propose(write(tmp_path / "in", {"a.csv": "a,b\n1,2\n3,4\n", "b.txt": "hello\n"}))


@pytest.mark.parametrize("name", ["asmi", "soft_food", "vhb4910", "zwick_original", "perineal_indentation"])
def test_a_real_folder_comes_in_without_a_question(name: str, tmp_path: Path) -> None:
    folder = recording(name)
    proposal = propose(folder)
    assert proposal.questions == ()
    found, known = session_of(proposal, folder, tmp_path / "found"), imported(name, tmp_path)
    assert len(found.trials) == len(known.trials)
    # Strips that are pulled look as if they were pressed the other way.
    turned = -1 if name == "vhb4910" else 1
    ours, theirs = forces(found), forces(known)
    assert sorted(ours) == sorted((size, turned * peak_N) for size, peak_N in theirs)
