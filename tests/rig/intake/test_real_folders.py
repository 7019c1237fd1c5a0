"""Every folder of real recordings that holds force or motion comes in; values are those another library reads.

The recordings stay outside the project: without them these tests skip, saying so.
"""

import struct
import zlib
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest
import xlrd
from numpy.typing import NDArray

from mock_devices.testing.real_data import ROOT
from rig.config.table import load
from rig.intake.mapping import DataMapping
from rig.intake.session import import_folder
from rig.recording.alignment import read_alignments
from rig.recording.sessions import Session
from tests.data import recording

MAPPINGS = ROOT / "examples" / "mappings"
NOW = datetime(2026, 1, 2, tzinfo=UTC)
Numbers = NDArray[np.float64]


def imported(name: str, out: Path) -> Session:
    return import_folder(recording(name), load(DataMapping, MAPPINGS / f"{name}.toml"), out / "session", NOW)


def check(session: Session, name: str, time_s: Numbers, force_N: Numbers, position_mm: Numbers) -> None:
    """The recording has these values, and no others."""
    tables = session.recording(name).tables
    assert tables["force"]["capture_ns"] == pytest.approx(time_s * 1e9, abs=0.6)
    assert tables["force"]["fz_N"] == pytest.approx(force_N, rel=1e-12, abs=1e-15)
    assert tables["axis"]["position_mm"] == pytest.approx(position_mm, rel=1e-12, abs=1e-15)


def test_wells_of_hydrogel(tmp_path: Path) -> None:
    session = imported("asmi", tmp_path)
    assert len(session.trials) == 24
    path = next((recording("asmi") / "run_002").glob("well_B6_*.csv"))
    frame = pd.read_csv(path, skiprows=10)
    values = [frame[name].to_numpy() for name in ("Timestamp(s)", "Force(N)", "Z_Position(mm)")]
    check(session, "run_002_B6", values[0], -values[1], -values[2])
    metadata = session.recording("run_002_B6").metadata
    assert metadata["source"]["Force_Limit(N)"] == "45.0"
    assert (metadata["labels"]["specimen"], metadata["labels"]["site"]) == ("run_002", "B6")


def test_a_servo_axis_in_matlab(tmp_path: Path) -> None:
    session = imported("emps", tmp_path)
    found = read_mat5(recording("emps") / "DATA_EMPS_PULSES.mat")
    volts, gtau = found["vir"], found["gtau"][0]
    force = np.where(np.abs(volts) >= 10, np.nan, volts * gtau)
    tables = session.recording("DATA_EMPS_PULSES").tables
    assert tables["force"]["fz_N"] == pytest.approx(force, rel=1e-9, nan_ok=True)
    assert tables["axis"]["position_mm"] == pytest.approx(found["qm"] * 1e3, rel=1e-12)
    assert tables["force"]["valid"].sum() == np.isfinite(force).sum()
    assert len(session.trials) == 2


def read_mat5(path: Path) -> dict[str, Numbers]:
    """Vectors of doubles in a compressed MAT file of version 5, by its format's description (MathWorks, 2019)."""
    data, at, found = path.read_bytes(), 128, dict[str, Numbers]()
    while at < len(data):
        kind, size = struct.unpack_from("<II", data, at)
        assert kind == 15
        matrix = zlib.decompress(data[at + 8 : at + 8 + size])
        at += 8 + size
        fields, place = list[tuple[int, bytes]](), 8
        while place < len(matrix):
            tag, length = struct.unpack_from("<II", matrix, place)
            small = tag >> 16
            fields.append(
                (tag & 0xFFFF, matrix[place + 4 : place + 4 + small] if small else matrix[place + 8 :][:length])
            )
            place += 8 if small else 8 + length + -length % 8
        kind, numbers = fields[3]
        found[fields[2][1].decode()] = np.frombuffer(numbers, {9: "<f8", 2: "u1"}[kind]).astype(float)
    return found


def test_a_joint_of_an_arm(tmp_path: Path) -> None:
    session = imported("franka_joint", tmp_path)
    frame = pd.read_csv(recording("franka_joint") / "case3_slow_first12000.csv")
    force, position = frame["q2_tau_J_compensate"].to_numpy(), frame["q2"].to_numpy() * 1000
    check(session, "case3_slow_first12000", frame["time"].to_numpy(), force, position)


def test_recordings_below_each_other(tmp_path: Path) -> None:
    session = imported("perineal_indentation", tmp_path)
    frame = pd.read_csv(recording("perineal_indentation") / "recordings.csv.gz")
    copies = next((remark.split()[0] for remark in session.remarks if "hold the same data" in remark), "0")
    assert len(session.trials) + int(copies) == frame["recording"].nunique()
    rows = frame[frame["recording"] == "230331_C_Indentation_relaxation_500N_force|FF2 2D"]
    values = [rows[name].to_numpy() for name in ("t_s", "force_N", "extension_mm")]
    check(session, "230331_C_Indentation_relaxation_500N_force_FF2_2D", values[0], values[1], values[2])


