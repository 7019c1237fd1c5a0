"""What could be read wrong with confidence is asked, said or refused, with the place of it."""

from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from rig.errors import DataError
from rig.intake.mapping import DataMapping
from rig.intake.proposal import propose
from rig.intake.session import import_folder
from rig.trials.opening import is_recorded, is_session
from tests.rig.intake.instruments import PRESS, text
from tests.rig.intake.instruments_logged import PICO, vicon
from tests.rig.intake.test_foreign import FORCE_N, ROWS, TIME_S, WAY_MM, came_in, lines
from tests.rig.recording.measured import NOW

HEAD = "Time (s),Position (mm),Force (N)\n"
TIMED = {"column": "Zeit [s]"}
COLUMNS = {"force": {"column": "Kraft [mN]"}, "position": {"column": "Weg [um]"}}


def mapped(folder: Path, **more: object) -> None:
    """Imports by a mapping of a table with semicolons."""
    table = {"files": "*.csv", "delimiter": ";", "time": TIMED, "columns": COLUMNS, **more}
    import_folder(folder, DataMapping.model_validate({"tables": [table]}), folder.parent / "out", NOW)


def test_a_name_and_a_row_of_units_that_differ_are_asked(folder: Path) -> None:
    text(HEAD + "s,mm,kN\n")(folder)
    (question,) = propose(folder).questions
    assert "'Force (N)'" in question.text and "by its name and in another by the row of units" in question.text
    assert not question.usual
    session = came_in(folder, "N")
    assert session.recording("a").tables["force"]["fz_N"] == pytest.approx(FORCE_N)


@pytest.mark.parametrize(
    ("thousands", "decimal", "wrong"), [(",", ".", "12,5"), (".", ",", "0.020"), (".", ",", "1.23")]
)
def test_a_sign_that_does_not_part_thousands_is_refused(folder: Path, thousands: str, decimal: str, wrong: str) -> None:
    text("Zeit [s];Kraft [mN];Weg [um]\n", f"0;1;2\n1;{wrong};3\n2;5;6\n")(folder)
    with pytest.raises(DataError, match=r"a\.csv line 3, column Kraft \[mN\]: .* is no number whose thousands"):
        mapped(folder, thousands=thousands, decimal=decimal)


def test_points_beside_decimal_commas_are_no_thousands(folder: Path) -> None:
    rows = "".join(f"{t:.2f};{f * 1e3:.2f};".replace(".", ",", 1) + f"{w * 1e3:.2f}\n" for t, w, f in ROWS)
    text("Zeit [s];Kraft [mN];Weg [um]\n", rows)(folder)
    with pytest.raises(DataError, match="others of this table have a decimal comma"):
        came_in(folder)


def test_devices_and_trajectories_keep_their_rates(folder: Path) -> None:
    vicon(folder)
    tables = came_in(folder).recording("a").tables
    assert tables["force"]["fz_N"] == pytest.approx(np.repeat(FORCE_N, 10))
    assert tables["axis"]["position_mm"] == pytest.approx(WAY_MM, abs=1e-4)
    assert tables["force"]["capture_ns"] == pytest.approx(np.arange(600) * 2e6)
    assert tables["axis"]["capture_ns"] == pytest.approx(np.arange(60) * 20e6)


def test_a_channel_in_two_units_is_refused_with_its_line(folder: Path) -> None:
    rows = "".join(
        f"{t:.3f},force,{f:.5f},{'N' if row < 30 else 'mN'}\n{t:.3f},position,{w:.5f},mm\n"
        for row, (t, w, f) in enumerate(ROWS)
    )
    text("time_s,channel,value,unit\n", rows)(folder)
    with pytest.raises(DataError, match=r"line 62: force is in 'mN' here and in 'N' above"):
        came_in(folder)


