"""Further files as instruments, motion capture and loggers write them, each holding one press; see `instruments`.

Laid out by what the makers publish: the LabVIEW Measurement File specification (NI), ASCII export of Vicon Nexus (a
table of devices and one of trajectories below each other, each with its rate), TRAPEZIUM X of Shimadzu, TestSuite and
Station Manager of MTS, RheoCompass of Anton Paar, TRIOS and WinTest of TA Instruments, LabChart of ADInstruments,
TwinCAT Scope of Beckhoff, annotated CSV of InfluxDB, PicoScope of Pico Technology, the D of Fortran (ISO/IEC 1539-1).
"""

from pathlib import Path

import numpy as np

from tests.rig.intake.instruments import GRAM_N, MS, NUMBER, OTHER_N, Write, comma, text
from tests.rig.intake.test_foreign import FORCE_N, ROWS, TIME_S, WAY_MM, lines

LVM_HEAD = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\t{}\n"
    "X_Columns\t{}\nTime_Pref\tRelative\nDate\t2021/04/03\nTime\t10:11:12.345678\n***End_of_Header***\t\n\t\t\t\t\n"
)
LVM_BLOCK = (
    "Channels\t2\t\t\t\nSamples\t60\t60\t\t\nDate\t2021/04/03\t2021/04/03\t\t\nY_Unit_Label\tNewtons\tmm\t\t\n"
    "X_Dimension\tTime\tTime\t\t\nX0\t0.0000000000000000E+0\t0.0000000000000000E+0\t\t\nDelta_X\t0.020000\t0.020000\t\t\n"
    "***End_of_Header***\t\t\t\t\nX_Value\tForce\tPosition\tComment\n"
)
LVM = lines("{:.6f}\t{:.5f}\t{:.5f}", TIME_S, FORCE_N, WAY_MM)
LVM_OTHER = lines("{:.6f}\t{:.5f}\t{:.5f}", TIME_S, OTHER_N, WAY_MM)
PAAR = (
    "Project:\tgel\nTest:\tcompression 1\n\nResult:\tcompression 1\n\nInterval and data points:\t1\t60\n"
    "Interval data:\tPoint No.\tTime\tGap\tNormal Force\n\t\t\t\t\n\t\t[s]\t[mm]\t[N]\n"
)
PAAR_ROWS = comma(lines("\t{:d}\t{:.3f}\t{:.5f}\t{:.5f}", NUMBER, TIME_S, WAY_MM, FORCE_N))
FLUX = (
    "#group,false,false,false,false,true,true\n#datatype,string,long,dateTime:RFC3339,double,string,string\n"
    "#default,_result,,,,,\n,result,table,_time,_value,_field,_measurement\n"
)
SCOPE = (
    "Name,Force,Name,Position\nData-Type,REAL64,Data-Type,REAL64\nSampleTime[ms],20,SampleTime[ms],20\nUnit,N,Unit,mm\n"
)
PICO = "Time,Force,Position\n(ms),(N),(mm)\n\n"
NEXUS = "Devices\n500\n,,Force Plate - Force,,\nFrame,Sub Frame,Fx,Fy,Fz\n,,N,N,N\n"
NEXUS_PLACES = "\nTrajectories\n50\n,,gel:tip,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n"


def each(form: str) -> str:
    """A row for each value, the force and the way of one time below each other."""
    values = [(t, *own) for t, w, f in ROWS for own in (("force", "N", f), ("position", "mm", w))]
    return "".join(form.format(t=t, name=name, unit=unit, value=value) for t, name, unit, value in values)


def in_blocks(form: str) -> str:
    """A row for each value, all forces above all ways."""
    forces = "".join(form.format(t=t, stamp=12 + t, n=0, name="force_N", value=force) for t, _, force in ROWS)
    return forces + "".join(form.format(t=t, stamp=12 + t, n=1, name="position_mm", value=way) for t, way, _ in ROWS)


