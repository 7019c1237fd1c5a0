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
    last = capsys.readouterr().out.splitlines()[-1]
    cells = [cell.strip() for cell in last.split("│")]
    assert cells == ["12.03", "10.25", "10.12", "11.47", "6.952 to 14.66", "0.9456", "0 to 11.97"]


def test_a_law_s_name_is_whole_over_its_column(capsys: pytest.CaptureFixture[str]) -> None:
    header = ["force (N)", "measured (mm)", "constant", "error (mm)", "error (%)", "index", "error (mm)", "error (%)"]
    show(TextTable("", header, [["33.54", "2.28", "2.76", "1.192", "75.9", "2.69", "1.120", "71.3"]], words=0))
    assert " constant " in capsys.readouterr().out


def test_a_word_of_a_header_is_whole_and_a_path_goes_on_in_the_next_line(capsys: pytest.CaptureFixture[str]) -> None:
    long = "/a/path/of/a/good/many/letters/that/no/eighty/columns/hold/beside/anything/else/at/all.csv"
    show(TextTable("", ["law", "displacement", "kept in"], [["constant", "0.25", long]]))
    said = capsys.readouterr().out
    assert "displacement" in said and "constant" in said and long not in said
    assert max(map(len, said.splitlines())) <= 80
