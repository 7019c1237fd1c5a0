"""`rig export`: the same rows, with units, in formats other programs open."""

import csv
import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
import scipy.io

from rig.channels import FORCE, STREAMS
from rig.config.table import load
from rig.errors import DataError, UsageError, WriteFailed
from rig.intake.mapping import MAPPING_FILE, DataMapping
from rig.intake.session import import_folder
from rig.recording.export import FORMATS, Format, export
from rig.recording.sessions import JsonTable, Session, SessionInfo, TrialInfo, open_session, write_session
from tests.rig.recording.conftest import WriteRecording, axis, event, force
from tests.rig.recording.measured import NOW, run
from tests.rig.recording.test_mcap_file import disk_of


def imported(folder: Path, out: Path) -> Session:
    return import_folder(folder, load(DataMapping, folder / MAPPING_FILE), out, NOW)


@pytest.fixture
def session(tmp_path: Path, write_recording: WriteRecording) -> Session:
    """Two trials of 150 ms."""
    names = ("indent-1", "2 deep")
    for name in names:
        write_recording(name, rows=150)
    trials = tuple(TrialInfo(name, f"{name}.mcap", 5.0, 8.0, "done", 4.5, {"force": 150}) for name in names)
    subject: JsonTable = {"id": "7", "age": 31}
    info = SessionInfo("s1", "capture", "2024-05-01T10:00:00", "tissue-rig", subject=subject, trials=trials)
    write_session(tmp_path, info)
    return open_session(tmp_path)


