"""One press in pieces: in blocks of one file, in two files, in rows that hold one of its streams each."""

from pathlib import Path

import numpy as np
import pytest

from rig.errors import DataError
from rig.intake.proposal import propose
from rig.recording.sessions import Session
from tests.rig.intake.instruments import OTHER as LATER
from tests.rig.intake.instruments import PRESS, text
from tests.rig.intake.test_foreign import COUNT, FORCE_N, TIME_S, WAY_MM, came_in, check, lines
from tests.rig.recording.measured import run

HEAD = "Time (s)\tPosition (mm)\tForce (N)\n"
# What LabVIEW writes above each segment, whose words are those of columns; a table of its own names other columns.
BLOCK = "\nChannels\t2\nSamples\t{}\nX_Dimension\tTime\tTime\n***End_of_Header***\n" + HEAD
OTHER = "\nSpecimen\tPeak force (N)\tDisplacement (mm)\nA\tlow\tnone\n"
ROWS = PRESS.replace(",", "\t").splitlines(keepends=True)


def in_blocks(folder: Path, step_s: float = 0.02) -> None:
    """Two files of three segments each, between which ``step_s`` pass."""
    lost = round(step_s / 0.02) - 1
    for name, rows in (("a.lvm", ROWS), ("b.lvm", LATER.replace(",", "\t").splitlines(keepends=True))):
        pieces = [rows[:20], rows[20 + lost : 40], rows[40:]]
        text("", "".join(BLOCK.format(len(rows)) + "".join(rows) for rows in pieces), name)(folder)


def numbers(session: Session) -> list[int]:
    return [trial.samples["force"] for trial in session.trials]


def test_segments_in_which_time_goes_on_are_one_recording(folder: Path) -> None:
    in_blocks(folder)
    (said,) = [doubt for doubt in propose(folder).doubts if "row of names" in doubt]
    assert said.startswith("a.lvm: its row of names comes 3 times while time goes on, so it is taken as one recording")
    session = came_in(folder)
    assert numbers(session) == [COUNT, COUNT]
    check(session, "a")


def test_segments_between_which_time_passes_are_recordings(folder: Path) -> None:
    in_blocks(folder, step_s=0.08)
    assert numbers(came_in(folder)) == [20, 17, 20] * 2


def test_recordings_that_each_begin_at_zero_stay_apart_and_are_not_joined_in_silence(folder: Path) -> None:
    text("", "".join(BLOCK.format(COUNT) + rows for rows in ("".join(ROWS), LATER.replace(",", "\t"))))(folder)
    session = came_in(folder)
    assert numbers(session) == [COUNT, COUNT]
    mapping = propose(folder).answered(()).text.replace("repeats = true\n", "")
    (folder / "mapping.toml").write_text(mapping)
    with pytest.raises(
        DataError, match=r"a\.csv line 73: time 0 s follows 1\.18 s; another recording or specimen begins"
    ):
        run(folder, "joined")


def test_a_table_of_other_columns_ends_the_rows(folder: Path) -> None:
    text(HEAD, "".join(ROWS) + OTHER + "1.18\t7.0\t7.0\n" * 3)(folder)
    assert numbers(came_in(folder)) == [COUNT]


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("rate", [1, 3])
def test_the_sense_of_a_way_is_seen_where_force_is_in_another_file(folder: Path, sense: int, rate: int) -> None:
    text("Time (s),Force (N)\n", lines("{:.3f},{:.5f}", TIME_S, FORCE_N), "a_force.csv")(folder)
    taken = np.r_[0 : COUNT - 1 : rate, COUNT - 1]
    rows = lines("{:.4f},{:.5f}", TIME_S[taken], 215.0 + sense * WAY_MM[taken])
    text("Time (s),Position (mm)\n", rows, "a_pose.csv")(folder)
    (trial,) = (session := came_in(folder)).trials
    found = session.recording(trial.name).tables["axis"]["position_mm"]
    assert found == pytest.approx(sense * 215.0 + WAY_MM[taken], abs=1e-4)


