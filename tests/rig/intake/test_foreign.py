"""Files as the programs of other laboratories write them come in without a mapping, with two questions at most.

What stands in them is made from one press into a spring; it is written by other libraries, or letter by letter as the
maker's program lays it out, and has to come out in our units and senses.
"""

import json
import tomllib
from datetime import datetime, timedelta
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from mcap.writer import Writer
from mcap_ros2.writer import Writer as RosWriter
from numpy.typing import NDArray

from rig.config.table import parse
from rig.intake.mapping import DataMapping
from rig.intake.proposal import propose
from rig.intake.session import import_folder
from rig.recording.sessions import Session
from tests.rig.recording.measured import NOW

COUNT = 60
TIME_S = np.arange(COUNT) * 0.02
WAY_MM = 2.0 + 4.0 * np.sin(np.pi * TIME_S / TIME_S[-1]) ** 2
FORCE_N = np.round(np.maximum(0.0, WAY_MM - 3.0) * 2.5 + 0.01 * np.cos(50 * TIME_S), 5)
ROWS = list(zip(TIME_S, WAY_MM, FORCE_N, strict=True))
FEW_QUESTIONS = 2


def came_in(folder: Path, *answers: str) -> Session:
    """The session of what is proposed and answered; the saved mapping is what is imported."""
    proposal = propose(folder)
    assert len(proposal.questions) == len(answers) <= FEW_QUESTIONS, [item.text for item in proposal.questions]
    text = proposal.answered(answers).text
    return import_folder(folder, parse(DataMapping, tomllib.loads(text), "proposed"), folder.parent / "out", NOW)


def check(session: Session, name: str = "", *, step_s: float = 0.02, abs_N: float = 1e-4, abs_mm: float = 1e-4) -> None:
    """The recording, or each one, holds the press."""
    for trial in [session.trial(name)] if name else session.trials:
        tables = session.recording(trial.name).tables
        assert np.diff(tables["force"]["capture_ns"]) == pytest.approx(np.full(COUNT - 1, step_s * 1e9), abs=2e3)
        assert tables["force"]["fz_N"] == pytest.approx(FORCE_N, abs=abs_N)
        assert tables["axis"]["position_mm"] == pytest.approx(WAY_MM, abs=abs_mm)


def lines(form: str, *columns: NDArray[np.generic]) -> str:
    return "".join(form.format(*row) + "\n" for row in zip(*columns, strict=True))


def test_instron_bluehill(folder: Path) -> None:
    head = (
        '"Results Table 1"\n,"Maximum Load","Modulus"\n,"(N)","(MPa)"\n1,"7.512","0.84"\n\n'
        '"Test speed","5.00","mm/min"\n"Specimen label","A-17"\n\n"Time","Extension","Load"\n"(s)","(mm)","(kN)"\n'
    )
    rows = lines('"{:.4f}","{:.4f}","{:.7f}"', TIME_S, WAY_MM, FORCE_N / 1e3)
    (folder / "Specimen_RawData_1.csv").write_text(head + rows)
    session = came_in(folder)
    check(session)
    assert session.recording("Specimen_RawData_1").metadata["source"]["Specimen label"] == "A-17"


def test_instron_with_thousands_in_quotes(folder: Path) -> None:
    rows = lines('"{:.2f}","{:,.4f}","{:,.1f}"', TIME_S, WAY_MM * 1e3, FORCE_N * 1e3)
    (folder / "a.csv").write_text("\nTime,Displacement,Force\n(s),(um),(mN)\n" + rows)
    check(came_in(folder), abs_N=1e-3)