def test_csv_has_a_folder_a_trial_as_import_reads_it(session: Session, tmp_path: Path) -> None:
    out = export(session, "csv", tmp_path / "out")
    assert sorted(str(path.relative_to(out)) for path in out.rglob("*.*")) == [
        "columns.csv",
        "mapping.toml",
        "session.json",
        *(
            f"trial_{trial}/{file}"
            for trial in ("2 deep", "indent-1")
            for file in ("axis.csv", "event.csv", "force.csv")
        ),
    ]
    with (out / "trial_indent-1" / "force.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["time_s", "force_N", *FORCE.kinds]
    values = [tuple(map(float, row)) for row in rows[1:]]
    assert [row[2:] for row in values] == [tuple(map(float, force(seq))) for seq in range(150)]
    assert values[7][:2] == (1.007, -1.0), "fz of this sensor is negative in compression"


def test_csv_looks_like_this(session: Session, tmp_path: Path) -> None:
    out = export(session, "csv", tmp_path / "out")
    assert (out / "trial_indent-1" / "axis.csv").read_text().splitlines()[:3] == [
        '"time_s","seq","capture_ns","arrival_ns","position_mm","velocity_mm_s","current_A","status","valid"',
        "1,0,1000000000,1000200000,0,10,0.1,4663,1",
        "1.001,1,1001000000,1001200000,0.01,10,0.1,4663,1",
    ]
    assert (out / "trial_indent-1" / "event.csv").read_text().splitlines() == [
        '"time_s","seq","capture_ns","arrival_ns","level","code","text"',
        '1,0,1000000000,1000000000,10,"note","Berührung 0"',
        '1.1,1,1100000000,1100000000,10,"note","Berührung 1"',
    ]
    mapping = load(DataMapping, out / MAPPING_FILE)
    assert (mapping.session.id, mapping.session.subject) == ("s1", {"id": "7", "age": 31})
    assert [form.files for form in mapping.tables] == [f"{{recording:trial_*}}/{s}.csv" for s in ("force", "axis")]
    legend = (out / "columns.csv").read_text().splitlines()
    assert legend[0] == "stream,column,unit,meaning"
    assert 'force,fz_N,N,"force along the sensor\'s z"' in legend
    assert len(legend) == 3 + sum(len(stream.kinds) for stream in STREAMS)
    assert json.loads((out / "session.json").read_text())["id"] == "s1"


def test_an_unknown_speed_is_left_out_of_the_csv_export(session: Session, tmp_path: Path) -> None:
    trial = replace(session.trials[0], speed_mm_s=math.nan)
    out = export(replace(session, info=replace(session.info, trials=(trial,))), "csv", tmp_path / "out")
    stated = tomllib.loads((out / MAPPING_FILE).read_text())["recordings"]
    assert stated == {"trial_indent-1": {"depth_mm": 8.0, "outcome": "done"}}


def test_parquet_has_units(session: Session, tmp_path: Path) -> None:
    out = export(session, "parquet", tmp_path / "out")
    table = pq.read_table(out / "2 deep.axis.parquet")
    assert [tuple(row.values()) for row in table.to_pylist()] == [axis(seq) for seq in range(150)]
    assert table.schema.field("velocity_mm_s").metadata[b"unit"] == b"mm/s"
    assert (out / "session.json").exists()


def test_hdf5_has_a_group_a_trial_and_units_as_attributes(session: Session, tmp_path: Path) -> None:
    out = export(session, "hdf5", tmp_path / "out.h5")
    with h5py.File(out) as file:
        assert sorted(file) == ["2 deep", "indent-1"]
        assert file["indent-1/force/fz_N"][:].tolist() == [force(seq).fz_N for seq in range(150)]
        assert file["indent-1/force/seq"].dtype == np.int64
        assert dict(file["indent-1/axis/velocity_mm_s"].attrs) == {
            "unit": "mm/s",
            "meaning": "actual velocity as the drive gives it",
        }
        assert [text.decode() for text in file["indent-1/event/text"]] == [event(seq).text for seq in range(2)]
        assert file["indent-1"].attrs["speed_mm_s"] == 5.0
        assert json.loads(file["indent-1"].attrs["metadata"])["recording"] == {"id": "r1", "trial": "indent-1"}
        assert json.loads(file.attrs["session"])["kind"] == "capture"


def test_hdf5_opens_with_libraries_of_release_1_10(session: Session, tmp_path: Path) -> None:
    out = export(session, "hdf5", tmp_path / "out.h5")
    superblock_version = out.read_bytes()[8]
    assert superblock_version <= 2


def test_mat_has_a_struct_a_trial(session: Session, tmp_path: Path) -> None:
    out = export(session, "mat", tmp_path / "out.mat")
    content = scipy.io.loadmat(str(out), simplify_cells=True)
    trial = content["indent_1"]
    assert trial["force"]["fz_N"].tolist() == [force(seq).fz_N for seq in range(150)]
    assert trial["force"]["capture_ns"].dtype == np.int64
    assert list(trial["event"]["text"]) == [event(seq).text for seq in range(2)]
    assert (trial["speed_mm_s"], trial["outcome"]) == (5.0, "done")
    assert content["units"]["axis"]["current_A"] == "A"
    assert json.loads(content["session"])["id"] == "s1"
    assert "trial_2_deep" in content


def test_mat_names_stay_apart(session: Session, tmp_path: Path, write_recording: WriteRecording) -> None:
    write_recording("indent_1", rows=1)
    out = export(open_session(tmp_path), "mat", tmp_path / "out.mat")
    assert {"indent_1", "indent_1_2"} <= set(scipy.io.loadmat(str(out)))


@pytest.mark.parametrize("format", FORMATS)
def test_an_existing_place_is_not_overwritten(session: Session, tmp_path: Path, format: Format) -> None:
    export(session, format, tmp_path / "out")
    with pytest.raises(UsageError, match="exists already and is not overwritten"):
        export(session, format, tmp_path / "out")


@pytest.mark.parametrize("format", FORMATS)
def test_a_full_disk_leaves_nothing_half_written(session: Session, tmp_path: Path, format: Format) -> None:
    before = sorted(tmp_path.rglob("*"))
    with disk_of(3_000), pytest.raises(WriteFailed, match="nothing was left behind"):
        export(session, format, tmp_path / "out")
    assert sorted(tmp_path.rglob("*")) == before


def test_an_empty_session_is_refused(session: Session, tmp_path: Path) -> None:
    for path in tmp_path.glob("*.mcap"):
        path.unlink()
    with pytest.raises(UsageError, match="no recording to export"):
        export(open_session(tmp_path), "csv", tmp_path / "out")


def test_exported_csv_can_be_imported_again(source: Path, tmp_path: Path) -> None:
    first = run(source)
    again = imported(export(first, "csv", tmp_path / "csv"), tmp_path / "again")
    assert again.info.id == first.info.id
    assert again.info.subject == first.info.subject
    for before, after in zip(first.trials, again.trials, strict=True):
        assert replace(before, sha256="") == replace(after, sha256="")
        one, two = first.recording(before.name), again.recording(after.name)
        assert one.metadata["calibration"] == two.metadata["calibration"]
        for name, table in one.tables.items():
            assert table.tobytes() == two.tables[name].tobytes()


def test_two_tools_seen_at_one_time_come_back_as_two(source: Path, tmp_path: Path) -> None:
    folder = export(run(source), "csv", tmp_path / "csv")
    (trial, *_) = sorted(folder.glob("trial_*"))
    rows = [f"{100_000_000 * frame},{frame},0,0,{tool}" for frame in range(5) for tool in (0, 1)]
    (trial / "marker.csv").write_text("\n".join(["capture_ns,x_mm,y_mm,z_mm,tool", *rows]) + "\n")
    again = imported(folder, tmp_path / "again")
    marker = again.recording(trial.name).tables["marker"]
    assert marker["tool"].tolist() == [0, 1] * 5
    assert marker["x_mm"].tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    (trial / "marker.csv").write_text("\n".join(["capture_ns,x_mm,y_mm,z_mm,tool", *rows[::-1]]) + "\n")
    with pytest.raises(DataError, match=r"marker.csv line 4: time 0.3 s follows 0.4 s; time must increase"):
        imported(folder, tmp_path / "turned")


def test_how_late_each_sample_came_is_kept(source: Path, tmp_path: Path) -> None:
    folder = export(run(source), "csv", tmp_path / "csv")
    (trial, *_) = sorted(folder.glob("trial_*"))
    header, *rows = (trial / "axis.csv").read_text().splitlines()
    names = [name.strip('"') for name in header.split(",")]
    at = names.index("arrival_ns")
    cells = [row.split(",") for row in rows]
    later = [[*row[:at], str(int(row[at]) + 700), *row[at + 1 :]] for row in cells]
    (trial / "axis.csv").write_text("\n".join([header, *(",".join(row) for row in later)]) + "\n")
    axis_rows = imported(folder, tmp_path / "again").recording(trial.name).tables["axis"]
    assert set((axis_rows["arrival_ns"] - axis_rows["capture_ns"]).tolist()) == {700}


def test_a_run_that_tracked_a_force_is_exported_and_no_trial_to_import(
    tmp_path: Path, write_recording: WriteRecording
) -> None:
    write_recording("track_001", rows=50, kind="tracking")
    trial = TrialInfo("track_001", "track_001.mcap", math.nan, math.nan, "done")
    write_session(tmp_path, SessionInfo("s1", "track", "2024-05-01T10:00:00", "tissue-rig", trials=(trial,)))
    out = export(open_session(tmp_path), "csv", tmp_path / "out")
    assert (out / "track_001" / "force.csv").exists()
    assert not list(out.glob("trial_*"))
