"""Layouts that need more than columns under names: blocks, footers, names and units in cells, names of rows.

As in test_foreign they hold one press, are laid out as the maker's program does it, and come in without a mapping.
"""

import tomllib
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pandas as pd
import pytest
import scipy.io

from rig.config.table import parse
from rig.errors import DataError, UsageError
from rig.intake.mapping import DataMapping
from rig.intake.proposal import propose
from rig.intake.session import import_folder
from rig.recording.sessions import Session
from tests.rig.intake.test_foreign import COUNT, FORCE_N, ROWS, TIME_S, WAY_MM, came_in, check, lines
from tests.rig.recording.measured import NOW


def names(session: Session) -> list[str]:
    return [trial.name for trial in session.trials]


def with_two(text: Sequence[str]) -> str:
    """Two presses, told apart by their forces, each below the same words, with a tab before rows as before names."""
    tab = "\t" if "\n\t" in text[0] and text[0].startswith("Interval") else ""
    bodies = [lines(tab + "{:.3f}\t{:.5f}\t{:.6f}", TIME_S, WAY_MM, FORCE_N + 1e-5 * number) for number in (0, 1)]
    return "".join(part for body in bodies for part in (text[0], body, text[1]))


def test_bose_wintest_has_names_of_two_words_above_units_that_begin_empty(folder: Path) -> None:
    head = (
        f"WinTest Data File\nDate: 3/4/2021  Time: 10:11:12\nPoints: {COUNT}\nScan Time: 1.180 sec\n\n"
        "Points\tElapsed Time\tDisp\tLoad\n\tSec\tmm\tN\n"
    )
    rows = lines("{:.0f}\t{:.5f}\t{:.5f}\t{:.5f}", np.arange(1, COUNT + 1), TIME_S, WAY_MM, FORCE_N)
    (folder / "skin_01.txt").write_text(head + rows)
    check(came_in(folder))


@pytest.mark.parametrize("footer", ["<END DATA>\n", "\nEnd of test\nMaximum force\t2.5\tN\n", "Mean\t1.2\t\n"])
def test_text_below_the_table_is_left_out_and_said(folder: Path, footer: str) -> None:
    rows = lines("{:.3f}\t{:.5f}\t{:.6f}", TIME_S, WAY_MM, FORCE_N)
    (folder / "a.txt").write_text("Time, s\tPosition (z), mm\tFz, N\n" + rows + footer)
    (said,) = [doubt for doubt in propose(folder).doubts if "is no row of the table" in doubt]
    assert "a.txt line 62" in said or "a.txt line 63" in said
    check(came_in(folder))


def test_text_below_some_of_the_tables_needs_one_mapping(folder: Path) -> None:
    rows = lines("{:.3f},{:.5f},{:.6f}", TIME_S, WAY_MM, FORCE_N)
    for number, footer in enumerate(("", "stopped by the operator\n", "")):
        (folder / f"s{number}.csv").write_text(
            f"Time (s),Position (mm),Force (N)\n{rows}{TIME_S[-1] + 1 + number},2,0\n{footer}"
        )
    assert len(propose(folder).tree["tables"]) == 1
    assert len(came_in(folder).trials) == 3


def test_a_damaged_row_is_no_text_below(folder: Path) -> None:
    rows = lines("{:.3f},{:.5f},{:.6f}", TIME_S, WAY_MM, FORCE_N)
    (folder / "a.csv").write_text("Time (s),Position (mm),Force (N)\n" + rows + "1.2,3.4\n")
    with pytest.raises(DataError, match=r"a\.csv line 62: 2 cells where the header has 3"):
        came_in(folder)


def test_text_below_a_table_is_refused_with_the_key_that_leaves_it_out(folder: Path) -> None:
    (folder / "a.csv").write_text("t,F\n0,1\n1,2\nEnd of test\n")
    columns = {"force": {"column": "F", "unit": "N"}}
    table = {"files": "*.csv", "time": {"column": "t", "unit": "s"}, "columns": columns}
    with pytest.raises(DataError, match=r"line 4: 'End of test' is no row of the table; .* other_lines = 'drop'"):
        import_folder(folder, parse(DataMapping, {"tables": [table]}, "made"), folder.parent / "out", NOW)