def test_zwick_test_expert_in_german(folder: Path) -> None:
    book = openpyxl.Workbook()
    for title, rows in (
        ("Parameter", [["Prüfer", "Meier"], ["Vorkraft", 0.1, "N"]]),
        ("Ergebnisse", [["Nr", "Fmax"], ["", "N"], [1, 7.5]]),
    ):
        sheet = book.create_sheet(title)
        for row in rows:
            sheet.append(row)
    for number in (1, 2, 3):
        sheet = book.create_sheet(f"Probe {number}")
        for row in ([f"Probe {number}"], ["Prüfzeit", "Standardweg", "Standardkraft"], ["s", "µm", "N"]):
            sheet.append(row)
        for time_s, way_mm, force_N in ROWS:
            sheet.append([float(time_s), float(way_mm) * 1e3, float(force_N) + number * 1e-6])
    book.save(folder / "Serie.xlsx")
    session = came_in(folder)
    assert [trial.name for trial in session.trials] == ["Serie-Probe_1", "Serie-Probe_2", "Serie-Probe_3"]
    check(session)


def test_zwick_text_in_latin_1(folder: Path) -> None:
    head = '"Prüfprotokoll"\r\n"Prüfer";"Müller"\r\n"Prüfzeit";"Traversenweg";"Kraft"\r\n"s";"mm";"N"\r\n'
    rows = lines("{:.3f};{:.5f};{:.5f}", TIME_S, WAY_MM, FORCE_N).replace(".", ",").replace("\n", "\r\n")
    (folder / "a.TRA").write_bytes((head + rows).encode("cp1252"))
    check(came_in(folder))


def test_a_texture_analyser_presses_in_grams(folder: Path) -> None:
    rows = lines("{:.3f}\t{:.4f}\t{:.3f}", FORCE_N / 9.80665e-3, WAY_MM, TIME_S)
    (folder / "ham_01.tab").write_text("Force\tDistance\tTime\n(g)\t(mm)\t(sec)\n" + rows)
    check(came_in(folder))


def test_texture_analyser_with_tests_side_by_side(folder: Path) -> None:
    frame = pd.DataFrame(np.hstack([np.stack([FORCE_N + n * 1e-6, WAY_MM, TIME_S], axis=1) for n in range(3)]))
    names, units = "Force,Distance,Time," * 3, "N,mm,s," * 3
    (folder / "all.csv").write_text(f"{names[:-1]}\n{units[:-1]}\n{frame.to_csv(header=False, index=False)}")
    session = came_in(folder)
    assert len(session.trials) == 3
    check(session)


def test_mts_test_suite(folder: Path) -> None:
    head = (
        "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\n\nData Header:\t\t\tTime:\t12.0269\tSec\t3/4/2021 10:11:12 AM\n"
        "Data Acquisition:\tTimed Data\nStation Name:\tframe 4.cfg\n"
        "Running Time\tAxial Displacement\tAxial Force\nSec\tmm\tkN\n"
    )
    (folder / "specimen.dat").write_text(head + lines("{:.5f}\t{:.6f}\t{:.8f}", TIME_S + 7, WAY_MM, FORCE_N / 1e3))
    check(came_in(folder))


@pytest.mark.parametrize("column", [True, False])
def test_labview_measurement_file(folder: Path, column: bool) -> None:
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
        f"Multi_Headings\tNo\nX_Columns\t{'One' if column else 'No'}\nTime_Pref\tAbsolute\nOperator\tlab\n"
        "Date\t2021/03/04\nTime\t10:11:12.1234567\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
        f"Samples\t{COUNT}\t{COUNT}\t\nDate\t2021/03/04\t2021/03/04\t\nTime\t10:11:12.12\t10:11:12.12\t\n"
        "Y_Unit_Label\tmm\tN\t\nX_Dimension\tTime\tTime\t\nX0\t0.0E+0\t0.0E+0\t\nDelta_X\t0.020000\t0.020000\t\n"
        "***End_of_Header***\t\t\t\nX_Value\tPosition\tForce\tComment\n"
    )
    rows = lines("{:.6f}\t{:.6f}\t{:.6f}", TIME_S, WAY_MM, FORCE_N)
    bare = "\n".join(row if column else "\t" + row.split("\t", 1)[1] for row in rows.splitlines()) + "\n"
    (folder / "run.lvm").write_text(head + bare)
    check(came_in(folder))