def test_channels_with_times_of_their_own_keep_them(folder: Path) -> None:
    rows = [f"{t:.3f},force,{f:.5f},N\n" for t, _, f in ROWS] + [
        f"{t:.3f},position,{w:.5f},mm\n" for t, w, _ in ROWS[::2]
    ]
    text("time_s,signal,value,unit\n", "".join(sorted(rows)))(folder)
    tables = came_in(folder).recording("a").tables
    assert tables["force"]["fz_N"] == pytest.approx(FORCE_N)
    assert tables["axis"]["position_mm"] == pytest.approx(WAY_MM[::2], abs=1e-4)
    assert tables["axis"]["capture_ns"] == pytest.approx(np.arange(30) * 40e6)


def test_a_sample_beyond_the_range_is_missing(folder: Path) -> None:
    text(PICO, lines("{:.5f},{:.5f},{:.5f}", TIME_S * 1e3, FORCE_N, WAY_MM) + "1200.00000,-∞,2.00000\n")(folder)
    force = came_in(folder).recording("a").tables["force"]
    assert force["valid"].tolist() == [True] * 60 + [False]


def test_a_row_below_an_empty_line_is_said(folder: Path) -> None:
    text(HEAD, f"{PRESS}\n\n7.4,6.0,12\n")(folder)
    assert any("line 64: rows go on below an empty line" in doubt for doubt in propose(folder).doubts)


def test_the_count_of_a_sensors_packets_is_no_time(folder: Path) -> None:
    head = "RDT Sample Rate: 50\nStatus (hex), RDTSequence, F/T Sequence, Fx, Fy, Fz, Position (mm)\n"
    text(head, lines("00000000,{:d},{:d},1,2,{:.5f},{:.5f}", np.arange(60), 3 * np.arange(60), FORCE_N, WAY_MM))(folder)
    assert propose(folder).tree["tables"][0]["time"]["rate_Hz"] == 50.0


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (PRESS.replace("\n", "\r"), "its lines end as old Macs wrote them"),
        (PRESS.replace(".", ","), "the comma parts cells and decimals"),
        (PRESS + "1.2,0.", "line 62: 2 cells where the header has 3; mend it"),
    ],
)
def test_a_file_that_cannot_be_read_says_why(folder: Path, rows: str, said: str) -> None:
    head = HEAD.replace("\n", "\r") if "\r" in rows else HEAD
    (folder / "a.csv").write_bytes((head + rows).encode())
    with pytest.raises(DataError, match=said):
        propose(folder)


def test_a_column_of_time_that_repeats_is_named(folder: Path) -> None:
    text(HEAD, lines("{:.3f},{:.5f},{:.5f}", np.floor(TIME_S * 25) / 25, WAY_MM, FORCE_N))(folder)
    (question,) = propose(folder).questions
    assert "no column of time that grows from row to row ('Time (s)' does not)" in question.text