MACH_1 = ("<Sinusoid>\nAmplitude:\t0.5 mm\n<DATA>\nTime, s\tPosition (z), mm\tFz, N\n", "<END DATA>\n")
BLUEHILL = ("Specimen\nTime\tExtension\tLoad\n(s)\t(mm)\t(N)\n", "\n")
LABVIEW = (
    f"\t\nChannels\t2\t\nSamples\t{COUNT}\t{COUNT}\nX0\t0.0E+0\t0.0E+0\nDelta_X\t0.02\t0.02\n***End_of_Header***\t\t\n"
    "X_Value\tPosition (mm)\tForce (N)\n",
    "",
)


RHEOMETER = (f"Interval and data points:\t1\t{COUNT}\n\tTime\tGap\tNormal force\n\t[s]\t[mm]\t[N]\n", "")


@pytest.mark.parametrize("words", [MACH_1, BLUEHILL, LABVIEW, RHEOMETER])
def test_a_table_begins_wherever_its_names_come_again(folder: Path, words: Sequence[str]) -> None:
    (folder / "a.txt").write_text("<INFO>\nDate:\t3/4/2021\n<END INFO>\n" + with_two(words))
    session = came_in(folder)
    assert names(session) == ["a-1", "a-2"]
    check(session)
    forces = [session.recording(name).tables["force"]["fz_N"][0] for name in ("a-1", "a-2")]
    assert forces[1] - forces[0] == pytest.approx(1e-5, abs=1e-7)


def test_one_table_with_its_names_on_every_page_is_one_recording_unless_the_mapping_says_otherwise(
    folder: Path,
) -> None:
    head, rows = (
        "Time (s),Position (mm),Force (N)\n",
        lines("{:.3f},{:.5f},{:.6f}", TIME_S, WAY_MM, FORCE_N).splitlines(),
    )
    (folder / "a.csv").write_text("".join(head + "\n".join(rows[at : at + 20]) + "\n" for at in range(0, COUNT, 20)))
    proposal = propose(folder)
    assert any("its row of names comes 3 times while time goes on" in doubt for doubt in proposal.doubts)
    check(came_in(folder))
    tree = tomllib.loads(proposal.text.replace('other_lines = "drop"\n', 'other_lines = "drop"\nrepeats = true\n'))
    apart = import_folder(folder, parse(DataMapping, tree, "edited"), folder.parent / "apart", NOW)
    assert [trial.samples["force"] for trial in apart.trials] == [20, 20, 20]


@pytest.mark.parametrize(
    ("form", "head"),
    [
        ("t:{0:.0f},F:{1:.3f}N,x:{2:.5f}mm\n", "Ready\nTare done\n"),
        ("time={0:.0f}ms force={1:.6f}N pos={2:.5f}mm\n", ""),
        ("{0:.0f} ms\t{1:.5f} N\t{2:.5f} mm\n", "Time\tForce\tPosition\n"),
        ("{0:.0f} ms,{1:.5f} N,{2:.5f} mm\n", "Time,Force,Position\n"),
    ],
)
def test_names_and_units_stand_in_the_cells(folder: Path, form: str, head: str) -> None:
    rows = "".join(form.format(1e3 * time_s, force_N, way_mm) for time_s, way_mm, force_N in ROWS)
    (folder / "serial.log").write_text(head + rows)
    check(came_in(folder), abs_N=1e-3)


def test_units_that_change_within_a_column_are_refused(folder: Path) -> None:
    rows = [f"{time_s:.2f} s,{'950 mN' if at == 30 else f'{force_N:.3f} N'},{way_mm:.4f} mm"
            for at, (time_s, way_mm, force_N) in enumerate(ROWS)]  # fmt: skip
    (folder / "a.csv").write_text("Time,Force,Position\n" + "\n".join(rows) + "\n")
    with pytest.raises(DataError, match=r"a\.csv line 32, column Force: '950 mN' is not a number"):
        came_in(folder)


