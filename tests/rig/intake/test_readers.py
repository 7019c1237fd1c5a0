"""Every kind of file gives the same session: what one library wrote is what the import reads."""

import datetime
import json
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from mcap.writer import Writer

from rig.config.table import parse
from rig.errors import DataError
from rig.intake.mapping import DataMapping
from rig.intake.session import import_folder
from rig.recording.sessions import Session
from tests.rig.recording.measured import NOW, run, write

TIME_S = np.array([0.0, 0.25, 0.5, 1.0])
FORCE_N = np.array([0.125, 2.0, -3.5, 4.0])
WAY_MM = np.array([1.0, 2.0, 4.0, 8.0])
COLUMNS = {
    "force": {"column": "F", "unit": "N"},
    "position": {"column": "x", "unit": "mm"},
}
TIME = {"column": "t", "unit": "s"}


def imported(folder: Path, **form: object) -> Session:
    table = {"time": TIME, "columns": COLUMNS, **form}
    return import_folder(folder, parse(DataMapping, {"tables": [table]}, "made"), folder.parent / "out", NOW)


def check(session: Session, name: str) -> None:
    tables = session.recording(name).tables
    assert tables["force"]["capture_ns"].tolist() == (TIME_S * 1e9).astype(int).tolist()
    assert tables["force"]["fz_N"].tolist() == FORCE_N.tolist()
    assert tables["axis"]["position_mm"].tolist() == WAY_MM.tolist()


def test_vectors_and_structs_of_matlab(folder: Path) -> None:
    vectors = {"t": TIME_S.reshape(-1, 1), "F": FORCE_N.reshape(1, -1), "x": WAY_MM, "gain": 3.0}
    scipy.io.savemat(folder / "flat.mat", vectors)
    scipy.io.savemat(folder / "deep.mat", {"run": {"one": vectors, "note": "a text"}})
    check(imported(folder, files="flat.mat"), "flat")
    deep = parse(
        DataMapping, {"tables": [{"files": "deep.mat", "sheets": "run.*", "time": TIME, "columns": COLUMNS}]}, "m"
    )
    check(import_folder(folder, deep, folder.parent / "deep", NOW), "deep-run.one")


def test_a_table_of_matlab_is_read_by_its_columns(folder: Path) -> None:
    scipy.io.savemat(folder / "a.mat", {"data": np.stack([TIME_S, FORCE_N, WAY_MM], axis=1)})
    columns = {"force": {"column": "data:2", "unit": "N"}, "position": {"column": "data:3", "unit": "mm"}}
    check(imported(folder, files="a.mat", time={"column": "data:1", "unit": "s"}, columns=columns), "a")


