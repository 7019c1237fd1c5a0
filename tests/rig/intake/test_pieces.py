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


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    return tmp_path / "in"


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
    with pytest.raises(DataError, match=r"a\.csv line 73: time 0 s follows 1\.18 s; time must increase"):
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
