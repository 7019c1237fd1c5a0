"""What a table looks like where 80 columns are all there is: a pipe, and most terminals."""

import pytest

from api.cli.output import show
from rig.results.tables import TextTable, control_table
from rig.tissue.summary import ControlRow

ROW = ControlRow(
    force_N=12.03, depth_mm=10.25, secant_N_mm=10.119, tangent_N_mm=11.4682, tangent_low_N_mm=6.95213,
    tangent_high_N_mm=14.66127, damping_N_s_mm=0.94561, damping_low_N_s_mm=0.0, damping_high_N_s_mm=11.96914,
)  # fmt: skip


def test_no_number_of_the_table_for_control_is_broken_in_two(capsys: pytest.CaptureFixture[str]) -> None:
    show(control_table([ROW], "index"))
    said = capsys.readouterr().out.replace("│", " ").split()
    numbers = ("12.03", "10.25", "10.12", "11.47", "6.952", "14.66", "0.9456", "0", "11.97")
    assert [number for number in numbers if number not in said] == []


def test_a_path_goes_on_in_the_next_line(capsys: pytest.CaptureFixture[str]) -> None:
    long = "/a/path/of/a/good/many/letters/that/no/eighty/columns/hold/beside/anything/else/at/all.csv"
    show(TextTable("", ["law", "displacement", "kept in"], [["constant", "0.25", long]]))
    said = capsys.readouterr().out
    assert "displacement" in said and "constant" in said and long not in said
    assert max(map(len, said.splitlines())) <= 80
