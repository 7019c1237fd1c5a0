"""What `rig import` understands of files nobody described, what it doubts, and what it asks."""

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from rig.config.table import load, parse
from rig.errors import DataError, UsageError
from rig.intake.encodings import encoding_of
from rig.intake.mapping import DataMapping
from rig.intake.naming import names_of
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
        'columns.force = { column = "Force", positive = "compression", unit = "N" }',
        'columns.position = { column = "Position", positive = "into", unit = "mm" }',
    ]  # fmt: skip
    assert "# open: a.csv: force ('Force', 0 to 14) has no unit; it is one of N, kN" in proposal.text
    tables = session_of(proposal.answered(["kN", "cm"]), tmp_path / "in", tmp_path / "out").recording("a").tables
    assert tables["force"]["fz_N"].max() == pytest.approx(14000)
    assert tables["axis"]["position_mm"].max() == pytest.approx(35)


def test_rows_without_time_ask_for_their_rate(tmp_path: Path) -> None:
    proposal = propose(write(tmp_path / "in", {"a.csv": table_of("force_N,x_mm", [row[1:] for row in ROWS])}))
    tables = session_of(proposal.answered(["200"]), tmp_path / "in", tmp_path / "out").recording("a").tables
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


def gels(second: str, share: float) -> str:
    """Two forces under one motion, the second of them another one by its square."""
    rows = [(t, force, share * force * force, way) for t, force, way in ROWS]
    return table_of(f"t_s,Force gel A (N),{second},depth_mm", rows)


def test_two_forces_under_one_motion_are_asked_with_the_line_that_names_one(tmp_path: Path) -> None:
    proposal = propose(write(tmp_path / "in", {"a.csv": gels("Force gel B (N)", 0.05)}))
    (question,) = proposal.questions
    assert "2 forces under one motion: Force gel A (N) (N, 0 to 14, moves); Force gel B (N)" in question.text
    assert question.usual == "Force gel A (N)"
    assert question.line == 'columns.force = { column = "Force gel A (N)", unit = "N", positive = "compression" }'
    answered = [propose(tmp_path / "in").answered([f"Force gel {name} (N)"]) for name in "BA"]
    sessions = [session_of(own, tmp_path / "in", tmp_path / str(at)) for at, own in enumerate(answered)]
    largest_N = [float(session.recording("a").tables["force"]["fz_N"].max()) for session in sessions]
    assert largest_N == pytest.approx([9.8, 14.0])


@pytest.mark.parametrize(
    ("second", "share"), [("Force gel B (N)", 0.005), ("Force peak (N)", 0.05), ("Force gel B (V)", 0.05)]
)
def test_a_force_that_hardly_moves_or_is_less_likely_one_is_not_asked_for(
    tmp_path: Path, second: str, share: float
) -> None:
    assert not propose(write(tmp_path / "in", {"a.csv": gels(second, share)})).questions


@pytest.mark.parametrize("names", ["Force (N),Force (mN)", "force.x (N),force.y (N)"])
def test_a_force_in_another_unit_and_directions_of_one_are_not_asked_for(tmp_path: Path, names: str) -> None:
    rows = [(t, force, force * (1e3 if "mN" in names else 0.5), way) for t, force, way in ROWS]
    assert not propose(write(tmp_path / "in", {"a.csv": table_of(f"t_s,{names},depth_mm", rows)})).questions


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
    proposal = propose(tmp_path / "in")
    assert any(
        "left aside in all.xlsx" in doubt and "Sheet, S0, S1, S2, S4 and 4 more" in doubt for doubt in proposal.doubts
    )
    session = session_of(proposal, tmp_path / "in", tmp_path / "out")
    assert [trial.name for trial in session.trials] == ["all-S3", "all-S7"]
    assert session.recording("all-S7").tables["axis"]["position_mm"][0] == 7.0


def test_a_folder_with_no_force_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no table with force and position was found"):
        propose(write(tmp_path / "in", {"a.csv": "a,b\n1,2\n3,4\n", "b.txt": "hello\n"}))


def test_a_column_nobody_named_is_asked_for_with_what_it_may_be(tmp_path: Path) -> None:
    rows = [(t, 0.5, way, force) for t, force, way in ROWS * 1] + [(0.8, 0.5, 4.0, 99.0), (0.9, 0.5, 4.5, 120.0)]
    proposal = propose(write(tmp_path / "in", {"a.csv": table_of("time_s,fixed,depth_mm,signal (V)", rows)}))
    (question,) = proposal.questions
    assert "it may be signal (V) (V, 0 to 120, moves); say it" in question.text
    assert (question.usual, question.line) == (
        "", 'columns.force = { column = "signal (V)", positive = "compression", scale = "?" }'
    )  # fmt: skip
    tables = session_of(proposal.answered(["signal (V) 0.5"]), tmp_path / "in", tmp_path / "out").recording("a").tables
    assert tables["force"]["fz_N"].max() == 60.0


