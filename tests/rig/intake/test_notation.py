"""Each way to write numbers, times, signs and missing values is understood, or said with its place where it is not."""

import datetime
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from numpy.typing import NDArray

from rig.errors import DataError
from rig.intake.notation import Notation, notation_of, pattern_of
from rig.intake.proposal import propose
from rig.intake.survey import sign_of
from tests.rig.intake.test_proposal import ROWS, session_of, table_of
from tests.rig.recording.measured import write

FORCES = [0.5 * k for k in range(40)]


def came_in(folder: Path, text: str, *answers: str, name: str = "a.csv") -> dict[str, NDArray[np.void]]:
    """The streams of the one recording in a file of this text."""
    source = write(folder / "in", {name: text})
    proposal = propose(source)
    assert len(proposal.questions) == len(answers), [item.text for item in proposal.questions]
    return session_of(proposal.answered(answers), source, folder / "out").recording(Path(name).stem).tables


def doubts_of(folder: Path, text: str) -> str:
    return "\n".join(propose(write(folder / "in", {"a.csv": text})).doubts)


def column(cells: list[str]) -> str:
    """A table with these cells as its forces."""
    return "time_s,force_N,x_mm\n" + "".join(f"{k / 10},{cell},{k / 2}\n" for k, cell in enumerate(cells))


@pytest.mark.parametrize("word", ["", "NaN", "NA", "N/A", "--", "-", "null", "#NV", "-999", "-999.0", "-3.697314E+28"])
def test_what_stands_for_no_number_is_a_sample_that_is_not_valid(tmp_path: Path, word: str) -> None:
    cells = [*map(str, FORCES[:6]), word, *map(str, FORCES[7:])]
    force = came_in(tmp_path, column(cells))["force"]
    assert force["valid"].tolist() == [1] * 6 + [0] + [1] * 33
    assert force["fz_N"][np.isfinite(force["fz_N"])] == pytest.approx(FORCES[:6] + FORCES[7:])


def test_a_code_for_no_number_that_may_be_one_is_kept(tmp_path: Path) -> None:
    cells = [str(-1000.0 + 25 * k) for k in range(39)] + ["-999"]
    assert came_in(tmp_path, column(cells))["force"]["valid"].all()


def test_another_word_in_a_column_is_said_with_its_place(tmp_path: Path) -> None:
    cells = [*map(str, FORCES[:6]), "5 mN", *map(str, FORCES[7:])]
    assert "a.csv line 8, column force_N: '5 mN' is no number; mend it" in doubts_of(tmp_path, column(cells))
    with pytest.raises(DataError, match="line 8, column force_N: '5 mN' is not a number"):
        came_in(tmp_path, column(cells))


def test_65535_is_minus_one_of_an_unsigned_counter(tmp_path: Path) -> None:
    counts = [k % 65536 for k in range(-20, 20)]
    tables = came_in(tmp_path, column(list(map(str, counts))).replace("force_N", "Load"), "0.01")
    assert np.abs(tables["force"]["fz_N"]) == pytest.approx([abs(0.01 * k) for k in range(-20, 20)])
    assert tables["force"]["fz_N"][0] * tables["force"]["fz_N"][-1] < 0


@pytest.mark.parametrize(
    ("values", "sign"),
    [
        ([*range(10), 65535, 65530, 65500], {"bits": 16}),
        ([*range(10), 2**32 - 1, 2**32 - 5, 2**32 - 3], {"bits": 32}),
        ([*range(10), 32769, 32780, 33000], {"sign_bit": 15}),
        ([*range(10), 1025, 1030, 1100], {"sign_bit": 10}),
        ([100, 1100] * 20, {}),  # a target here and there
        (list(range(65536)), {}),  # a counter that goes through
        ([0.5, 65535.0, 65534.0, 65533.0, 1.0, 2.0], {}),
        ([-1, 0, 65535, 65534, 65533], {}),
    ],
)
def test_where_the_sign_of_whole_numbers_stands(values: list[float], sign: dict[str, int]) -> None:
    assert sign_of(np.array(values, float)) == sign


def test_a_force_at_the_end_of_its_range_is_said_with_its_place(tmp_path: Path) -> None:
    cells = [str(min(force, 9.99)) for force in FORCES]
    said = doubts_of(tmp_path, column(cells))
    assert "line 22, column force_N: 20 rows stay at 9.99, its largest" in said
    assert "saturates = [-9.99, 9.99]" in said


def test_a_force_at_its_end_with_the_ripple_of_a_converter_is_said(tmp_path: Path) -> None:
    ripple = np.random.default_rng(1).integers(-3, 4, 40)
    cells = [f"{min(force, 9.99) + 0.001 * step:.3f}" for force, step in zip(FORCES, ripple, strict=True)]
    said = doubts_of(tmp_path, column(cells))
    assert "line 22, column force_N: 20 rows stay at 9.987, its largest" in said
    assert "saturates = [-9.987, 9.987]" in said