def test_version_7_3_of_matlab_is_hdf5_behind_a_block_of_text(folder: Path) -> None:
    with h5py.File(folder / "a.mat", "w", userblock_size=512) as file:
        for name, values in (("t", TIME_S), ("F", FORCE_N), ("x", WAY_MM)):
            file.create_dataset(name, data=values.reshape(1, -1)).attrs["MATLAB_class"] = np.bytes_("double")
        file.create_dataset("note", data=np.array([[97], [98]], "u2")).attrs["MATLAB_class"] = np.bytes_("char")
    with (folder / "a.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    check(imported(folder, files="a.mat"), "a")


def test_an_object_of_matlab_is_refused_with_what_to_do(folder: Path) -> None:
    with h5py.File(folder / "a.mat", "w") as file:
        file.create_dataset("t", data=TIME_S)
        file.create_dataset("F", data=FORCE_N).attrs["MATLAB_object_decode"] = 3
    with pytest.raises(
        DataError, match=r"no column 'F'; there are 't'; F cannot be read; save objects .* table2struct"
    ):
        imported(folder, files="a.mat")


def test_a_group_of_hdf5_with_units_in_its_attributes(folder: Path) -> None:
    with h5py.File(folder / "a.h5", "w") as file:
        for name, values, unit in (("t", TIME_S * 1e3, "ms"), ("F", FORCE_N, "N"), ("x", WAY_MM * 1e-1, "cm")):
            file.create_dataset(f"runs/first/{name}", data=values).attrs["unit"] = unit
    columns = {"force": {"column": "F"}, "position": {"column": "x", "unit": "cm"}}
    session = imported(folder, files="a.h5", sheets="runs/{name}", time={"column": "t"}, columns=columns)
    check(session, "a-runs_first")


@pytest.mark.parametrize("across", [False, True])
def test_a_long_dataset_is_read_piece_by_piece(folder: Path, across: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.intake.arrays.BATCH_ROWS", 3)
    table = np.stack([TIME_S, FORCE_N, WAY_MM], axis=1)
    with h5py.File(folder / "a.h5", "w") as file:
        file["all"] = table.T if across else table
    columns = {"force": {"column": "all:2", "unit": "N"}, "position": {"column": "all:3", "unit": "mm"}}
    check(imported(folder, files="a.h5", time={"column": "all:1", "unit": "s"}, columns=columns), "a")


def test_a_parquet_file_of_several_row_groups(folder: Path) -> None:
    pq.write_table(pa.table({"t": TIME_S, "F": FORCE_N, "x": WAY_MM}), folder / "a.parquet", row_group_size=2)
    check(imported(folder, files="a.parquet"), "a")


def test_messages_of_mcap_as_json_and_our_own(folder: Path, source: Path) -> None:
    with (folder / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("cell", "json", 0)
        for row in zip(TIME_S, FORCE_N, WAY_MM, strict=True):
            body = dict(zip("tFx", row, strict=True))
            writer.add_message(channel, int(row[0] * 1e9), json.dumps(body).encode(), int(row[0] * 1e9))
        writer.finish()
    check(imported(folder, files="a.mcap", sheets="cell"), "a-cell")
    own = run(source, "own").path("trial_02")
    columns = {"force": {"column": "fz_n", "unit": "N"}}
    form = {"files": own.name, "sheets": "force", "time": {"column": "capture_ns", "unit": "ns"}, "columns": columns}
    again = import_folder(own, parse(DataMapping, {"tables": [form]}, "own"), folder.parent / "again", NOW)
    rows = again.recording("trial_02-force").tables["force"]
    assert rows["fz_N"].tolist() == [0.0, 0.5, 1.5]
    assert rows["capture_ns"].tolist() == [9_000_000_000, 9_001_000_000, 9_002_000_000]


def test_spreadsheet_dates_are_times(folder: Path) -> None:
    book, start = openpyxl.Workbook(), datetime.datetime(2026, 3, 1, 12)
    sheet = book["Sheet"]
    sheet.append(["t", "F", "x"])
    for seconds, *values in zip(TIME_S, FORCE_N, WAY_MM, strict=True):
        sheet.append([start + datetime.timedelta(seconds=float(seconds)), *map(float, values)])
    book.save(folder / "a.xlsx")
    session = imported(folder, files="a.xlsx", time={"column": "t", "form": "spreadsheet"})
    at_ns = session.recording("a-Sheet").tables["force"]["capture_ns"]
    # A spreadsheet's day has about a microsecond in double precision.
    assert at_ns[0] == pytest.approx(start.replace(tzinfo=datetime.UTC).timestamp() * 1e9, abs=2000)
    assert np.diff(at_ns) == pytest.approx(np.diff(TIME_S) * 1e9, abs=2000)


def test_counters_utf_16_and_thousands(folder: Path) -> None:
    lines = ["n\tF\tx", "0\t0,125\t1", "1\t2\t2", "2\t-3,5\t4", "4\t4\t1.234,5"]
    (folder / "a.txt").write_bytes("\n".join([*lines, ""]).encode("utf-16"))
    session = imported(
        folder, files="a.txt", encoding="utf-16", delimiter="\t", decimal=",", thousands=".",
        time={"column": "n", "form": "counter", "rate_Hz": 4.0},
    )  # fmt: skip
    tables = session.recording("a").tables
    assert tables["force"]["capture_ns"].tolist() == (TIME_S * 1e9).astype(int).tolist()
    assert tables["force"]["fz_N"].tolist() == FORCE_N.tolist()
    assert tables["axis"]["position_mm"].tolist() == [1.0, 2.0, 4.0, 1234.5]


@pytest.mark.parametrize("name", ["a.xlsx", "a.xls", "a.mat", "a.h5", "a.parquet", "a.mcap", "a.csv.gz"])
def test_a_damaged_file_is_one_sentence(folder: Path, name: str) -> None:
    (folder / name).write_bytes(b"\x89PNG nothing of the kind" * 40)
    with pytest.raises(DataError, match=rf"{name}: (not readable|cannot be read)"):
        imported(folder, files=name)


def test_columns_of_unlike_length_are_no_table(folder: Path) -> None:
    scipy.io.savemat(folder / "a.mat", {"t": TIME_S, "F": FORCE_N[:3], "x": WAY_MM})
    with pytest.raises(DataError, match="columns of one table differ in length: t has 4, F has 3, x has 4 values"):
        imported(folder, files="a.mat")


def test_a_text_longer_than_a_piece_is_read_without_a_seam(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.intake.text.BLOCK_BYTES", 200)
    rows = "".join(f"{k / 8},{k},{k * 2}\n" for k in range(100))
    tables = imported(write(folder, {"a.csv": "t,F,x\n" + rows}), files="a.csv").recording("a").tables
    assert tables["force"]["seq"].tolist() == list(range(100))
    assert tables["force"]["fz_N"].tolist() == list(range(100))
    assert tables["axis"]["velocity_mm_s"] == pytest.approx(np.full(100, 16.0))