def test_an_mcap_file_of_another_program_is_no_session(tmp_path: Path) -> None:
    with (tmp_path / "bag.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(library="other")
        writer.finish()
    (tmp_path / "damaged.mcap").write_bytes(b"\x89MCAP0\r\n" + bytes(range(200)))
    assert not is_session(tmp_path)
    assert not is_recorded(tmp_path / "bag.mcap")


def test_units_of_length_above_the_columns_are_the_usual_answer(folder: Path) -> None:
    """As Motive lays out its export: one line of settings (docs.optitrack.com, Data Export: CSV)."""
    head = "Format Version,1.23,Take Name,a,Export Frame Rate,50.0,Length Units,Meters\n\n"
    head += "Frame,Time (Seconds),Force (N),Z\n"
    text(head, lines("{:d},{:.6f},{:.5f},{:.8f}", np.arange(60), TIME_S, FORCE_N, WAY_MM / 1e3))(folder)
    (question,) = propose(folder).questions
    assert question.usual == "m"
    assert came_in(folder, "m").recording("a").tables["axis"]["position_mm"] == pytest.approx(WAY_MM, abs=1e-3)


def test_an_abbreviated_inch_is_one(folder: Path) -> None:
    rows = lines("{:.3f}\t{:.6f}\t{:.8f}", TIME_S, FORCE_N, WAY_MM / 25.4)
    text("Time(sec.)\tLoad(N)\tExtension(in.)\n", rows, "a.txt")(folder)
    assert came_in(folder).recording("a").tables["axis"]["position_mm"] == pytest.approx(WAY_MM, abs=1e-4)


MINUSES = "\u2212\u2013\uff0d"


@pytest.mark.parametrize("minus", MINUSES)
@pytest.mark.parametrize("head", ["Time (s),Force (N),Position (mm)\n", "Zeit [s];Kraft [N];Weg [mm]\n"])
def test_a_minus_that_is_no_hyphen_is_read_as_one_and_said(folder: Path, minus: str, head: str) -> None:
    rows = "".join(f"{t:.2f},{-1 - f:.4f},{w:.4f}\n" for t, w, f in ROWS).replace("-", minus)
    text(head, rows if "," in head else rows.replace(",", ";").replace(".", ","))(folder)
    (said,) = [doubt for doubt in propose(folder).doubts if "is read as a minus" in doubt]
    assert f"a.csv: '{minus}" in said
    session = came_in(folder)
    found = session.recording("a").tables["force"]
    assert found["valid"].all()
    # Turned round, since a force that falls is taken for tension.
    assert found["fz_N"] == pytest.approx(1 + FORCE_N, abs=1e-4)


def test_a_minus_that_the_mapping_does_not_know_is_named_with_its_key(folder: Path) -> None:
    text("Zeit [s];Kraft [mN];Weg [um]\n", "0;1;2\n1;\u22122;3\n2;5;6\n")(folder)
    with pytest.raises(DataError, match=r"line 3, column Kraft \[mN\]: .* if its sign is a minus, state it: minus = "):
        mapped(folder)
    mapped(folder, minus="\u2212")


ROWS_IN_N = "".join(f"{t:.2f},{f:.5f},{w:.5f}\n" for t, w, f in ROWS[:30])
ROWS_IN_MN = "".join(f"{t:.2f},{1e3 * f:.5f},{w:.5f}\n" for t, w, f in ROWS[30:])
PLAIN, UNITS = "Time,Force,Position\n", "s,N,mm\n"


@pytest.mark.parametrize(
    ("above", "between", "line"),
    [
        (PLAIN + UNITS, UNITS.replace("N", "mN"), 33),
        (PLAIN + UNITS, "\n" + PLAIN + UNITS.replace("N", "mN"), 36),
        ("Time [s],Force [N],Position [mm]\n", "Time [s],Force [mN],Position [mm]\n", 32),
    ],
)
def test_a_unit_that_changes_further_down_is_refused_with_both(
    folder: Path, above: str, between: str, line: int
) -> None:
    text(above, ROWS_IN_N + between + ROWS_IN_MN)(folder)
    with pytest.raises(DataError, match=rf"line {line}: 'Force.*' is in mN from here on and in N above; save what"):
        propose(folder)


def test_a_unit_that_changes_is_refused_where_the_mapping_leaves_other_lines_out(folder: Path) -> None:
    text("Zeit [s];Kraft [mN];Weg [um]\n", "0;1;2\n1;2;3\n s ;N;um\n2;5;6\n")(folder)
    for more in ({"other_lines": "drop"}, {}):
        with pytest.raises(DataError, match=r"line 4: 'Kraft \[mN\]' is in N from here on and in mN above"):
            mapped(folder, **more)


def test_the_same_units_further_down_are_left_out_as_any_other_line(folder: Path) -> None:
    rows = "".join(f"{t:.2f},{f:.5f},{w:.5f}\n" for t, w, f in ROWS[30:])
    text(PLAIN + UNITS, ROWS_IN_N + UNITS + rows)(folder)
    assert came_in(folder).recording("a").tables["force"]["fz_N"] == pytest.approx(FORCE_N, abs=1e-4)