@pytest.mark.parametrize("sense", [1, -1])
def test_the_sense_of_a_way_is_seen_where_each_row_has_one_stream(folder: Path, sense: int) -> None:
    rows = "".join(
        f"{time_s:.3f},{force_N:.5f},\n{time_s + 0.01:.3f},,{215 + sense * way_mm:.5f}\n"
        for time_s, force_N, way_mm in zip(TIME_S, FORCE_N, WAY_MM, strict=True)
    )
    text("Time (s),Force (N),Position (mm)\n", rows)(folder)
    (trial,) = (session := came_in(folder)).trials
    axis = session.recording(trial.name).tables["axis"]
    assert axis["position_mm"][axis["valid"] != 0] == pytest.approx(sense * 215.0 + WAY_MM, abs=1e-4)


def test_a_part_in_which_nothing_moves_comes_in_and_is_not_called_left_aside(folder: Path) -> None:
    still = lines("{:.3f}\t2.0\t{:.5f}", TIME_S, 0.01 * np.cos(50 * TIME_S))
    text("", BLOCK.format(COUNT) + still + BLOCK.format(COUNT) + "".join(ROWS))(folder)
    proposal = propose(folder)
    assert not [doubt for doubt in proposal.doubts if "left aside" in doubt]
    assert numbers(came_in(folder)) == [COUNT, COUNT]


def test_one_zero_byte_above_the_table_is_no_damage(folder: Path) -> None:
    text("WinTest 7\0\nElapsed Time,Disp,Load\nSec,mm,N\n")(folder)
    check(came_in(folder))


def test_a_lone_letter_beyond_ascii_is_of_the_west(folder: Path) -> None:
    text("Zeit;Druckverlängerung;Drucklast\ns;mm;N\n", PRESS.replace(",", ";"), encoding="cp1252")(folder)
    proposal = propose(folder)
    assert 'encoding = "cp1252"' in proposal.text
    assert any(doubt.startswith("the encoding may be cp1252: ") for doubt in proposal.doubts), "a tie is a doubt"


def test_specimens_beside_each_other_have_times_of_their_own_without_units_in_the_names(folder: Path) -> None:
    columns = [np.full((3, COUNT), np.nan) for _ in range(2)]
    for number, (rate, own) in enumerate(((1, slice(None)), (2, slice(0, COUNT, 2)))):
        columns[number][:, : len(TIME_S[own])] = TIME_S[own] * rate, FORCE_N[own], WAY_MM[own]
    rows = (",".join("" if np.isnan(cell) else f"{cell:.5f}" for cell in row) for row in np.concatenate(columns).T)
    text("t_1,F_1,x_1,t_2,F_2,x_2\n", "\n".join(rows) + "\n")(folder)
    session = came_in(folder, "N", "mm")
    assert [trial.name for trial in session.trials] == ["a-1", "a-2"]
    steps_s = [np.diff(session.recording(trial.name).tables["force"]["capture_ns"]) * 1e-9 for trial in session.trials]
    assert [set(np.round(one, 6)) for one in steps_s] == [{0.02}, {0.08}]


@pytest.mark.parametrize(("names", "units"), [("t.s,F.mN,x.mm", 1e3), ("Time..s.,Force..mN.,Displacement..mm.", 1e3)])
def test_units_stand_in_names_as_r_writes_them(folder: Path, names: str, units: float) -> None:
    text(f"{names}\n", lines("{:.3f},{:.3f},{:.5f}", TIME_S, FORCE_N * units, WAY_MM))(folder)
    check(came_in(folder))


def test_two_loggers_whose_stamps_do_not_begin_together_have_clocks_of_their_own(folder: Path) -> None:
    for name, head, values, late_s in (("force", "Force (N)", FORCE_N, 0.0), ("pose", "Position (mm)", WAY_MM, 0.7)):
        stamps = np.datetime64("2026-05-04T10:00:00") + np.round((TIME_S + late_s) * 1e3).astype("timedelta64[ms]")
        text(f"Time,{head}\n", lines("{}Z,{:.5f}", stamps, values), f"a_{name}.csv")(folder)
    proposal = propose(folder)
    assert any("their times do not begin and end together" in doubt for doubt in proposal.doubts)
    assert 'clock = "own"' in proposal.text


def test_a_summary_of_a_few_rows_is_no_recording(folder: Path) -> None:
    text(HEAD, "".join(ROWS))(folder)
    text("Date,Max force (N),Max displacement (mm)\n", "2026-05-04,3.1,6.0\n2026-05-05,3.2,6.0\n", "summary.csv")(
        folder
    )
    assert [trial.name for trial in came_in(folder).trials] == ["a"]