def test_r_writes_names_of_rows_under_no_name(folder: Path) -> None:
    rows = "".join(f'"{at}" {time:.3f} {force:.6f} {way:.5f}\n' for at, (time, way, force) in enumerate(ROWS, 1))
    (folder / "a.txt").write_text('"time_s" "force_N" "disp_mm"\n' + rows)
    check(came_in(folder))


def test_a_force_curve_names_its_columns_in_a_comment(folder: Path) -> None:
    head = "# xPosition: 1.2e-05\n# springConstant: 0.05 N/m\n#\n# columns: height force seriesTime\n# units: m N s\n"
    (folder / "a.txt").write_text(head + lines("{:.7f} {:.6f} {:.5f}", WAY_MM * 1e-3, FORCE_N, TIME_S))
    check(came_in(folder))


def test_names_with_blanks_stand_above_columns_parted_by_blanks(folder: Path) -> None:
    head = "  Elapsed Time  Axial Force   Axial Position\n"
    rows = lines("{:14.3f} {:12.6f} {:16.5f}", TIME_S, FORCE_N, WAY_MM)
    (folder / "a.txt").write_text(head + "  (s)   (N)   (mm)\n" + rows)
    check(came_in(folder))


def test_two_columns_without_names_and_time_ask_twice(folder: Path) -> None:
    np.savetxt(folder / "a.txt", np.stack([FORCE_N, WAY_MM], axis=1), "%.6f")
    check(came_in(folder, "50", "1 N; 2 mm"))


def test_answers_of_a_joint_question_are_as_many_as_it_has_parts(folder: Path) -> None:
    np.savetxt(folder / "a.txt", np.stack([FORCE_N, WAY_MM], axis=1), "%.6f")
    (_, joint) = propose(folder).questions
    assert joint.text.endswith("answer them together, with a semicolon between, as 'COLUMN UNIT; COLUMN UNIT'")
    with pytest.raises(UsageError, match="'1 N' is not 2 answers with a semicolon between, as 'COLUMN UNIT; "):
        joint.value("1 N")


def test_times_of_day_go_on_after_midnight(folder: Path) -> None:
    start = datetime(2021, 3, 4, 23, 59, 59, 500_000)
    stamps = [f"{start + timedelta(seconds=float(time_s)):%H:%M:%S.%f}" for time_s in TIME_S]
    rows = "".join(f"{stamp},{force},{way}\n" for stamp, (_, way, force) in zip(stamps, ROWS, strict=True))
    (folder / "a.csv").write_text("Time,Force (N),Position (mm)\n" + rows)
    check(came_in(folder))


def test_whole_seconds_are_neither_the_time_nor_the_name_of_a_recording(folder: Path) -> None:
    rows = "".join(f"10:11:{12 + at // 25},{at % 7},{force},{way}\n" for at, (_, way, force) in enumerate(ROWS))
    (folder / "a.csv").write_text("Time,Stage,Force (N),Position (mm)\n" + rows)
    (question,) = propose(folder).questions
    assert "no column of time finer than 25 rows with one stamp" in question.text
    assert question.line == "time = { rate_Hz = 25.0 }"
    check(came_in(folder, "50"))


@pytest.mark.parametrize(("name", "usual"), [("pose.position.z", "m"), ("tcp_z", "m"), ("z", "mm")])
def test_robots_count_positions_in_metres(folder: Path, name: str, usual: str) -> None:
    way = WAY_MM / 1e3 if usual == "m" else WAY_MM
    frame = pd.DataFrame({"time_s": TIME_S, "wrench.force.z": FORCE_N, name: way})
    frame.to_csv(folder / "a.csv", index=False)
    proposal = propose(folder)
    assert [question.usual for question in proposal.questions] == ["N", usual]
    check(came_in(folder, "N", usual))


def test_sheets_that_are_hidden_are_left_aside_and_said(folder: Path) -> None:
    book = openpyxl.Workbook()
    for title, factor in (("seen", 1.0), ("spare", 2.0)):
        sheet = book.create_sheet(title)
        sheet.append(["Time (s)", "Displacement (mm)", "Force (N)"])
        for time_s, way_mm, force_N in ROWS:
            sheet.append([float(time_s), float(way_mm), factor * float(force_N)])
    book["spare"].sheet_state = "hidden"
    book.save(folder / "a.xlsx")
    assert "left aside in a.xlsx, hidden by its maker: spare" in propose(folder).doubts
    session = came_in(folder)
    assert names(session) == ["a-seen"]
    check(session)