def double(value: float) -> str:
    """As Fortran writes a number of double precision."""
    return f"{value:.6E}".replace("E", "D")


def vicon(folder: Path) -> None:
    """Forces at 500 Hz, and below them the places of a marker at 50 Hz."""
    forces = "".join(
        f"{1 + row // 10},{row % 10},0,0,{force:.5f}\n" for row, force in enumerate(np.repeat(FORCE_N, 10))
    )
    places = "".join(f"{row + 1},0,10,20,{way_mm:.4f}\n" for row, (_, way_mm, _) in enumerate(ROWS))
    (folder / "a.csv").write_text(NEXUS + forces + NEXUS_PLACES + places)


# By what they are: how they are written, how many recordings they hold, and what is answered where a unit is asked.
LOGGED: dict[str, tuple[Write, int, tuple[str, ...]]] = {
    "LabVIEW, one column of x": (text(LVM_HEAD.format("No", "One") + LVM_BLOCK, LVM, "a.lvm"), 1, ()),
    "LabVIEW, no column of x": (
        text(LVM_HEAD.format("No", "No") + LVM_BLOCK, lines("\t{:.5f}\t{:.5f}", FORCE_N, WAY_MM), "a.lvm"), 1, ()),
    "LabVIEW, two headers": (
        text(LVM_HEAD.format("Yes", "One") + LVM_BLOCK, LVM + "\n" + LVM_BLOCK + LVM_OTHER, "a.lvm"), 2, ()),
    "names with units in a second line of their cells": (
        text('"Force\n(g)","Distance\n(mm)","Time\n(sec)"\n',
             lines("{:.4f},{:.5f},{:.3f}", FORCE_N / GRAM_N, WAY_MM, TIME_S)), 1, ()),
    "names of three lines below a title": (
        text('Report\r\n"Time\r\n(s)";"Standard\r\nforce\r\n(N)";"Position\r\n(mm)"\r\n',
             comma(lines("{:.3f};{:.5f};{:.5f}", TIME_S, FORCE_N, WAY_MM))), 1, ()),
    "names of two lines above a row of units": (
        text('"Test time","Standard\nforce","Standard\ntravel"\n"s","N","mm"\n',
             lines("{:.3f},{:.5f},{:.5f}", TIME_S, FORCE_N, WAY_MM)), 1, ()),
    "rows in brackets": (
        text("Time (s), Fz (N), Position (mm)\n", lines("( {:.3f} , {:.5f} , {:.5f} )", TIME_S, FORCE_N, WAY_MM),
             "a.log"), 1, ()),
    "a monitor's arrow, names and units in the rows": (
        text("", lines("10:11:{:06.3f} -> F={:.5f} N, z={:.5f} mm", 12 + TIME_S, FORCE_N, WAY_MM), "a.log"), 1, ()),
    "a monitor's arrow, names in the first row": (
        text("10:11:11.990 -> force_N,pos_mm\n", lines("10:11:{:06.3f} -> {:.5f},{:.5f}", 12 + TIME_S, FORCE_N, WAY_MM),
             "a.log"), 1, ()),
    "times with a colon before milliseconds": (
        text("Time,Force (N),Position (mm)\n",
             "".join(f"10:11:{int(12 + t):02d}:{round(t % 1 * 1000):03d},{f:.5f},{w:.5f}\n" for t, w, f in ROWS)),
        1, ()),
    "a row for each value": (text("time_s,channel,value\n", each("{t:.3f},{name},{value:.5f}\n")), 1, ("N", "mm")),
    "a row for each value with its unit": (
        text("time_s,channel,value,unit\n", each("{t:.3f},{name},{value:.5f},{unit}\n")), 1, ()),
    "a row for each value, specimens below each other": (
        text("specimen,time_s,channel,value\n",
             "".join(f"{name},{t:.3f},force_N,{f + more:.5f}\n{name},{t:.3f},position_mm,{w:.5f}\n"
                     for name, more in (("A", 0.0), ("B", 1e-5)) for t, w, f in ROWS)), 2, ()),
    "InfluxDB": (
        text(FLUX, in_blocks(",,{n},2021-04-03T10:11:{stamp:06.3f}Z,{value:.5f},{name},rig\n")), 1, ()),
    "Fortran": (
        text("  time_s  position_mm  force_N\n",
             "".join(f"  {double(t)}  {double(w)}  {double(f)}\n" for t, w, f in ROWS), "a.dat"), 1, ()),
    "Fortran in cells": (
        text("time_s,position_mm,force_N\n", "".join(f"{double(t)},{double(w)},{double(f)}\n" for t, w, f in ROWS)),
        1, ()),
    "names parted by semicolons, rows by tabs": (
        text("Zeit [s];Kraft [N];Weg [mm]\n", comma(lines("{:.3f}\t{:.5f}\t{:.5f}", TIME_S, FORCE_N, WAY_MM)), "a.txt"),
        1, ()),
    "names parted by tabs, rows by semicolons": (
        text("Zeit [s]\tKraft [N]\tWeg [mm]\n", comma(lines("{:.3f};{:.5f};{:.5f}", TIME_S, FORCE_N, WAY_MM)), "a.txt"),
        1, ()),
    "PicoScope": (text(PICO, lines("{:.5f},{:.5f},{:.5f}", TIME_S * 1e3 - 600, FORCE_N, WAY_MM)), 1, ()),
    "TRAPEZIUM X": (
        text('"1 _ 1","1 _ 1","1 _ 1","1 _ 2","1 _ 2","1 _ 2"\n"Time","Force","Stroke","Time","Force","Stroke"\n'
             '"sec","N","mm","sec","N","mm"\n',
             lines(",".join(['"{:.5f}"'] * 6), TIME_S, FORCE_N, WAY_MM, TIME_S, OTHER_N, WAY_MM)), 2, ()),
    "Station Manager": (
        text("MTS793|BTW|ENU|1|2|.|/|:|1|0|0|A\n\nData Header:\tTime:\t1.2\tSec\t4/3/2021 10:11:12 AM\n"
             "Station Name:\tx.cfg\nAxial Displacement\tAxial Force\tRunning Time\nmm\tkN\tSec\n",
             lines("{:.6f}\t{:.9f}\t{:.5f}", WAY_MM, FORCE_N / 1e3, TIME_S), "specimen.dat"), 1, ()),
    "RheoCompass": (text(PAAR, PAAR_ROWS, "a.csv", "utf-16"), 1, ()),
    "TRIOS": (
        text("Filename\tx.tri\n[step]\nAxial - 1\nStep time\tGap\tAxial force\tTemperature\ns\tµm\tN\t°C\n",
             lines("{:.4f}\t{:.3f}\t{:.5f}\t25.0", TIME_S, WAY_MM * 1e3, FORCE_N), "a.txt", "latin-1"), 1, ()),
    "WinTest": (
        text("WinTest 7 Data File\nScan,1\nPoints,60\nElapsed Time,Disp,Load,\nSec,mm,N,\n",
             lines("{:.4f},{:.5f},{:.5f},", TIME_S, WAY_MM, FORCE_N)), 1, ()),
    "LabChart": (
        text("Interval=\t0.02 s\nExcelDateTime=\t4.429e+04\t4/3/2021 10:11:12.345\nTimeFormat=\tStartOfBlock\n"
             "ChannelTitle=\tForce\tPosition\nRange=\t10 N\t10.000 mm\n", LVM, "a.txt"), 1, ()),
    "TwinCAT Scope": (text(SCOPE, lines("{:d},{:.5f},{:d},{:.5f}", MS, FORCE_N, MS, WAY_MM)), 1, ()),
    "UTF-16 without a mark": (
        text("Time (s),Force (N),Position (mm)\n", lines("{:.3f},{:.5f},{:.5f}", TIME_S, FORCE_N, WAY_MM),
             encoding="utf-16-le"), 1, ()),
}  # fmt: skip
