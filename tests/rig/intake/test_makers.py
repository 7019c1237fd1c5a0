"""What makers' programs write of several tests comes in whole, in the right unit and sense, without a question."""

from pathlib import Path

import numpy as np
import pytest

import rig.intake.text
from rig.config.table import parse
from rig.errors import DataError
from rig.intake.mapping import DataMapping
from rig.intake.proposal import propose
from rig.intake.session import import_folder
from tests.rig.intake.makers import MAKERS, A, B, C, Press, dynamometer, rows
from tests.rig.intake.test_foreign import came_in
from tests.rig.recording.measured import NOW


@pytest.mark.parametrize("maker", MAKERS)
def test_every_recording_of_a_maker_comes_in_whole(folder: Path, maker: str) -> None:
    written = MAKERS[maker](folder)
    session = came_in(folder)
    assert len(session.trials) == len(written)
    for trial, own in zip(session.trials, written, strict=True):
        tables = session.recording(trial.name).tables
        force, axis = tables["force"], tables["axis"]
        assert np.diff(force["capture_ns"]) * 1e-9 == pytest.approx(np.diff(own.time_s), abs=1e-3)
        assert force["fz_N"] == pytest.approx(own.force_N, abs=1e-3 * np.ptp(own.force_N))
        assert axis["position_mm"] - axis["position_mm"][0] == pytest.approx(
            own.way_mm - own.way_mm[0], abs=1e-3 * np.ptp(own.way_mm)
        )


@pytest.mark.parametrize(("torque", "one_N"), [("FT-LBS", 1.3558179483314), ("N-M", 1.0)])
def test_units_stand_over_the_columns_of_a_report_as_they_are_placed(folder: Path, torque: str, one_N: float) -> None:
    (folder / "b.txt").write_text("".join(dynamometer(torque)))
    tables = came_in(folder).recording("b").tables
    # A newton metre at the lever of a metre is a newton, and a degree 17.45 mm.
    assert tables["force"]["fz_N"] == pytest.approx(5 * one_N * A.force_N, abs=0.06 * one_N)
    assert tables["axis"]["position_mm"] == pytest.approx(np.deg2rad(10 * A.way_mm) * 1e3, abs=1.0)


@pytest.mark.parametrize(
    "head", ["TIME (S),TRAVEL (MM),FORCE (MN)", "TimeMs,PositionUm,ForceMN", "TIME,TRAVEL,FORCE\nS,MM,MN"]
)
def test_whether_capitals_are_a_thousandth_or_a_million_newtons_is_asked(folder: Path, head: str) -> None:
    (folder / "a.csv").write_text(head + "\n" + rows("{:.3f},{:.5f},{:.5f}", *A))
    (question,) = propose(folder).questions
    assert "may be in mN or MN" in question.text
    assert question.usual == ""
    came_in(folder, "mN")


