"""Files as instruments and loggers write them, each holding one press; of several recordings with forces of their own.

Laid out by the manuals and published examples of the makers, with numbers of our own.
"""

import gzip
import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import openpyxl
from numpy.typing import NDArray

from tests.rig.intake.test_foreign import COUNT, FORCE_N, ROWS, TIME_S, WAY_MM, lines

Write = Callable[[Path], None]
OTHER_N = FORCE_N + 1e-5
NUMBER = np.arange(1, COUNT + 1)
LBF_N, GRAM_N, INCH_MM = 4.4482216152605, 9.80665e-3, 25.4
PRESS = lines("{:.3f},{:.5f},{:.5f}", TIME_S, WAY_MM, FORCE_N)
OTHER = lines("{:.3f},{:.5f},{:.5f}", TIME_S, WAY_MM, OTHER_N)


def comma(text: str) -> str:
    """With decimal commas."""
    return text.replace(".", ",")


def text(head: str, rows: str = PRESS, name: str = "a.csv", encoding: str = "utf-8") -> Write:
    """A file of a head and rows."""

    def write(folder: Path) -> None:
        (folder / name).write_text(head + rows, encoding=encoding)

    return write


def book(*rows: Sequence[object], title: str = "Sheet") -> Write:
    """A workbook of one sheet."""

    def write(folder: Path) -> None:
        made = openpyxl.Workbook()
        made["Sheet"].title = title
        for row in rows:
            made[title].append(row)
        made.save(folder / "a.xlsx")

    return write


def wide(head: str, form: str = "{:.3f},{:.5f},{:.5f},{:.5f},{:.5f}", one_N: float = 1.0) -> Write:
    """Two specimens beside each other under one time, or under none."""
    columns = (FORCE_N / one_N, WAY_MM, OTHER_N / one_N, WAY_MM)
    return text(head + "\n", lines(form, *((TIME_S, *columns) if form.count("{") == 5 else columns)))


def across(name: str, values: NDArray[np.floating], sign: str = ",") -> str:
    """One line of a table that lies across."""
    return name + sign + sign.join(f"{value:.5f}" for value in values) + "\n"