def test_a_dataq_logger_states_its_rate_above(folder: Path) -> None:
    head = "C:\\DATAQ\\press.wdq\nSample Rate = 50 Hz\nChannel 1,Channel 2\nForce,Stroke\nN,mm\n"
    (folder / "press.csv").write_text(head + lines("{:.5f},{:.5f}", FORCE_N, WAY_MM))
    check(came_in(folder))


def test_an_ati_transducer_beside_a_robot(folder: Path) -> None:
    fx, fy = 0.1 * np.sin(TIME_S), 0.1 * np.cos(TIME_S)
    head = (
        '"Start Date:","3/4/2021"\n"Sample Frequency:","50"\n"Force Units:","N"\n'
        "Status (hex),RDT Sequence,F/T Sequence,Fx,Fy,Fz,Tx,Ty,Tz,Time\n"
    )
    for number in (1, 2):
        body = "".join(
            f"0,{row},{row * 8},{fx[row]:.5f},{fy[row]:.5f},{force_N + number * 1e-5:.5f},0,0,0,{time_s:.3f}\n"
            for row, (time_s, _, force_N) in enumerate(ROWS)
        )
        (folder / f"p0{number}_ft.csv").write_text(head + body)
        (folder / f"p0{number}_robot.csv").write_text("t_s,x_mm\n" + lines("{:.3f},{:.5f}", TIME_S, WAY_MM))
    session = came_in(folder, "N")
    assert [trial.name for trial in session.trials] == ["p01", "p02"]
    check(session)


def test_a_ros_bag_as_csv_counts_nanoseconds(folder: Path) -> None:
    frame = pd.DataFrame(
        {
            "%time": 1_614_852_672_000_000_000 + (TIME_S * 1e9).round().astype(np.int64),
            "field.header.seq": np.arange(COUNT),
            "field.header.frame_id": "tool0",
            "field.wrench.force.z": FORCE_N,
            "field.pose.position.z": WAY_MM / 1e3,
        }
    )
    frame.to_csv(folder / "bag.csv", index=False)
    check(came_in(folder, "N", "m"))