def test_time_that_begins_anew_between_pieces_of_a_text_begins_a_recording(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = MAKERS["time_begins_anew"](folder)
    mapping = parse(DataMapping, propose(folder).tree, "proposed")
    monkeypatch.setattr(rig.intake.text, "BLOCK_BYTES", 1000)
    session = import_folder(folder, mapping, folder.parent / "whole", NOW)
    assert [trial.samples["force"] for trial in session.trials] == [own.time_s.size for own in written]
    with pytest.raises(DataError, match="or say disorder = 'restart'"):  # which the first piece does not show
        came_in(folder)


def test_tests_of_one_specimen_whose_name_stands_in_each_row_are_told_by_their_number(folder: Path) -> None:
    data = "".join(rows("gel,{:.3f},{:.5f},{:.5f}", *own) for own in (A, C))
    (folder / "a.csv").write_text("specimen,Time (s),Position (mm),Force (N)\n" + data)
    session = came_in(folder)
    assert [(trial.name, trial.samples["force"]) for trial in session.trials] == [("gel-1", 250), ("gel-2", 200)]


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_velocity_is_counted_into_the_tissue_as_the_way_it_makes(folder: Path, sense: float) -> None:
    speed = np.gradient(A.way_mm, A.time_s)
    data = rows("{:.3f},{:.6f},{:.5f}", A.time_s, sense * speed, A.force_N)
    (folder / "a.csv").write_text("time_s,velocity_mm_s,force_N\n" + data)
    found = came_in(folder).recording("a").tables["axis"]
    assert found["velocity_mm_s"] == pytest.approx(speed, abs=1e-5)
    assert found["position_mm"] == pytest.approx(A.way_mm, abs=0.02)


def mixed(folder: Path, sign: float) -> None:
    """Rows that say by a word whether the force presses or pulls."""
    said = ["Compression" if force >= 0 else "Tension" for force in A.force_N - 0.5]
    force = np.where(A.force_N >= 0.5, A.force_N - 0.5, sign * (0.5 - A.force_N))
    data = "".join(f"{t:.3f},{w:.5f},{f:.5f},{s}\n" for t, w, f, s in zip(A.time_s, A.way_mm, force, said, strict=True))
    (folder / "a.csv").write_text("Time (s),Travel (mm),Load (N),Direction\n" + data)


def test_a_force_whose_sign_is_a_word_in_each_row_has_it(folder: Path) -> None:
    mixed(folder, 1.0)
    said = "'Load (N)' has no sign, 'Direction' says it (sign = \"Direction\", "
    said += "signs = { Compression = 1, Tension = -1 })"
    assert any(said in doubt for doubt in propose(folder).doubts)
    assert came_in(folder).recording("a").tables["force"]["fz_N"] == pytest.approx(A.force_N - 0.5, abs=1e-4)


def test_nor_where_the_force_has_a_sign_of_its_own(folder: Path) -> None:
    mixed(folder, -1.0)
    assert not any("has no sign" in doubt for doubt in propose(folder).doubts)


def pressed_and_pulled(folder: Path) -> list[Press]:
    """Two kinds of tests in one folder, told apart by the names of the files alone."""
    for name, own in (("compression_1", A), ("compression_2", B), ("tension_1", C)):
        (folder / f"{name}.csv").write_text("Time (s),Position (mm),Force (N)\n" + rows("{:.3f},{:.5f},{:.5f}", *own))
    return [A, B, C.times(-1, -1)]


def test_files_that_press_and_files_that_pull_have_their_own_senses(folder: Path) -> None:
    written = pressed_and_pulled(folder)
    session = came_in(folder)
    for trial, own in zip(session.trials, written, strict=True):
        assert session.recording(trial.name).tables["force"]["fz_N"] == pytest.approx(own.force_N, abs=1e-4)


@pytest.mark.parametrize(
    ("fact", "said"),
    [
        ("Test type,Compression", "as pressed, which 'Compression' says"),
        ("Test type,Tension", "as pulled, which 'Tension' says"),
        ("Tension limit,50 N", "'Tension limit' speaks of tension"),
        ("Tension limit,50 N\nCompression limit,50 N", "as if pressed"),
    ],
)
def test_what_is_said_above_of_the_test_is_followed_or_doubted(folder: Path, fact: str, said: str) -> None:
    data = rows("{:.3f},{:.5f},{:.5f}", *A)
    (folder / "a.csv").write_text(f"{fact}\n\nTime (s),Position (mm),Force (N)\n{data}")
    assert any(said in doubt for doubt in propose(folder).doubts)


def test_of_ways_without_a_known_name_each_is_said(folder: Path) -> None:
    data = rows("{:.3f},{:.5f},{:.5f},{:.5f}", A.time_s, A.way_mm, 0.97 * A.way_mm, A.force_N)
    (folder / "a.csv").write_text("Time (s),Actuator (mm),LVDT (mm),Load (N)\n" + data)
    assert any(
        "position is taken to be 'LVDT (mm)'; it may be 'Actuator (mm)'" in doubt for doubt in propose(folder).doubts
    )
