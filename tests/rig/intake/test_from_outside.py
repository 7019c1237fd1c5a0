"""Bad input that somebody from outside gave: it ended in a traceback, an abort, wrong numbers or a wrong next step."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
import python_calamine as calamine
import scipy.io

from rig.config.table import parse
from rig.errors import DataError
from rig.intake.mapping import DataMapping
from rig.intake.proposal import propose
from rig.intake.session import import_folder
from tests.data import recording
from tests.rig.intake.instruments import PRESS, text
from tests.rig.intake.test_bad_files import compound_file, matlab_object
from tests.rig.intake.test_foreign import COUNT, FORCE_N, TIME_S, WAY_MM, came_in, check, lines
from tests.rig.recording.measured import NOW

HEAD = "Time (s),Position (mm),Force (N)\n"
ENDS = r"a\.xls: not readable as a workbook \(what is damaged in it ends the program that reads it\); open it"


def imported(folder: Path, **table: object) -> None:
    columns = {"force": {"column": "Force (N)"}, "position": {"column": "Position (mm)"}}
    form = {"files": "*", "time": {"column": "Time (s)"}, "columns": columns, **table}
    import_folder(folder, parse(DataMapping, {"tables": [form]}, "made"), folder.parent / "out", NOW)


@pytest.mark.parametrize("spoilt", ["zeros in a table of texts", "its last bytes"])
def test_a_damaged_xls_that_ends_its_reader_is_one_sentence_and_nothing_is_half_written(
    folder: Path, spoilt: str
) -> None:
    """calamine 0.6 aborts the whole process on the first, for want of 2 PB of memory, and panics on the second."""
    good = recording("soft_food/compression-inplane-1.xls").read_bytes()
    assert len(good) == 113_152
    bad = good[:-410] if spoilt == "its last bytes" else good[:84_378] + bytes(32) + good[84_410:]
    (folder / "a.xls").write_bytes(bad)
    with pytest.raises(DataError, match=ENDS):
        imported(folder)
    with pytest.raises(DataError, match=f"no table with force and position was found in it .*{ENDS}"):
        propose(folder)
    assert [path.name for path in folder.parent.iterdir()] == ["in"]


def test_a_workbook_whose_reader_lives_is_read_by_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "a.xls").write_bytes(compound_file({"Workbook": bytes(4096)}))
    with pytest.raises(DataError, match="none of its sheets"):
        imported(folder)
    monkeypatch.setattr(calamine, "CalamineWorkbook", type("W", (), {"from_path": lambda *_: os.abort()}))
    (folder / "a.xls").write_bytes(compound_file({"Workbook": bytes(range(256)) * 16}))
    with pytest.raises(DataError, match=ENDS):
        imported(folder)


def objects_beside(folder: Path) -> None:
    scipy.io.savemat(folder / "a.mat", {"time_s": TIME_S, "position_mm": WAY_MM})
    with (folder / "a.mat").open("ab") as file:
        file.write(matlab_object("F", "timeseries"))


def objects_alone(folder: Path) -> None:
    scipy.io.savemat(folder / "a.mat", {})
    with (folder / "a.mat").open("ab") as file:
        file.write(matlab_object("F", "timeseries"))


@pytest.mark.parametrize("write", [objects_beside, objects_alone])
def test_objects_of_matlab_are_named_without_a_mapping_too(folder: Path, write: Callable[[Path], None]) -> None:
    write(folder)
    said = r"a\.mat: F \(a timeseries\) cannot be read; save objects of MATLAB as plain vectors"
    with pytest.raises(DataError, match=f"no table with force and position was found in it .*{said}"):
        propose(folder)


def test_objects_of_matlab_beside_good_files_are_said(folder: Path) -> None:
    objects_alone(folder)
    (folder / "b.csv").write_text(HEAD + PRESS)
    assert any("F (a timeseries) cannot be read" in doubt for doubt in propose(folder).doubts)


@pytest.mark.parametrize("number", ["1700000000", "200000", "1e300"])
def test_numbers_that_are_no_days_of_a_spreadsheet_are_named(folder: Path, number: str) -> None:
    text(HEAD, f"{number},1,1\n{number},2,2\n")(folder)
    with pytest.raises(DataError, match=r"line 2: '.*' as spreadsheet is beyond 9e\+09 s; correct the form of time"):
        imported(folder, time={"column": "Time (s)", "form": "spreadsheet"})


def test_a_year_beyond_those_of_nanoseconds_is_named(folder: Path) -> None:
    text(HEAD, "9998-01-01,1,1\n9998-01-02,2,2\n")(folder)
    with pytest.raises(DataError, match="line 2: '9998-01-01' as %Y-%m-%d is beyond"):
        imported(folder, time={"column": "Time (s)", "form": "%Y-%m-%d"})


@pytest.mark.parametrize(("unit", "one_N"), [("N", 1.0), ("mN", 1e-3)])
def test_the_unit_stands_in_the_column_behind(folder: Path, unit: str, one_N: float) -> None:
    rows = lines(f"{{:.3f}},{{:.5f}},{unit},{{:.5f}}", TIME_S, FORCE_N / one_N, WAY_MM)
    text("time_s,force,unit,position_mm\n", rows)(folder)
    check(came_in(folder))


def test_units_that_change_in_the_column_behind_are_refused(folder: Path) -> None:
    rows = lines("{:.3f},{:.5f},N,{:.5f}", TIME_S, FORCE_N, WAY_MM).splitlines(keepends=True)
    rows[30:] = [row.replace(",N,", ",mN,") for row in rows[30:]]
    text("time_s,force,unit,position_mm\n", "".join(rows))(folder)
    with pytest.raises(
        DataError, match=r"line 32: 'force' is in mN from here on and in N above; save the rows of each"
    ):
        propose(folder)


def test_two_specimens_under_one_name_are_not_to_be_dropped(folder: Path) -> None:
    rows = lines("gel,{:.3f},{:.5f},{:.5f}", TIME_S, WAY_MM, FORCE_N)
    text("label," + HEAD, rows + rows)(folder)
    with pytest.raises(DataError, match=rf"line {COUNT + 2}: .* another recording or specimen begins here") as told:
        imported(folder, label="label")
    assert "drop" not in str(told.value)


def test_a_row_that_was_swapped_may_be_left_out(folder: Path) -> None:
    rows = PRESS.splitlines(keepends=True)
    rows[40], rows[41] = rows[41], rows[40]
    text(HEAD, "".join(rows))(folder)
    with pytest.raises(DataError, match=r"line 43: .* leave such rows out: disorder = 'drop'"):
        imported(folder)


def test_a_workbook_that_is_open_in_excel_is_no_damaged_one(folder: Path) -> None:
    (folder / "a.csv").write_text(HEAD + PRESS)
    (folder / "~$a.xlsx").write_bytes(b"\x06Anna" + bytes(150))
    assert propose(folder).doubts == propose(folder / "a.csv").doubts


@pytest.mark.parametrize(
    ("name", "most", "instead"),
    [
        ("a.mat", "1", "save it with -v7.3"), ("a.mcap", "0.4", "save it as Parquet"),
        ("a.jsonl", "0.25", "save it as Parquet"), ("a.xlsx", "0.15", "save its sheets as CSV"),
    ],
)  # fmt: skip
def test_a_file_that_memory_does_not_hold_is_refused_before_it_is_read(
    folder: Path, name: str, most: str, instead: str
) -> None:
    with (folder / name).open("wb") as file:
        file.truncate(2_000_000_000)  # of holes, which take no room
    with pytest.raises(DataError, match=rf"{name}: its kind .* up to {most} GB of it, and it has 2.00 GB; {instead}"):
        imported(folder)
    with pytest.raises(DataError, match=f"no table with force and position was found in it .*{instead}"):
        propose(folder)