def test_two_loggers_of_one_move(tmp_path: Path) -> None:
    recorded = imported("rack_pinion", tmp_path).recording("a3")
    tables, alignment = recorded.tables, read_alignments(recorded.metadata)["force"]
    speed = pd.read_csv(recording("rack_pinion") / "a3MR.csv", skiprows=5, header=None)
    force = pd.read_csv(recording("rack_pinion") / "a3NI.csv", skiprows=4, header=None)
    assert tables["axis"]["velocity_mm_s"] == pytest.approx(speed[1].to_numpy() * 2 * np.pi / 60 * 1000)
    assert tables["force"]["fz_N"].tolist() == force[1].tolist()
    # Drift is within 100 ppm of half a second.
    moved_ns = (force[0].to_numpy() + alignment.offset_s) * 1e9
    assert tables["force"]["capture_ns"] == pytest.approx(moved_ns, abs=5e4)
    way = np.cumsum(
        np.diff(speed[0]) * 1e-3 * (tables["axis"]["velocity_mm_s"][1:] + tables["axis"]["velocity_mm_s"][:-1]) / 2
    )
    assert tables["axis"]["position_mm"][1:] == pytest.approx(way, abs=1e-5)
    # The lag at which the logger's second signal is most nearly a line of the way, tried one by one.
    way_s, second = speed[0].to_numpy()[1:] * 1e-3, force[3].to_numpy()
    lags_s = np.arange(-0.05, 0.05, 1e-4)
    likeness = [abs(np.corrcoef(np.interp(force[0] + lag_s, way_s, way), second)[0, 1]) for lag_s in lags_s]
    assert alignment.offset_s == pytest.approx(lags_s[np.argmax(likeness)], abs=alignment.within_s)
    assert alignment.within_s < 2e-3


def test_servos_with_sign_bits_and_iso_times(tmp_path: Path) -> None:
    session = imported("servo_sts3215", tmp_path)
    frame = pd.read_csv(recording("servo_sts3215") / "motor_telemetry_comp2.csv", parse_dates=["timestamp"])
    axis = session.recording("comp2-3").tables["axis"]
    assert axis["capture_ns"].tolist() == frame["timestamp"].astype("datetime64[ns, UTC]").astype("int64").tolist()
    assert axis["valid"].tolist() == frame["pos (3)"].notna().astype(int).tolist()
    mm = 2 * np.pi * 1000 / 4096
    assert axis["position_mm"] == pytest.approx(frame["pos (3)"].to_numpy() * mm, nan_ok=True)
    raw = frame["speed (3)"].to_numpy()
    signed = np.where(raw >= 32768, -(raw - 32768), raw)
    assert axis["velocity_mm_s"] == pytest.approx(signed * mm, nan_ok=True)
    assert (signed < 0).any()


def test_a_rheometer_workbook(tmp_path: Path) -> None:
    session = imported("soft_food", tmp_path)
    assert len(session.trials) == 10
    sheet = xlrd.open_workbook(recording("soft_food") / "compression-outplane-7.xls").sheet_by_name("Axial - 3")
    header = sheet.row_values(1)
    time_s, force, gap = (
        np.array(sheet.col_values(header.index(name), 3)) for name in ("Step time", "Axial force", "Gap")
    )
    check(session, "outplane-7-3", time_s, force, -gap / 1000)


def test_strips_with_a_chinese_header(tmp_path: Path) -> None:
    session = imported("vhb4910", tmp_path)
    assert len(session.trials) == 9
    for name, encoding, rows in (("0d05_2d0", "gbk", 3), ("relaxation_3d0", "utf-8", 2)):
        frame = pd.read_csv(recording("vhb4910") / f"{name}.csv", encoding=encoding, skiprows=rows, header=None)
        check(session, name, frame[0].to_numpy(), -frame[2].to_numpy(), -frame[1].to_numpy())


def test_a_workbook_of_a_testing_machine(tmp_path: Path) -> None:
    session = imported("zwick_original", tmp_path)
    (path,) = recording("zwick_original").glob("*.xlsx")
    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    assert len(session.trials) == len(book.sheetnames) - 3
    rows = list(book["RDG2 2A"].iter_rows(min_row=4, values_only=True))
    values = np.array([row[:3] for row in rows if row[0] is not None], float)
    check(session, "RDG2_2A", values[:, 0], values[:, 1], values[:, 2])