def test_text_below_the_table_of_a_sheet_is_left_out_and_said(folder: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book["Sheet"]
    sheet.append(["Time (s)", "Displacement (mm)", "Force (N)"])
    for row in ROWS:
        sheet.append([float(value) for value in row])
    for below in ([], ["Mean", 2.0, 1.0], ["pressed on Monday"]):
        sheet.append(below)
    book.save(folder / "a.xlsx")
    assert any("a.xlsx, Sheet row 63: 'Mean,2,1' is no row" in doubt for doubt in propose(folder).doubts)
    check(came_in(folder))


def test_a_sheet_s_tables_below_each_other_are_recordings_of_their_own(folder: Path) -> None:
    book = openpyxl.Workbook()
    for number in (1, 2):
        book["Sheet"].append([f"Sample {number}"])
        book["Sheet"].append(["Time (s)", "Displacement (mm)", "Force (N)"])
        for time_s, way_mm, force_N in ROWS:
            book["Sheet"].append([float(time_s), float(way_mm), float(force_N) + 1e-6 * number])
    book.save(folder / "a.xlsx")
    session = came_in(folder)
    assert names(session) == ["a-Sheet-1", "a-Sheet-2"]
    check(session)


@pytest.mark.parametrize("by", ["file", "sheet"])
def test_labels_that_come_again_in_another_file_or_sheet_are_other_recordings(folder: Path, by: str) -> None:
    days = [
        pd.concat(
            pd.DataFrame(
                {"sample": f"S{n}", "time_s": TIME_S, "force_N": FORCE_N + 1e-6 * (n + day), "disp_mm": WAY_MM}
            )
            for n in (1, 2)
        )
        for day in (10, 20)
    ]
    with pd.ExcelWriter(folder / "all.xlsx") as book:
        for number, day in enumerate(days):
            day.to_excel(book, sheet_name=f"day {number}", index=False)
    if by == "file":
        (folder / "all.xlsx").unlink()
        for number, day in enumerate(days):
            day.to_csv(folder / f"day {number}.csv", index=False)
    session = came_in(folder)
    assert len(session.trials) == 4
    assert all("S1" in name or "S2" in name for name in names(session))
    check(session)


def test_rows_whose_time_starts_anew_are_not_left_out_as_disorder(folder: Path) -> None:
    rows = lines("{:.3f},{:.5f},{:.6f}", TIME_S, WAY_MM, FORCE_N)
    other = lines("{:.3f},{:.5f},{:.6f}", TIME_S, WAY_MM, FORCE_N + 1e-5)
    (folder / "a.csv").write_text("Time (s),Position (mm),Force (N)\n" + rows + other)
    assert any("line 62: time begins anew, as it does 1 times" in doubt for doubt in propose(folder).doubts)
    session = came_in(folder)
    assert names(session) == ["a-1", "a-2"]
    check(session)


def test_columns_of_a_matrix_are_named_by_a_list_beside_it(folder: Path) -> None:
    cells = np.empty(2, object)
    cells[0], cells[1] = (np.stack([TIME_S, WAY_MM, FORCE_N + 1e-6 * n], axis=1) for n in (0, 1))
    titles = np.array(["time [s]", "position [mm]", "force [N]"], object)
    scipy.io.savemat(folder / "a.mat", {"data": cells, "columns": titles})
    session = came_in(folder)
    assert len(session.trials) == 2
    check(session)


def test_names_of_files_are_told_from_others_beside_them(folder: Path) -> None:
    rows = "Time(s),Z(mm),Force(N)\n" + lines("{:.3f},{:.5f},{:.6f}", TIME_S, WAY_MM, FORCE_N)
    for run in (1, 2):
        (folder / f"run_{run}").mkdir()
        for well in ("A5", "B6"):
            (folder / f"run_{run}" / f"well_{well}_2025.csv").write_text(
                f"{rows}{2 + run},2,0\n{4 + int(well[1])},2,0\n"
            )
        (folder / f"run_{run}" / "well_False_2025.csv").write_text("Well,Force\nA5,1\n")
    (table,) = propose(folder).tree["tables"]
    assert table["files"] == "run_{run:[12]}/well_{well:[AB][56]}_2025.csv"
    session = came_in(folder)
    assert [session.recording(name).metadata["labels"]["site"] for name in names(session)] == ["A5", "B6"] * 2


@pytest.mark.parametrize(
    "header",
    [
        "Time [s],Force [N],Time [s],Position [mm]",
        "Time Force (s),Force (N),Time Position (s),Position (mm)",
        "time_load_s,load_N,time_displacement_s,displacement_mm",
    ],
)
def test_force_and_position_have_times_of_their_own_side_by_side(folder: Path, header: str) -> None:
    rows = "".join(
        f"{time_s:.3f},{force_N}," + (f"{2 * time_s + 7:.3f},{way_mm}\n" if at < 40 else ",\n")
        for at, (time_s, way_mm, force_N) in enumerate(ROWS)
    )
    (folder / "a.csv").write_text(f"{header}\n{rows}")
    tables = came_in(folder).recording("a").tables
    assert np.diff(tables["axis"]["capture_ns"]) == pytest.approx(np.full(39, 4e7), abs=2e3)
    assert tables["axis"]["position_mm"] == pytest.approx(WAY_MM[:40], abs=1e-4)
    assert tables["force"]["fz_N"] == pytest.approx(FORCE_N, abs=1e-4)


def test_names_that_pandas_told_apart_are_recordings_side_by_side(folder: Path) -> None:
    frames = [pd.DataFrame({"Time (s)": TIME_S, "Load (N)": FORCE_N + n * 1e-6, "Ext (mm)": WAY_MM}) for n in range(3)]
    frame = pd.concat(frames, axis=1)
    frame.columns = pd.Index([f"{name}.{at // 3}" if at > 2 else name for at, name in enumerate(frame.columns)])
    frame.to_csv(folder / "a.csv", index=False)
    session = came_in(folder)
    assert len(session.trials) == 3
    check(session)


@pytest.mark.parametrize("mark", ["# ", "% ", "// ", "; "])
def test_lines_above_are_comments(folder: Path, mark: str) -> None:
    head = f"{mark}rig 3\n{mark}operator AB\n{mark}time_s force_N pos_mm\n"
    (folder / "a.dat").write_text(head + lines("{:.3f} {:.6f} {:.5f}", TIME_S, FORCE_N, WAY_MM))
    check(came_in(folder))


@pytest.mark.parametrize(
    ("unit", "one_N"),
    [("Kg", 9.80665), ("KGF", 9.80665), ("KN", 1e3), ("nN", 1e-9), ("cN", 0.01), ("daN", 10.0), ("dyn", 1e-5)],
)
def test_units_of_force_in_capitals_and_small_ones(folder: Path, unit: str, one_N: float) -> None:
    rows = lines("{:.3f},{:.9g},{:.6f}", TIME_S, FORCE_N / one_N, WAY_MM / 10)
    (folder / "a.csv").write_text(f"Time (Sec),Load ({unit}),Stroke (CM)\n{rows}")
    check(came_in(folder))


@pytest.mark.parametrize("head", ["Time (s),Load (poundal),Stroke (mm)\n", "Time,Load,Stroke\n[s],[poundal],[mm]\n"])
def test_a_unit_nobody_knows_is_not_taken_for_newtons(folder: Path, head: str) -> None:
    (folder / "a.csv").write_text(head + lines("{},{},{}", TIME_S, FORCE_N, WAY_MM))
    (question,) = propose(folder).questions
    assert question.usual == ""
    assert "is in poundal, which is none of N, kN" in question.text


def test_an_arm_logs_plurals_and_arrays(folder: Path) -> None:
    still = np.zeros_like(TIME_S)
    with h5py.File(folder / "a.h5", "w") as file:
        file["timestamps"] = 1_614_852_672 + TIME_S
        file["ft_forces"] = np.stack([0.01 * TIME_S, still, FORCE_N], axis=1)
        file["ee_positions"] = np.stack([still, still, WAY_MM / 1e3], axis=1)
    check(came_in(folder, "N", "m"))