def test_a_force_that_rests_at_its_largest_from_the_start_is_no_end_of_range(tmp_path: Path) -> None:
    cells = [f"{force:.3f}" for force in [19.5] * 20 + FORCES[::-1][:20]]
    assert "its largest" not in doubts_of(tmp_path, column(cells))


@pytest.mark.parametrize(
    ("cells", "found"),
    [
        (["1,234.5", "2.0"], Notation(".", ",", "")),
        (["1.234,5", "2,0"], Notation(",", ".", "")),
        (["1 234,5", "2,0"], Notation(",", " ", "")),
        (["1'234.5", "2.0"], Notation(".", "'", "")),
        (["1,234,567"], Notation(".", ",", "")),
        (["0,123", "1,234"], Notation(",", "", "")),
        (["1,234", "5,678"], Notation(",", "", "1,234")),
        (["1,234", "5.5"], Notation(".", ",", "")),
        (["1.234", "5.678"], Notation(".", "", "")),
    ],
)
def test_which_sign_is_the_decimal_one(cells: list[str], found: Notation) -> None:
    assert notation_of(cells) == found


def test_a_comma_that_may_part_thousands_is_a_doubt(tmp_path: Path) -> None:
    text = "Zeit [s];Kraft [N];Weg [mm]\n" + "".join(f"{k};{k + 1},250;{k + 2},500\n" for k in range(1, 9))
    assert "a.csv: '2,250' is read with a decimal comma; it may part thousands" in doubts_of(tmp_path, text)


@pytest.mark.parametrize(
    ("header", "times", "step_s"),
    [
        ("time_ms", [20 * k for k in range(8)], 0.02),
        ("time", [20 * k for k in range(800)], 0.02),
        ("time", [0.02 * k for k in range(800)], 0.02),
        ("t", [1.7e9 + 0.25 * k for k in range(8)], 0.25),
        ("stamp", [1_700_000_000_000 + 250 * k for k in range(8)], 0.25),
        ("Time", [f"2026-03-01T12:00:00.{25 * k:02d}Z" for k in range(4)], 0.25),
        ("Zeit", [f"12:00:00.{25 * k:02d}" for k in range(4)], 0.25),
    ],
)  # fmt: skip
def test_units_and_forms_of_time(tmp_path: Path, header: str, times: list[object], step_s: float) -> None:
    rows = "".join(f"{at},{k % 50 / 7:.3f},{k / 2}\n" for k, at in enumerate(times))
    at_ns = came_in(tmp_path, f"{header},force_N,x_mm\n{rows}")["force"]["capture_ns"]
    assert np.diff(at_ns) == pytest.approx(np.full(len(times) - 1, step_s * 1e9), rel=1e-5)


def test_a_time_that_may_be_seconds_or_milliseconds_is_asked(tmp_path: Path) -> None:
    rows = "".join(f"{k},{k},{k / 2}\n" for k in range(0, 4000, 5))
    at_ns = came_in(tmp_path, "time,force_N,x_mm\n" + rows, "ms")["force"]["capture_ns"]
    assert at_ns[1] - at_ns[0] == 5_000_000


def test_a_counter_has_the_rate_that_stands_above(tmp_path: Path) -> None:
    text = "Sampling rate (Hz),200\n\n" + table_of("Frame,force_N,x_mm", [(k, *row[1:]) for k, row in enumerate(ROWS)])
    assert np.diff(came_in(tmp_path, text)["force"]["capture_ns"]).tolist() == [5_000_000] * 7


def test_dates_of_a_spreadsheet(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    book["Sheet"].append(["Zeit", "Kraft [N]", "Weg [mm]"])
    for time_s, force_N, way_mm in ROWS:
        at = datetime.datetime(2026, 3, 1, 12) + datetime.timedelta(seconds=time_s)
        book["Sheet"].append([at, force_N, way_mm])
    (tmp_path / "in").mkdir()
    book.save(tmp_path / "in" / "a.xlsx")
    session = session_of(propose(tmp_path / "in"), tmp_path / "in", tmp_path / "out")
    steps_ns = np.diff(session.recording("a-Sheet").tables["force"]["capture_ns"])
    assert steps_ns == pytest.approx(np.full(7, 1e8), abs=2e3)


def test_a_day_that_may_be_a_month_is_a_doubt() -> None:
    assert pattern_of(["03/04/2021 10:11:12"]) == ("%d/%m/%Y %H:%M:%S", "%m/%d/%Y %H:%M:%S")
    assert pattern_of(["03/14/2021 10:11:12"]) == ("%m/%d/%Y %H:%M:%S",)
    assert pattern_of(["soon"]) == ()


def test_rows_whose_time_does_not_grow_are_left_out_and_said(tmp_path: Path) -> None:
    rows = [(k / 10, float(k), k / 2) for k in range(30)]
    rows[20] = (1.9, 7.0, 7.0)
    text = table_of("time_s,force_N,x_mm", rows)
    assert "a.csv line 22: time does not grow, as in 1 rows in all; they are left out" in doubts_of(tmp_path, text)
    assert came_in(tmp_path, text)["force"].size == 29
