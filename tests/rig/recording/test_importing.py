"""`rig import`: what becomes of measured CSV files, and the one sentence for every way they can be wrong."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from rig.recording import importing
from rig.recording.importing import import_session
from rig.recording.sessions import open_session
from rig.recording.verify import verify
from tests.rig.recording.measured import FORCE, NOW, TRIAL, run, write


def test_a_good_folder_becomes_a_session(source: Path) -> None:
    session = run(source)
    assert session.info.kind == "import"
    assert session.info.id == "measured"
    assert session.info.created == "2024-05-01T10:00:00+00:00"
    assert session.info.subject == {"id": "S1", "age": 31}
    assert session.info.notes == {"surface_mm": 20.0, "room": "B12"}
    assert [(trial.name, trial.speed_mm_s, trial.depth_mm, trial.outcome) for trial in session.trials] == [
        ("trial_01", 5.0, 8.0, "imported"),
        ("trial_02", 5.0, 8.0, "imported"),
    ]
    assert session.trials[1].samples == {"force": 3, "axis": 3, "marker": 3}
    assert session.trials[1].peak_force_N == 1.5
    assert session.remarks == ()
    assert open_session(source.parent / "out") == session
    assert all(verify(session.path(trial.name)).ok for trial in session.trials)


def test_rows_keep_their_values_clocks_and_rates(source: Path) -> None:
    tables = run(source).recording("trial_02").tables
    force, axis, marker = tables["force"], tables["axis"], tables["marker"]
    assert force["seq"].tolist() == [0, 1, 2]
    assert force["capture_ns"].tolist() == [9_000_000_000, 9_001_000_000, 9_002_000_000]
    assert (force["arrival_ns"] == force["capture_ns"]).all()
    assert force["fz_N"].tolist() == [0.0, 0.5, 1.5]
    assert axis["capture_ns"].tolist() == [9_000_300_000, 9_001_300_000, 9_002_300_000]
    assert axis["position_mm"].tolist() == [20.0, 20.005, 20.01]
    assert axis["velocity_mm_s"] == pytest.approx([5.0, 5.0, 5.0])
    assert marker["z_mm"][[0, 2]].tolist() == [3.0, 3.5]


def test_what_was_not_measured_is_nan_or_zero(source: Path) -> None:
    force = run(source).recording("trial_01").tables["force"][0]
    assert all(math.isnan(force[name]) for name in ("fx_N", "my_N_m", "temperature_C"))
    assert (force["device_us"], force["status"], force["valid"]) == (0, 0, 1)


def test_a_marker_row_without_position_is_a_missing_marker(source: Path) -> None:
    marker = run(source).recording("trial_02").tables["marker"]
    assert marker["valid"].tolist() == [1, 0, 1]
    assert np.isnan(marker["x_mm"]).tolist() == [False, True, False]


def test_a_trial_without_marker_has_no_marker_rows(source: Path) -> None:
    assert len(run(source).recording("trial_01").tables["marker"]) == 0


def test_the_recording_says_how_to_read_it(source: Path) -> None:
    metadata = run(source).recording("trial_02").metadata
    assert metadata["calibration"] == {"force_axis": "fz", "compression": "positive", "surface_mm": "20.0"}
    assert metadata["trial"] == {"index": "1", "speed_mm_s": "5.0", "depth_mm": "8.0"}
    assert metadata["recording"]["kind"] == "import"
    assert metadata["subject"] == {"id": "S1", "age": "31"}
    assert json.loads(metadata["devices"]["marker"]) == {"product": "marker.csv"}


@pytest.mark.parametrize("word", ["tension", "Tensile", "pull", "-1", "false"])
def test_force_positive_in_tension_is_turned_round(source: Path, word: str) -> None:
    value = word if word in ("-1", "false") else f'"{word}"'
    (source / "session.toml").write_text(f"force_positive = {value}\n")
    session = run(source)
    assert session.recording("trial_01").tables["force"]["fz_N"].tolist() == [0.0, -0.5, -1.5]
    assert session.trials[0].peak_force_N == 0.0
    assert session.recording("trial_01").metadata["import"]["force_turned"] == "true"


@pytest.mark.parametrize("word", ["out", "away", "up", "out_of_tissue", "out of the tissue"])
def test_position_positive_out_of_the_tissue_is_turned_round_with_its_surface(source: Path, word: str) -> None:
    (source / "session.toml").write_text(f'position_positive = "{word}"\nsurface_mm = -20.0\n')
    recording = run(source).recording("trial_01")
    assert recording.tables["axis"]["position_mm"].tolist() == [-20.0, -20.005, -20.01]
    assert recording.tables["axis"]["velocity_mm_s"] == pytest.approx([-5.0, -5.0, -5.0])
    assert recording.metadata["calibration"]["surface_mm"] == "20.0"


@pytest.mark.parametrize("text", ['force_positive = "compression"\nposition_positive = "into"\n', "", "\n"])
def test_the_stated_convention_is_the_default(source: Path, text: str) -> None:
    (source / "session.toml").write_text(text)
    recording = run(source).recording("trial_01")
    assert recording.tables["force"]["fz_N"].tolist() == [0.0, 0.5, 1.5]
    assert "surface_mm" not in recording.metadata["calibration"]


def test_a_trial_may_state_its_own_surface(source: Path) -> None:
    (source / "trial_02/trial.toml").write_text(TRIAL + "surface_mm = 21.5\n")
    session = run(source)
    surfaces = [session.recording(trial.name).metadata["calibration"]["surface_mm"] for trial in session.trials]
    assert surfaces == ["20.0", "21.5"]


def test_other_column_names_are_given_by_columns(source: Path) -> None:
    for path in source.rglob("force.csv"):
        path.write_text(
            path.read_text().replace("time_s,force_N", "t,note,Fz").replace(",", ",x,").replace("t,x,", "t,")
        )
        path.write_text(path.read_text().replace("note,x,Fz", "note,Fz"))
    for path in source.rglob("axis.csv"):
        path.write_text(path.read_text().replace("time_s,position_mm", '"t"," z (mm) "'))
    session = run(source, "force.time_s=t", "axis.time_s=t", "force.force_N=Fz", "position_mm=z (mm)")
    assert session.recording("trial_01").tables["force"]["fz_N"].tolist() == [0.0, 0.5, 1.5]
    assert session.recording("trial_01").tables["axis"]["position_mm"].tolist() == [20.0, 20.005, 20.01]


def test_windows_files_with_byte_order_mark_read_the_same(source: Path) -> None:
    path = source / "trial_01/force.csv"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert run(source).recording("trial_01").tables["force"]["fz_N"].tolist() == [0.0, 0.5, 1.5]


def test_trials_are_ordered_by_their_time(source: Path) -> None:
    (source / "trial_01").rename(source / "trial_99")
    assert [trial.name for trial in run(source).trials] == ["trial_99", "trial_02"]


def test_times_that_start_anew_are_taken_with_a_remark(source: Path) -> None:
    write(source, {"trial_02/force.csv": FORCE.replace("0.5", "0.6")})
    assert run(source).remarks == (
        "trial_02 starts at 0 s, before trial_01 ends at 0.002 s: time_s should run through the whole session",
    )


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
def test_a_long_session_written_side_by_side_is_the_same(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = run(source)
    monkeypatch.setattr(importing, "PARALLEL_ROWS", 0)
    other = import_session(source, source.parent / "other", [], NOW)
    assert other.info == one.info
    for trial in one.trials:
        assert other.path(trial.name).read_bytes() == one.path(trial.name).read_bytes()