@pytest.mark.parametrize(("said", "why"), [("other N", "none of the columns"), ("b", "is no answer"), ("b x", "'x'")])
def test_an_answer_that_is_none_is_one_sentence(tmp_path: Path, said: str, why: str) -> None:
    rows = [(0.1 * k, 2.0 * k, 0.5 * k, -1.5 * k) for k in range(20)]
    proposal = propose(write(tmp_path / "in", {"a.csv": table_of("time_s,b,depth_mm,c", rows)}))
    with pytest.raises(UsageError, match=why):
        proposal.answered([said])


def test_a_folder_of_mixed_kinds_says_what_was_left_aside(tmp_path: Path) -> None:
    files = {"a.csv": table_of("time_s,force_N,x_mm"), "notes.txt": "pressed on Monday\n", "photo.png": ""}
    proposal = propose(write(tmp_path / "in", {**files, "deep/list.csv": "name,age\nA,1\nB,2\n"}))
    assert "left aside, no table with force and position: deep/list.csv, notes.txt" in proposal.doubts
    assert "left aside, no reader for them: photo.png" in proposal.doubts
    assert proposal.tree["tables"][0]["files"] == ["a.csv"]


def test_what_varies_in_the_names_of_files_is_named(tmp_path: Path) -> None:
    names = [f"S{subject}/sample{sample}_rep_{rep}.csv" for subject in (1, 2) for sample in (3, 4) for rep in (1, 2)]
    files = {name: table_of("time_s,force_N,x_mm", [(t, f + n, w) for t, f, w in ROWS]) for n, name in enumerate(names)}
    proposal = propose(write(tmp_path / "in", files))
    assert proposal.tree["tables"][0]["files"] == "S{part_1}/sample{sample}_rep_{rep}.csv"
    session = session_of(proposal, tmp_path / "in", tmp_path / "out")
    assert len(session.trials) == 8
    labels = session.recording("S2-sample3_rep_1").metadata["labels"]
    assert (labels["specimen"], labels["cycle"], labels["part_1"]) == ("3", "1", "2")


def test_two_specimens_under_one_name_are_a_doubt(tmp_path: Path) -> None:
    rows = [("A", *row) for row in ROWS] + [("A", *row) for row in ROWS]
    text = "specimen,time_s,force_N,x_mm\n" + "".join(f"{a},{b:.1f},{c},{d}\n" for a, b, c, d in rows)
    doubts = propose(write(tmp_path / "in", {"a.csv": text})).doubts
    assert any("a.csv line 10: A begins here again: two under one name" in doubt for doubt in doubts)


def test_the_saved_mapping_makes_the_identical_session(tmp_path: Path) -> None:
    files = {f"press {n}.csv": table_of("Zeit [s];Kraft [N];Weg [mm]", mark=";") for n in (1, 2)}
    files["press 2.csv"] = files["press 2.csv"].replace("14.000", "15.000")
    proposal = propose(write(tmp_path / "in", files))
    (tmp_path / "saved.toml").write_text(proposal.text)
    direct = parse(DataMapping, proposal.tree, "proposed")
    assert load(DataMapping, tmp_path / "saved.toml") == direct
    first, again = (import_folder(tmp_path / "in", direct, tmp_path / out, NOW) for out in ("first", "again"))
    assert [trial.sha256 for trial in first.trials] == [trial.sha256 for trial in again.trials]


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


@pytest.mark.parametrize(
    ("name", "answers", "trials"),
    [
        ("emps", ("vir 35.15065188", "qm m"), 2),
        ("franka_joint", ("N m", "rad"), 1),
        ("rack_pinion", ("1", "r/min"), 2),
        ("servo_sts3215", ("1", "1.5339807878856412"), 18),
    ],
)
def test_a_real_folder_comes_in_after_two_questions(
    name: str, answers: tuple[str, str], trials: int, tmp_path: Path
) -> None:
    proposal = propose(recording(name))
    assert len(proposal.questions) == 2
    session = session_of(proposal.answered(answers), recording(name), tmp_path / "found")
    assert len(session.trials) == trials
    known = imported(name, tmp_path)
    for trial in known.trials[:1] if name in ("emps", "franka_joint") else ():
        ours, theirs = (each.recording(trial.name).tables for each in (session, known))
        assert np.abs(ours["force"]["fz_N"]) == pytest.approx(np.abs(theirs["force"]["fz_N"]))
        assert ours["axis"]["position_mm"] == pytest.approx(theirs["axis"]["position_mm"])


def test_a_folder_of_several_sites_is_a_specimen() -> None:
    stems = [f"run_00{run}/well_{well}_2025" for run in (1, 2) for well in ("A5", "A6", "B5", "False")]
    found = names_of(stems)
    assert found and found.templates == {"specimen": "run_{run}", "site": "{well}"}
    alone = names_of([stem.replace("_2025", "") for stem in stems if "/" in stem and "001" in stem])
    assert alone and alone.templates == {"site": "{well}"}
