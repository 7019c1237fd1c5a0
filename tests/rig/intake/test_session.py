"""`rig import`: what becomes of measured files."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from rig.intake.mapping import MAPPING_FILE
from rig.recording.sessions import open_session
from rig.recording.verify import verify
from tests.rig.recording.measured import FORCE, MAPPING, MARKER_TABLE, TABLES, run, write


def test_a_good_folder_becomes_a_session(source: Path) -> None:
    session = run(source)
    assert session.info.kind == "import"
    assert session.info.id == "measured"
    assert session.info.created == "2024-05-01T10:00:00+00:00"
    assert session.info.subject == {"id": "S1", "age": 31}
    assert session.info.notes == {"room": "B12"}
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


def test_an_empty_cell_is_a_sample_nobody_vouches_for(source: Path) -> None:
    write(source, {"trial_01/force.csv": FORCE.replace("0.5", "")})
    force = run(source).recording("trial_01").tables["force"]
    assert force["valid"].tolist() == [1, 0, 1]
    assert np.isnan(force["fz_N"]).tolist() == [False, True, False]


def test_the_recording_says_how_to_read_it_and_where_it_is_from(source: Path) -> None:
    metadata = run(source).recording("trial_02").metadata
    assert metadata["calibration"] == {"force_axis": "fz", "compression": "positive", "surface_mm": "20.0"}
    assert metadata["trial"] == {"index": "1", "speed_mm_s": "5.0", "depth_mm": "8.0"}
    assert metadata["recording"]["kind"] == "import"
    assert metadata["subject"] == {"id": "S1", "age": "31"}
    assert json.loads(json.dumps(metadata["source"])) == {"file": "force.csv"}
    assert metadata["labels"]["folder"] == "trial_02"


@pytest.mark.parametrize("word", ["tension", "Tensile", "pull"])
def test_force_positive_in_tension_is_turned_round(source: Path, word: str) -> None:
    text = (source / MAPPING_FILE).read_text().replace('"force_N" }', f'"force_N", positive = "{word}" }}')
    (source / MAPPING_FILE).write_text(text)
    session = run(source)
    assert session.recording("trial_01").tables["force"]["fz_N"].tolist() == [0.0, -0.5, -1.5]
    assert session.trials[0].peak_force_N == -1.5


@pytest.mark.parametrize("word", ["out", "away", "up", "out_of_tissue", "out of the tissue"])
def test_position_positive_out_of_the_tissue_is_turned_round_with_its_surface(source: Path, word: str) -> None:
    text = (source / MAPPING_FILE).read_text().replace('"position_mm" }', f'"position_mm", positive = "{word}" }}')
    (source / MAPPING_FILE).write_text(text.replace("surface_mm = 20.0", "surface_mm = -20.0"))
    recording = run(source).recording("trial_01")
    assert recording.tables["axis"]["position_mm"].tolist() == [-20.0, -20.005, -20.01]
    assert recording.tables["axis"]["velocity_mm_s"] == pytest.approx([-5.0, -5.0, -5.0])
    assert recording.metadata["calibration"]["surface_mm"] == "20.0"


def test_a_trial_may_state_its_own_facts(source: Path) -> None:
    own = "[recordings.trial_02]\nsurface_mm = 21.5\nspeed_mm_s = 7\n"
    (source / MAPPING_FILE).write_text(MAPPING + own + TABLES + MARKER_TABLE)
    session = run(source)
    surfaces = [session.recording(trial.name).metadata["calibration"]["surface_mm"] for trial in session.trials]
    assert surfaces == ["20.0", "21.5"]
    assert [(trial.speed_mm_s, trial.depth_mm) for trial in session.trials] == [(5.0, 8.0), (7.0, 8.0)]


def test_windows_files_with_byte_order_mark_read_the_same(source: Path) -> None:
    path = source / "trial_01/force.csv"
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    assert run(source).recording("trial_01").tables["force"]["fz_N"].tolist() == [0.0, 0.5, 1.5]


def test_trials_on_one_clock_are_ordered_by_their_time(source: Path) -> None:
    (source / "trial_01").rename(source / "trial_99")
    assert [trial.name for trial in run(source).trials] == ["trial_99", "trial_02"]


def test_times_that_start_anew_are_taken_with_a_remark(source: Path) -> None:
    write(
        source,
        {"trial_02/force.csv": FORCE.replace("0.5", "0.6"), "trial_02/axis.csv": "time_s,position_mm\n0,1\n1,2\n"},
    )
    assert run(source).remarks == (
        "trial_02 starts at 0 s, before trial_01 ends at 0.0023 s: each recording counts its own time, so nothing is "
        "said of drift",
    )


def test_a_copy_of_a_recording_is_left_out_and_said(source: Path) -> None:
    for stream in ("force", "axis"):
        write(source, {f"trial_02/{stream}.csv": (source / f"trial_01/{stream}.csv").read_text()})
    (source / "trial_02/marker.csv").unlink()
    (source / MAPPING_FILE).write_text(MAPPING + TABLES)
    session = run(source)
    assert [trial.name for trial in session.trials] == ["trial_01"]
    assert session.remarks == ("trial_02 holds the same data as trial_01 and was left out",)


def test_files_of_no_pattern_are_named(source: Path) -> None:
    write(source, {"notes/other.csv": "a,b\n1,2\n", "readme.md": ""})
    assert run(source).remarks == ("1 files are of no pattern and were left out: notes/other.csv",)


def test_recordings_of_one_column_are_told_apart_across_pieces(tmp_path: Path) -> None:
    rows = [
        f"{name},{t},{t * k},{t * 3}" for k, name in enumerate(("beef 1", "a/b", "beef/2")) for t in (0.0, 0.5, 1.0)
    ]
    mapping = """[[tables]]
files = "all.csv"
label = "sample"
time = { column = "t", unit = "s" }
columns = { force = { column = "F", unit = "kN" }, position = { column = "x", unit = "um" } }
"""
    source = write(tmp_path / "in", {"all.csv": "\n".join(["sample,t,F,x", *rows]) + "\n", MAPPING_FILE: mapping})
    session = run(source)
    assert [trial.name for trial in session.trials] == ["a_b", "beef_1", "beef_2"]
    tables = session.recording("beef_2").tables
    assert tables["force"]["fz_N"].tolist() == [0.0, 1000.0, 2000.0]
    assert tables["axis"]["position_mm"] == pytest.approx([0.0, 0.0015, 0.003], rel=1e-12)