def test_mcap_of_nested_json(folder: Path) -> None:
    with (folder / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/press", "json", 0)
        for time_s, way_mm, force_N in ROWS:
            body = {"wrench": {"force": {"z_N": force_N}}, "position_mm": way_mm}
            writer.add_message(channel, round(time_s * 1e9), json.dumps(body).encode(), round(time_s * 1e9))
        writer.finish()
    check(came_in(folder))


VECTOR = "float64 x\nfloat64 y\nfloat64 z\n"
HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
PARTS = {"geometry_msgs/Vector3": VECTOR, "geometry_msgs/Point": VECTOR, "std_msgs/Header": HEADER}
PARTS |= {"builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n"}
PARTS |= {"geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n"}


def definition(text: str) -> str:
    """A message with the definitions of its parts, as ROS 2 stores it."""
    return text + "".join(f"{'=' * 80}\nMSG: {name}\n{part}" for name, part in PARTS.items())


def test_a_bag_of_ros_2_with_a_topic_a_channel(folder: Path) -> None:
    with (folder / "bag.mcap").open("wb") as file:
        writer = RosWriter(file)
        wrench = writer.register_msgdef(
            "geometry_msgs/msg/WrenchStamped", definition("std_msgs/Header header\ngeometry_msgs/Wrench wrench\n")
        )
        point = writer.register_msgdef(
            "geometry_msgs/msg/PointStamped", definition("std_msgs/Header header\ngeometry_msgs/Point position\n")
        )
        still = {"x": 0.0, "y": 0.0, "z": 0.0}
        for time_s, way_mm, force_N in ROWS:
            header = {"stamp": {"sec": int(time_s), "nanosec": round(time_s % 1 * 1e9)}, "frame_id": "tool"}
            torque = {"x": 0.01 * time_s, "y": 0.0, "z": 0.0}
            body = {"header": header, "wrench": {"force": {**still, "z": force_N}, "torque": torque}}
            writer.write_message("/ft", wrench, body, round(time_s * 1e9), round(time_s * 1e9))
            body = {"header": header, "position": {**still, "z": way_mm / 1e3}}
            writer.write_message("/tip", point, body, round(time_s * 1e9), round(time_s * 1e9))
        writer.finish()
    check(came_in(folder), "bag")


def test_optotrak_beside_a_force_file_of_its_own_rate(folder: Path) -> None:
    head = f"Number of frames:\t{COUNT}\nNumber of markers:\t1\nCollection Frequency:\t50\nUnits:\tmm\n\n"
    (folder / "trial3_markers.txt").write_text(
        head + "Frame\tMarker_1 z (mm)\n" + lines("{:.0f}\t{:.6f}", np.arange(1, COUNT + 1), WAY_MM)
    )
    (folder / "trial3_force.txt").write_text("Time (s)\tForce (N)\n" + lines("{:.3f}\t{:.5f}", TIME_S, FORCE_N))
    check(came_in(folder), "trial3")


def test_struct_arrays_of_matlab(folder: Path) -> None:
    kind = np.dtype([("specimen", object), ("time_s", object), ("load_N", object), ("disp_mm", object)])
    trials = np.array([(f"S{n}", TIME_S, FORCE_N + n * 1e-6, WAY_MM) for n in (1, 2)], kind)
    scipy.io.savemat(folder / "study.mat", {"study": {"trials": trials, "operator": "AB"}})
    session = came_in(folder)
    assert len(session.trials) == 2
    check(session)


def test_hdf5_with_a_group_a_trial(folder: Path) -> None:
    with h5py.File(folder / "study.h5", "w") as file:
        for number in range(3):
            group = file.create_group(f"session/trial_{number:03d}")
            for name, values, unit in (
                ("time", TIME_S * 1e3, "ms"),
                ("Fz", FORCE_N, "N"),
                ("depth", WAY_MM / 10, "cm"),
            ):
                group.create_dataset(name, data=values + (number * 1e-6 if name == "Fz" else 0)).attrs["Units"] = unit
    session = came_in(folder)
    assert len(session.trials) == 3
    check(session)


def test_hdf5_as_one_array_with_named_columns(folder: Path) -> None:
    with h5py.File(folder / "daq.hdf5", "w") as file:
        data = file.create_dataset("data", data=np.stack([FORCE_N, WAY_MM], axis=1))
        data.attrs["channel_names"], data.attrs["units"] = ["Load cell", "Displacement"], ["N", "mm"]
        data.attrs["sample_rate"] = 50.0
    check(came_in(folder))


def test_parquet_with_time_stamps(folder: Path) -> None:
    start = np.datetime64("2021-03-04T10:11:12", "us")
    stamps = start + (TIME_S * 1e6).round().astype("timedelta64[us]")
    pq.write_table(pa.table({"timestamp": stamps, "force_N": FORCE_N, "pos_um": WAY_MM * 1e3}), folder / "a.parquet")
    check(came_in(folder))


def test_shimadzu_in_shift_jis(folder: Path) -> None:
    head = '"試験日","2021/03/04"\n"時間","試験力","ストローク"\n"sec","N","mm"\n'
    (folder / "a.csv").write_bytes((head + lines("{:.3f},{:.5f},{:.5f}", TIME_S, FORCE_N, WAY_MM)).encode("shift_jis"))
    check(came_in(folder))


def test_a_chinese_machine_with_units_in_wide_brackets(folder: Path) -> None:
    head = "试验员,李\n时间（秒）,试验力（牛）,横梁位移（毫米）\n"
    (folder / "a.csv").write_bytes((head + lines("{:.3f},{:.5f},{:.5f}", TIME_S, FORCE_N, WAY_MM)).encode("gbk"))
    check(came_in(folder))


@pytest.mark.parametrize("form", ["%d.%m.%Y %H:%M:%S,%f", "%m/%d/%Y %I:%M:%S.%f %p", "%H:%M:%S.%f"])
def test_a_spreadsheet_saved_as_text_has_dates(folder: Path, form: str) -> None:
    start = datetime(2021, 3, 14, 15, 9, 26, 500)
    stamps = [(start + timedelta(seconds=time_s)).strftime(form) for time_s in TIME_S]
    rows = "".join(f"{stamp};{way:.5f};{force:.5f}\n" for stamp, (_, way, force) in zip(stamps, ROWS, strict=True))
    (folder / "log.csv").write_text("Zeit;Weg [mm];Kraft [N]\n" + rows)
    check(came_in(folder))


def test_numpy_text_between_blanks(folder: Path) -> None:
    np.savetxt(
        folder / "a.txt", np.stack([TIME_S, FORCE_N, WAY_MM], axis=1), "%12.5f", header="time_s force_N depth_mm"
    )
    check(came_in(folder))


def test_columns_nobody_named(folder: Path) -> None:
    np.savetxt(folder / "a.dat", np.stack([TIME_S, FORCE_N, WAY_MM], axis=1), "%.6f")
    check(came_in(folder, "2 N", "3 mm"))


def test_a_table_with_everything_below_each_other(folder: Path) -> None:
    frames = [
        pd.DataFrame(
            {
                "Subject": subject, "Operator": "AB", "Temperature (C)": 21.5, "Speed": speed, "Time [s]": TIME_S,
                "Force [N]": FORCE_N + 1e-6 * (speed + number), "Depth [mm]": WAY_MM,
            }
        )
        for number, subject in enumerate(("P1", "P2")) for speed in (1, 5)
    ]  # fmt: skip
    pd.concat(frames).to_csv(folder / "all.csv", index=False)
    session = came_in(folder)
    assert [trial.name for trial in session.trials] == ["P1-1", "P1-5", "P2-1", "P2-5"]
    check(session)
    labels = session.recording(session.trials[0].name).metadata["labels"]
    assert (labels["subject"], labels["specimen"], labels["operator"], labels["speed"]) == ("P1", "P1", "AB", "1")


def test_a_sheet_a_channel(folder: Path) -> None:
    book = openpyxl.Workbook()
    for title, values in (("Force (N)", FORCE_N), ("Position (mm)", WAY_MM)):
        sheet = book.create_sheet(title)
        sheet.append(["Time [s]", "Value"])
        for row in zip(TIME_S, values, strict=True):
            sheet.append([float(value) for value in row])
    book.save(folder / "a.xlsx")
    check(came_in(folder), "a")


def test_a_group_a_channel_in_hdf5(folder: Path) -> None:
    with h5py.File(folder / "a.h5", "w") as file:
        for trial in (1, 2):
            for name, values, unit in (("force", FORCE_N + 1e-6 * trial, "N"), ("position", WAY_MM, "mm")):
                group = file.create_group(f"trial_{trial}/{name}")
                group["time"] = TIME_S
                group["time"].attrs["units"] = "s"
                group.create_dataset("data", data=values).attrs["units"] = unit
    session = came_in(folder)
    assert [trial.name for trial in session.trials] == ["a-trial_1", "a-trial_2"]
    check(session)


def test_a_file_a_channel_in_folders(folder: Path) -> None:
    for trial in (1, 2):
        (folder / f"trial_{trial}").mkdir()
        for name, values in (("force_N", FORCE_N + 1e-6 * trial), ("encoder_mm", WAY_MM)):
            frame = pd.DataFrame({"time_s": TIME_S, name: values})
            frame.to_csv(folder / f"trial_{trial}" / f"{name.split('_')[0]}.csv", index=False)
    session = came_in(folder)
    assert [trial.name for trial in session.trials] == ["trial_1", "trial_2"]
    check(session)


def test_two_loggers_that_do_not_begin_together_have_clocks_of_their_own(folder: Path) -> None:
    for name, values, shift_s in (("force_N", FORCE_N, 0.0), ("position_mm", WAY_MM, 33.0)):
        frame = pd.DataFrame({"time_s": TIME_S * (1 + shift_s) + shift_s, name: values})
        frame.to_csv(folder / f"a_{name}.csv", index=False)
    proposal = propose(folder)
    assert [table.get("clock") for table in proposal.tree["tables"]] == [None, "own"]
    assert any("each is taken as a clock of its own" in doubt for doubt in proposal.doubts)


def test_a_table_that_begins_in_the_middle_of_a_sheet(folder: Path) -> None:
    book = openpyxl.Workbook()
    sheet = book["Sheet"]
    sheet["B2"], sheet["H7"] = "Test of Monday", "slipped here"
    for at, row in enumerate([("Time (s)", "Load (N)", "Disp (mm)"), *ROWS]):
        for number, value in enumerate((row[0], row[1], row[2]) if at == 0 else (row[0], row[2], row[1])):
            sheet.cell(5 + at, 2 + number, value if at == 0 else float(value))
    book.save(folder / "a.xlsx")
    check(came_in(folder))


def test_specimens_side_by_side_end_at_rows_of_their_own(folder: Path) -> None:
    rows = "".join(
        f"{time_s},{force_N},{way_mm}," + (f"{time_s},{force_N + 1e-5},{way_mm}\n" if row < 40 else ",,\n")
        for row, (time_s, way_mm, force_N) in enumerate(ROWS)
    )
    (folder / "a.csv").write_text("Time,Load,Extension,Time,Load,Extension\ns,N,mm,s,N,mm\n" + rows)
    session = came_in(folder)
    check(session, "a-1")
    assert session.recording("a-2").tables["force"]["fz_N"] == pytest.approx(FORCE_N[:40], abs=1e-4)


def test_signals_of_simulink(folder: Path) -> None:
    signals = {
        name: {"signals": {"values": values, "label": name}} for name, values in (("F_N", FORCE_N), ("x_mm", WAY_MM))
    }
    scipy.io.savemat(folder / "a.mat", {"out": {"time": TIME_S, "force": signals["F_N"], "position": signals["x_mm"]}})
    check(came_in(folder, "N", "mm"))


def test_struct_arrays_of_matlab_7_3(folder: Path) -> None:
    with h5py.File(folder / "a.mat", "w", userblock_size=512) as file:
        trials, kept = file.create_group("trials"), file.create_group("#refs#")
        for name, values in (("time_s", TIME_S), ("force_N", FORCE_N), ("pos_mm", WAY_MM)):
            field = trials.create_dataset(name, (2, 1), dtype=h5py.ref_dtype)
            for number in range(2):
                data = kept.create_dataset(
                    f"{name}{number}", data=values.reshape(1, -1) + number * 1e-6 * (name == "force_N")
                )
                data.attrs["MATLAB_class"] = np.bytes_("double")
                field[number, 0] = data.ref
    with (folder / "a.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    session = came_in(folder)
    assert len(session.trials) == 2
    check(session)


def test_vectors_of_a_robot_are_directions_and_no_recordings(folder: Path) -> None:
    names = [f"actual_TCP_{kind}_{number}" for kind in ("pose", "force") for number in range(6)]
    values = np.zeros((COUNT, 12))
    values[:, 2], values[:, 3], values[:, 8], values[:, 9] = WAY_MM / 1e3, 1e-6 * TIME_S, FORCE_N, 0.1 * TIME_S
    frame = pd.DataFrame(values, columns=names)
    frame.insert(0, "timestamp", 100 + TIME_S)
    frame.to_csv(folder / "a.txt", sep=" ", index=False)
    check(came_in(folder, "N", "m"))