def of_day(start_s: float, form: str) -> str:
    """Rows under times of day."""
    rows = []
    for time_s, way_mm, force_N in ROWS:
        minutes, seconds = divmod(start_s + time_s, 60)
        rows.append(form.format(int(minutes) // 60, int(minutes) % 60, seconds, way_mm, force_N))
    return "\n".join(rows) + "\n"


def numbers(time_s: float, way_mm: float, force_N: float) -> list[float]:
    """One row of a sheet."""
    return [float(time_s), float(way_mm), float(force_N)]


def blocks(number: int) -> list[Sequence[object]]:
    """One of the tables below each other in a sheet."""
    rows = [numbers(time_s, way_mm, force_N + 1e-5 * number) for time_s, way_mm, force_N in ROWS]
    return [[f"Specimen {number}"], ["Time", "Position", "Force"], ["s", "mm", "N"], *rows, []]


NS = np.round((TIME_S + 0.9) * 1e9).astype(np.int64)
SECONDS, REST_NS = 1_700_000_000 + NS // 10**9, NS % 10**9
MS, US = np.round(TIME_S * 1e3).astype(np.int64), np.round(TIME_S * 1e6).astype(np.int64)
OF_DAY = "{:02d}:{:02d}:{:06.3f},{:.5f},{:.5f}"
ISO = "2021-04-03 {:02d}:{:02d}:{:06.3f}+02:00,{:.5f},{:.5f}"
PIUMA = (
    "Date\t01/02/2021\nTime\t10:11:12\nStatus\tExperiment executed correctly\nTip radius (um)\t50.0\nk (N/m)\t0.5\n"
    "Control mode:\tDisplacement\nD[Z1] (nm)\t0\tt[1] (s)\t2.0\n\n"
    "Time (s)\tLoad (uN)\tIndentation (nm)\tCantilever (nm)\tPiezo (nm)\tAuxiliary\n"
)
DASYLAB = (
    "DASYLab - V 11.00\nArbeitsblatt: press\nAufnahmedatum: 03.04.2021\nBlocklänge: 1\nDelta: 0,02 sec.\n"
    "Anzahl Kanäle: 2\nMesszeit[hh:mm:ss];Weg[mm];Kraft[N]\n"
)
CATMAN = (
    "HBM_CATMAN_DATAFILE\nT0 = 03.04.2021 10:11:12\ndt = 20 ms\n"
    "Time  1 - default sample rate [s]\tWay [mm]\tForce [N]\n"
)
KEYENCE = "NR-600\nTitle,press\n,CH1,CH2\nComment,Displacement,Force\nUnit,mm,N\nDate Time,(1)HA-V08-1,(1)HA-V08-2\n"
HYSITRON = f"\n\nNumber of Points = {COUNT}\n\nDepth (nm)\tLoad (µN)\tTime (s)\tDepth (V)\tLoad (V)\n"
NANO = lines("{:.2f}\t{:.2f}\t{:.3f}\t{:.5f}\t{:.5f}", WAY_MM * 1e6, FORCE_N * 1e6, TIME_S, WAY_MM / 10, FORCE_N / 10)
STAMPED = "header.stamp.sec,header.stamp.nanosec,header.frame_id,wrench.force.x,wrench.force.z,position_mm\n"
BIAXIAL = "Time_S,XSize_um,YSize_um,XDisplacement_um,YDisplacement_um,XForce_mN,YForce_mN,Temperature_C,SetName,Cycle\n"
SIDE = "Probe 1\t\t\tProbe 2\t\t\nPrüfzeit\tStandardweg\tStandardkraft\tPrüfzeit\tStandardweg\tStandardkraft\n"
RTDE = "timestamp actual_TCP_pose_0 actual_TCP_pose_2 actual_TCP_force_0 actual_TCP_force_2\n"
PRESSED = [numbers(*row) for row in ROWS]
SHEET_SIDE = [[time_s, way_mm, force_N, time_s, way_mm, force_N + 1e-5] for time_s, way_mm, force_N in PRESSED]


def plain_json(time_s: float, way_mm: float, force_N: float) -> str:
    """A line of a logger that writes JSON."""
    return json.dumps({"t_s": round(float(time_s), 3), "force_N": float(force_N), "position_mm": float(way_mm)})


def nested_json(time_s: float, way_mm: float, force_N: float) -> str:
    """A line with vectors in it."""
    force = {"x": 0.0, "y": 0.0, "z": float(force_N)}
    return json.dumps({"stamp": round(float(time_s), 3), "force": force, "tcp": {"position_mm": float(way_mm)}})


def compressed(folder: Path) -> None:
    """A text behind gzip."""
    with gzip.open(folder / "a.csv.gz", "wt") as file:
        file.write("Time (s),Position (mm),Force (N)\n" + PRESS)


# By what they are: how they are written, how many recordings they hold, and what is answered where a unit is asked.
FORMS: dict[str, tuple[Write, int, tuple[str, ...]]] = {
    "Bluehill, specimens below each other": (
        text(
            '"Method","x.im_tens"\n\n"Specimen 1"\n"Time","Extension","Load"\n"(s)","(mm)","(N)"\n',
            PRESS + '\n"Specimen 2"\n"Time","Extension","Load"\n"(s)","(mm)","(N)"\n' + OTHER,
        ), 2, ()),
    "Bluehill, European": (
        text("Time;Extension;Load\n(s);(mm);(N)\n",
             comma(lines('"{:.3f}";"{:.5f}";"{:.5f}"', TIME_S, WAY_MM, FORCE_N))), 1, ()),
    "testXpert, specimens beside each other": (
        text(SIDE + "s\tmm\tN\ts\tmm\tN\n",
             comma(lines("\t".join(["{:.5f}"] * 6), TIME_S, WAY_MM, FORCE_N, TIME_S, WAY_MM, OTHER_N)),
             "a.txt", "latin-1"), 2, ()),
    "testXpert, workbook with specimens beside each other": (
        book(["Probe 1", None, None, "Probe 2"], ["Prüfzeit", "Weg", "Kraft"] * 2, ["s", "mm", "N"] * 2, *SHEET_SIDE),
        2, ()),
    "texture analyser, columns numbered": (
        wide("Time (sec),Force 1 (g),Distance 1 (mm),Force 2 (g),Distance 2 (mm)", one_N=GRAM_N), 2, ()),
    "wide, numbers before units": (wide("time_s,force1_N,depth1_mm,force2_N,depth2_mm"), 2, ()),
    "wide, letters": (wide("Time (s),Force A (N),Depth A (mm),Force B (N),Depth B (mm)"), 2, ()),
    "wide, specimens first": (wide("Time (s),S1 Force (N),S1 Depth (mm),S2 Force (N),S2 Depth (mm)"), 2, ()),
    "wide, without time": (
        wide("Sample rate (Hz),50\nforce1 [N],depth1 [mm],force2 [N],depth2 [mm]", "{:.5f},{:.5f},{:.5f},{:.5f}"),
        2, ()),
    "wide, specimens named above": (
        book([None, "Sample A", None, "Sample B"], ["Time (s)", *["Force (N)", "Depth (mm)"] * 2],
             *([time_s, force_N, way_mm, other_N, way_mm] for time_s, way_mm, force_N, _, _, other_N in SHEET_SIDE)),
        2, ()),
    "TestWorks, runs below each other": (
        text("Sample ID:\tgel\n\nRun 1\nTime\tCrosshead\tLoad\ns\tmm\tN\n",
             (PRESS + "\n\nRun 2\nTime,Crosshead,Load\ns,mm,N\n" + OTHER).replace(",", "\t"), "a.txt"), 2, ()),
    "sheet with specimens below each other": (book(*blocks(0), *blocks(1)), 2, ()),
    "TestWorks Elite": (text("_Time,_Extension,_Load\n(s),(mm),(N)\n", name="DAQ- Crosshead.txt"), 1, ()),
    "UniVert": (
        text("SetName,Cycle-SetName,Time (S),Size (mm),Displacement (mm),Force (N)\n",
             "".join(f"Compress-1,1-{'Compress' if row < 30 else 'Recover'},{at:.2f},10,{way_mm:.5f},{force_N:.5f}\n"
                     for row, (at, way_mm, force_N) in enumerate(ROWS))), 1, ()),
    "BioTester": (
        text(BIAXIAL, lines("{:.2f},9e3,9e3,{:.3f},0.1,{:.4f},0.1,37,Stretch,1", TIME_S, WAY_MM * 1e3, FORCE_N * 1e3)),
        1, ()),
    "MicroSquisher": (
        text("Time (S)\tTip Displacement (um)\tBase Displacement (um)\tForce (uN)\n",
             lines("{:.2f}\t{:.3f}\t{:.3f}\t{:.2f}", TIME_S, WAY_MM * 1e3, WAY_MM * 1e3 + 5, FORCE_N * 1e6), "a.txt"),
        1, ()),
    "Mark-10": (
        text("MESURgauge\nReading [No],Load [lbF],Travel [in],Time [sec]\n",
             lines("{:.0f},{:.7f},{:.7f},{:.3f}", NUMBER, FORCE_N / LBF_N, WAY_MM / INCH_MM, TIME_S)), 1, ()),
    "Imada, units of other columns above": (
        text("Model,ZTA-50N\nUnit,N,mm\nNo.,Time(s),Force(N),Displacement(mm)\n",
             lines("{:.0f},{:.3f},{:.5f},{:.5f}", NUMBER, TIME_S, FORCE_N, WAY_MM)), 1, ()),
    "Tinius Olsen": (
        text('"Test Name","c1"\n"Date","3/4/2021"\n\n"Force","Position","Time"\n"N","mm","sec"\n',
             lines('"{:.5f}","{:.5f}","{:.3f}"', FORCE_N, WAY_MM, TIME_S)), 1, ()),
    "TriboIndenter": (text(HYSITRON, NANO, "a.txt", "latin-1"), 1, ()),
    "Piuma": (
        text(PIUMA, lines("{:.3f}\t{:.4f}\t{:.3f}\t{:.3f}\t{:.3f}\t0", TIME_S, FORCE_N * 1e6, WAY_MM * 1e6,
                          FORCE_N * 1e3, WAY_MM * 1e6 + FORCE_N * 1e3), "a S-1 X-1 Y-1 I-1.txt"), 1, ()),
    "NanoSuite": (
        book(["Segment", "Displacement Into Surface", "Load On Sample", "Time On Sample", "Harmonic Contact Stiffness"],
             ["", "nm", "mN", "s", "N/m"],
             *(["", way_mm * 1e6, force_N * 1e3, time_s, 1.0 + time_s] for time_s, way_mm, force_N in PRESSED),
             title="Test 001"), 1, ()),
    "milliseconds of 32 bits that begin anew": (
        text("millis_ms,pos_mm,force_N\n",
             lines("{},{:.5f},{:.5f}", (MS + 2**32 - 400) % 2**32, WAY_MM, FORCE_N)), 1, ()),
    "microseconds of 16 bits that begin anew": (
        text("time_us,pos_mm,force_N\n",
             lines("{},{:.5f},{:.5f}", (US + 2**16 - 40) % 2**16, WAY_MM, FORCE_N)), 1, ()),
    "ROS 2, seconds and nanoseconds": (
        text(STAMPED, lines("{},{},tool,0,{:.5f},{:.5f}", SECONDS, REST_NS, FORCE_N, WAY_MM)), 1, ("N",)),
    "ROS 1, seconds and nanoseconds": (
        text("secs,nsecs,force_N,position_mm\n", lines("{},{},{:.5f},{:.5f}", SECONDS, REST_NS, FORCE_N, WAY_MM)),
        1, ()),
    "lines of JSON": (text("", "\n".join(plain_json(*row) for row in ROWS), "a.jsonl"), 1, ()),
    "lines of nested JSON": (text("", "\n".join(nested_json(*row) for row in ROWS), "a.ndjson"), 1, ("N",)),
    "across": (
        text(across("Time (s)", TIME_S) + across("Force (N)", FORCE_N), across("Position (mm)", WAY_MM)), 1, ()),
    "across, units in a column, decimal commas": (
        text(comma(across("Zeit;s", TIME_S, ";") + across("Kraft;N", FORCE_N, ";")),
             comma(across("Weg;mm", WAY_MM, ";"))), 1, ()),
    "across in a workbook": (
        book(["Time (s)", *map(float, TIME_S)], ["Force (N)", *map(float, FORCE_N)],
             ["Position (mm)", *map(float, WAY_MM)]), 1, ()),
    "DASYLab": (text(DASYLAB, comma(of_day(0, "{:02d}:{:02d}:{:06.3f};{:.5f};{:.5f}")), "a.asc", "latin-1"), 1, ()),
    "catman": (text(CATMAN, comma(lines("{:.3f}\t{:.5f}\t{:.5f}", TIME_S, WAY_MM, FORCE_N)), "a.asc"), 1, ()),
    "the separator in the first line": (
        text("sep=;\nTime (s);Position (mm);Force (N)\n",
             comma(lines("{:.3f};{:.5f};{:.5f}", TIME_S, WAY_MM, FORCE_N))), 1, ()),
    "a sign at the end of each row": (
        text("Time (s);Position (mm);Force (N)\n", lines("{:.3f};{:.5f};{:.5f};", TIME_S, WAY_MM, FORCE_N)), 1, ()),
    "comments above, between and below": (
        text("# run 3\n# time_s, position_mm, force_N\n",
             "\n".join([*PRESS.splitlines()[:20], "# paused", *PRESS.splitlines()[20:], "# end", "# max 7.5 N"])),
        1, ()),
    "names below rows of settings": (
        text("1,2,3\n4,5,6\n7,8,9\nSettings,speed,5\nTime (s),Position (mm),Force (N)\n"), 1, ()),
    "gzip": (compressed, 1, ()),
    "hours of twelve over noon": (
        text("Time,Position (mm),Force (N)\n",
             "".join(row.replace(",", " PM," if row.startswith("12") else " AM,", 1)
                     for row in of_day(719 * 60 + 59.5, OF_DAY).splitlines(keepends=True))), 1, ()),
    "a robot, in metres": (
        text(RTDE, lines("{:.3f} 0.1 {:.8f} 0.0 {:.5f}", TIME_S + 1000, WAY_MM / 1e3, FORCE_N)), 1, ("N", "m")),
    "columns of a fixed width": (
        text("     Time  Position     Force\n        s        mm         N\n",
             lines("{:9.3f} {:9.5f} {:9.5f}", TIME_S, WAY_MM, FORCE_N), "a.prn"), 1, ()),
    "Keyence": (text(KEYENCE, of_day(611 * 60 + 12, f"2021/04/03 {OF_DAY}")), 1, ()),
    "ISO with a blank and a zone": (
        text("timestamp,displacement [mm],force [N]\n", of_day(611 * 60 + 12, ISO)), 1, ()),
}  # fmt: skip
