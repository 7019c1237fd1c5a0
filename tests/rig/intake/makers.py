"""Files of several tests as the programs of makers write them, with presses of unlike length, depth and stiffness.

Laid out letter by letter by the manuals and published examples: Bluehill (Instron), TestSuite (MTS), testXpert
(ZwickRoell), TRAPEZIUM X (Shimadzu), WinTest (TA Instruments), Mach-1 (Biomomentum), MicroSquisher (CellScale), Piuma
(Optics11), LabChart (ADInstruments), RheoCompass (Anton Paar), DMA Q800 (TA Instruments), Capstone (PASCO), LabVIEW
(NI), data processing of JPK.
"""

from collections.abc import Callable, Iterator
from itertools import zip_longest
from pathlib import Path
from typing import NamedTuple

import numpy as np
import openpyxl
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


class Press(NamedTuple):
    """One recording: what the file was written from, and what it has to come out as."""

    time_s: Numbers
    way_mm: Numbers
    force_N: Numbers

    def times(self, way: float = 1.0, force: float = 1.0) -> "Press":
        """The same with its way and its force so many times as large."""
        return Press(self.time_s, way * self.way_mm, force * self.force_N)


def press(count: int, depth_mm: float, stiffness: float) -> Press:
    """A Hertzian press at 50 Hz through a millimetre of air, with a little of the mains on the force."""
    time_s = np.round(np.arange(count) * 0.02, 4)
    way_mm = np.round(depth_mm * np.sin(np.pi * time_s / time_s[-1]) ** 2, 5)
    force_N = np.round(stiffness * np.maximum(0, way_mm - 1) ** 1.5 + 0.002 * np.sin(37 * time_s), 5)
    return Press(time_s, way_mm, force_N)


A, B, C = press(250, 5.0, 1.3), press(250, 4.0, 0.9), press(200, 3.0, 1.8)


def rows(form: str, *columns: NDArray[np.generic]) -> str:
    """A line for each row."""
    return "".join(form.format(*row) + "\n" for row in zip(*columns, strict=True))


def comma(text: str) -> str:
    """With decimal commas."""
    return text.replace(".", ",")


def side_by_side(form: str, *presses: Press) -> str:
    """Triples beside each other, empty where a recording has ended."""
    cells = [[form.format(*row) for row in zip(*own, strict=True)] for own in presses]
    return "".join(",".join(row) + "\n" for row in zip_longest(*cells, fillvalue=",,"))


def bluehill_below_each_other(folder: Path) -> list[Press]:
    text = '"General: Test type","Compression"\n"Results Table 1"\n,"Maximum load","Modulus"\n,"(N)","(MPa)"\n'
    text += '1,"10.4","0.1"\n2,"5.0","0.05"\n\n'
    for number, own in enumerate((A, C), 1):
        text += f'"Specimen {number}"\n"Time (sec)","Compressive extension (mm)","Compressive load (N)","Strain (%)"\n'
        text += rows('"{:.4f}","{:.5f}","{:.5f}","{:.4f}"', *own, own.way_mm * 10) + "\n"
    (folder / "raw.csv").write_text(text)
    return [A, C]


def bluehill_side_by_side(folder: Path) -> list[Press]:
    head = '"Specimen 1",,,"Specimen 2",,\n' + ",".join(['"Time","Displacement","Force"'] * 2)
    units = ",".join(['"(s)","(mm)","(N)"'] * 2)
    (folder / "raw.csv").write_text(f"{head}\n{units}\n" + side_by_side('"{:.3f}","{:.5f}","{:.5f}"', A, C))
    return [A, C]


def test_suite_cycles(folder: Path) -> list[Press]:
    text = "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\n\n"
    for number, own in enumerate((A, B, C), 1):
        text += f"Data Header:\tCycle {number}\tTime:\t{12.02 + number}\tSec\t3/4/2021 10:11:1{number} AM\n"
        text += (
            "Data Acquisition:\tCyclic Data\nStation Name:\tframe.cfg\nRunning Time\tAxial Displacement\tAxial Force\n"
        )
        text += "Sec\tmm\tN\n" + rows("{:.5f}\t{:.6f}\t{:.6f}", *own) + "\n"
    (folder / "specimen.dat").write_text(text)
    return [A, B, C]


def test_suite_pulls_are_positive(folder: Path) -> list[Press]:
    head = '"Test Run","gel 1"\n"Crosshead ","Load ","Time "\n"mm","N","s"\n'
    (folder / "t.csv").write_text(head + rows('"{:.5f}","{:.5f}","{:.4f}"', -A.way_mm, -A.force_N, A.time_s))
    return [A]


def test_xpert_with_statistics(folder: Path) -> list[Press]:
    book = openpyxl.Workbook()
    sheets: dict[str, list[list[object]]] = {
        "Parameter": [["Prüfnorm", "ISO 604"], ["Vorkraft", 0.1, "N"], ["Prüfgeschwindigkeit", 10, "mm/min"]],
        "Ergebnisse": [["Legende", "Emod", "Fmax", "dL bei Fmax"], ["Nr", "MPa", "N", "mm"]],
        "Statistik": [["Serie", "Emod", "Fmax", "dL bei Fmax"], ["n = 12", "MPa", "N", "mm"], ["x", 0.5, 10, 5.0]],
    }
    sheets["Ergebnisse"] += [[number, 0.5 + number / 100, 10 + number, 5.1] for number in range(1, 13)]
    for number, own in enumerate((A, B, C), 1):
        head: list[list[object]] = [["Prüfzeit", "Standardweg", "Standardkraft", "Werkzeugabstand"]]
        data: list[list[object]] = [[float(t), float(w), float(f), float(30 - w)] for t, w, f in zip(*own, strict=True)]
        sheets[f"Prüfkörper {number}"] = [[f"Prüfkörper {number}"], *head, ["s", "mm", "N", "mm"], *data]
    for title, content in sheets.items():
        sheet = book.create_sheet(title)
        for row in content:
            sheet.append(row)
    book.save(folder / "Serie.xlsx")
    return [A, B, C]


def test_xpert_text(folder: Path) -> list[Press]:
    head = "Prüfvorschrift;Druckversuch\nPrüfer;Müller\n\nPrüfzeit;Verformung;Standardkraft;Nominaldehnung\ns;mm;N;%\n"
    text = head + comma(rows("{:.3f};{:.5f};{:.5f};{:.3f}", *A, A.way_mm * 5))
    (folder / "Probe_01.csv").write_bytes(text.encode("cp1252"))
    return [A]


def trapezium(folder: Path) -> list[Press]:
    head = '"Test Type","Compression"\n"Speed","5mm/min"\n\n"1 _ 1","","","1 _ 2","",""\n'
    head += ",".join(['"Time","Disp.","Force"'] * 2) + "\n" + ",".join(['"sec","mm","N"'] * 2) + "\n"
    (folder / "a.csv").write_text(head + side_by_side('"{:.3f}","{:.5f}","{:.5f}"', A, C))
    return [A, C]


def win_test_scans(folder: Path) -> list[Press]:
    text, found = "WinTest® 7\nTest Name: gel\nSample: 3\n\n", [A, C._replace(time_s=C.time_s + 100)]
    for number, own in enumerate(found, 1):
        text += f"Scan {number}\nPoints,Elapsed Time Sec,Scan Time Sec,Disp mm,Load N\n"
        count = np.arange(1, own.time_s.size + 1)
        text += rows("{:.0f},{:.4f},{:.4f},{:.5f},{:.5f}", count, own.time_s, own.time_s % 100, *own[1:]) + "\n"
    (folder / "w.csv").write_text(text, encoding="cp1252")
    return found


def mach_1(folder: Path) -> list[Press]:
    text = "<Mach-1 File>\n<INFO>\nTest:\tgel\nSensor:\tMA297 1.5N\n<END INFO>\n\n"
    names = "Time, s\tPosition (z), mm\tPosition (x), mm\tFz, N\tFx, N\tFy, N\tTx, N-mm\n"
    for name, own in (("Find Contact", C), ("Stress Relaxation", A), ("Stress Relaxation", B)):
        text += f"<{name}>\nStage Axis:\tVertical\nVelocity, mm/s:\t0.5\nTime, s:\t10\n<DATA>\n{names}"
        text += rows("{:.5f}\t{:.5f}\t1.0\t{:.5f}\t0.001\t0.002\t0.1", *own) + f"<END DATA>\n<END {name}>\n\n"
    (folder / "gel.txt").write_text(text)
    return [C, A, B]


def micro_squisher(folder: Path) -> list[Press]:
    head = "SetName,Cycle,Time (S),Displacement (um),Force (uN),Temperature (C)\n"
    data = rows("Indent-1,1-Compress,{:.2f},{:.3f},{:.2f},37.0", *A.times(1e3, 1e6))
    (folder / "Test1Data.csv").write_text(head + data)
    return [A]


def piuma(folder: Path) -> list[Press]:
    for number, own in enumerate((A, C), 1):
        head = f"Date\t01/02/2021\nX-position (um)\t{number * 50}\nTip radius (um)\t50.0\nk (N/m)\t0.5\n"
        head += "Control mode:\tDisplacement\nD[Z1] (nm)\t0\tt[1] (s)\t2.0\nE[eff] (Pa)\t1200\n\n"
        head += "Time (s)\tIndentation (nm)\tLoad (uN)\tCantilever (nm)\tPiezo (nm)\tAuxiliary\n"
        data = rows("{:.3f}\t{:.3f}\t{:.4f}\t{:.3f}\t{:.3f}\t0", *own, own.force_N * 2, own.way_mm + own.force_N)
        (folder / f"gel S-1 X-{number} Y-1 I-1.txt").write_text(head + data)
    return [own.times(1e-6, 1e-6) for own in (A, C)]


def rheo_compass(folder: Path) -> list[Press]:
    text = "Project:\tgel\n"
    for number, own in enumerate((A, C), 1):
        count = np.arange(1, own.time_s.size + 1)
        text += (
            f"Test:\tSqueeze {number}\n\nResult:\tSqueeze {number} 1\n\nInterval and data points:\t1\t{count.size}\n"
        )
        text += "Interval data:\tPoint No.\tTime\tGap\tNormal Force\n\t\t\t\t\n\t\t[s]\t[mm]\t[N]\n"
        text += comma(rows("\t{:.0f}\t{:.3f}\t{:.5f}\t{:.5f}", count, own.time_s, 20 - own.way_mm, own.force_N)) + "\n"
    (folder / "r.csv").write_text(text, encoding="utf-16")
    return [A, C]


def rheo_compass_intervals(folder: Path) -> list[Press]:
    text = "Project:\tgel\nTest:\tSqueeze\n\nResult:\tSqueeze 1\n\n"
    for number, part in enumerate((slice(0, 120), slice(120, 250)), 1):
        time_s, way_mm, force_N = (own[part] for own in A)
        text += (
            f"Interval and data points:\t{number}\t{time_s.size}\nInterval data:\tPoint No.\tTime\tGap\tNormal Force\n"
        )
        text += "\t\t\t\t\n\t\t[s]\t[mm]\t[N]\n"
        text += (
            rows("\t{:.0f}\t{:.3f}\t{:.5f}\t{:.5f}", np.arange(time_s.size) + 1, time_s, 20 - way_mm, force_N) + "\n"
        )
    (folder / "r.csv").write_text(text, encoding="utf-16")
    return [A]


def lab_view_comments(folder: Path) -> list[Press]:
    text = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tYes\nX_Columns\tOne\n"
    text += "Time_Pref\tRelative\nDate\t2021/03/04\nTime\t10:11:12.1234567\n***End_of_Header***\t\n\t\n"
    for start in range(0, 250, 50):
        text += "Channels\t2\t\t\t\nSamples\t50\t50\t\t\nX_Dimension\tTime\tTime\t\t\nX0\t0.0E+0\t0.0E+0\t\t\n"
        text += "Delta_X\t0.020000\t0.020000\t\t\n***End_of_Header***\t\t\t\t\n"
        text += "X_Value\tPosition (mm)\tForce (N)\tComment\n"
        block = rows("{:.6f}\t{:.6f}\t{:.6f}", *(own[start : start + 50] for own in A))
        text += block.replace("\n", "\tbegun\n", 1) + "\n"
    (folder / "x.lvm").write_text(text)
    return [A]


def lab_view_of_several_x(folder: Path) -> list[Press]:
    text = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\tMulti\n***End_of_Header***\t\n\t\n"
    text += "Channels\t2\t\t\t\nSamples\t250\t\t250\t\nY_Unit_Label\tNewtons\t\tMillimeters\t\n"
    text += "X_Dimension\tTime\t\tTime\t\n***End_of_Header***\t\t\t\t\nX_Value\tForce\tX_Value\tPosition\tComment\n"
    text += comma(rows("{:.6f}\t{:.6f}\t{:.6f}\t{:.6f}", A.time_s, A.force_N, A.time_s, A.way_mm))
    (folder / "x.lvm").write_text(text)
    return [A]


def chart_with_remarks(folder: Path) -> list[Press]:
    text = "Interval=\t0.02 s\nChannelTitle=\tPosition\tForce\nRange=\t10.000 mm\t10.000 N\n"
    data = rows("{:.3f}\t{:.5f}\t{:.5f}", *A).splitlines()
    data[30] += "\t#* touched"
    (folder / "a.txt").write_text(text + "\n".join(data))
    return [A]


def names_with_the_number_of_the_specimen(folder: Path) -> list[Press]:
    text = ""
    for number, own in enumerate((A, C), 9):
        text += ",".join(f"Specimen {number} {name}" for name in ("Time (s)", "Position (mm)", "Force (N)")) + "\n"
        text += rows("{:.3f},{:.5f},{:.5f}", *own) + "\n"
    (folder / "a.csv").write_text(text)
    return [A, C]


def signals_listed_above(folder: Path) -> list[Press]:
    head = "Instrument\tDMA Q800\nSize\t10.0\t5.0\t2.0\tmm\nTime\t10:11:12\nNsig\t4\nSig1\tTime (min)\n"
    head += "Sig2\tTemperature (°C)\nSig3\tDisplacement (µm)\nSig4\tStatic Force (N)\nStartOfData\n"
    data = rows("{:.7f}\t25.01\t{:.4f}\t{:.5f}", A.time_s / 60, A.way_mm * 1e3, A.force_N)
    (folder / "q.txt").write_bytes((head + data).encode("cp1252"))
    return [A]


def channels_listed_above(folder: Path) -> list[Press]:
    head = "Channel 1: Force (N)\nChannel 2: Displacement (mm)\nSample rate: 50 Hz\n\n"
    (folder / "q.txt").write_text(head + rows("{:.5f}\t{:.5f}", A.force_N, A.way_mm))
    return [A]


def capstone(folder: Path) -> list[Press]:
    names = ",".join(f'"Time (s) Run #{n}","Position (m) Run #{n}","Force (N) Run #{n}"' for n in (1, 2))
    (folder / "p.csv").write_text(f"{names}\n" + side_by_side("{:.3f},{:.8f},{:.5f}", A.times(1e-3), C.times(1e-3)))
    return [A, C]


def jpk_segments(folder: Path) -> list[Press]:
    text, half = "# springConstant: 0.5\n#\n", A.time_s.size // 2
    for number, part in enumerate((slice(0, half), slice(half, None))):
        text += f"# segmentIndex: {number}\n# columns: height vDeflection seriesTime segmentTime\n"
        text += '# fancyNames: "Height" "Vertical deflection" "Series Time" "Segment Time"\n# units: m N s s\n'
        time_s, way_mm, force_N = (own[part] for own in A)
        form = "{:.12e} {:.9e} {:.6f} {:.6f}"
        text += rows(form, -way_mm * 1e-6, force_N * 1e-9, time_s, time_s - time_s[0]) + "\n"
    (folder / "force.txt").write_text(text)
    return [A.times(1e-3, 1e-9)]


def time_begins_anew(folder: Path) -> list[Press]:
    data = (rows("{:.3f},{:.5f},{:.5f}", *own) for own in (A, B, C))
    (folder / "m.csv").write_text("Time (s),Position (mm),Force (N)\n" + "\n".join(data))
    return [A, B, C]


def time_begins_anew_behind_words(folder: Path) -> list[Press]:
    data = (rows("{:.3f}\t{:.5f}\t{:.5f}", *own) for own in (A, B, C))
    (folder / "m.txt").write_text("Time (s)\tPosition (mm)\tForce (N)\n" + "Next specimen\n".join(data))
    return [A, B, C]


def capitals(folder: Path) -> list[Press]:
    data = rows("{:.3f},{:.1f},{:.5f}", *A.times(1e3))
    (folder / "g.csv").write_text("TIME_S,DISP_NM,FORCE_N\n" + data)
    return [A.times(1e-3)]


def glued_units(folder: Path) -> list[Press]:
    data = comma(rows("{:.0f};{:.2f};{:.5f};0,1", A.time_s * 1e3, *A.times(1e3)[1:]))
    (folder / "g.csv").write_text("Zeit_ms;Position_µm;Load_N;Torque_NM\n" + data)
    return [A]


def a_channel_a_file(folder: Path) -> list[Press]:
    for name, own in (("s1", A), ("s2", C)):
        (folder / name).mkdir()
        for channel, values in (("force_mN", own.force_N * 1e3), ("displacement_mm", own.way_mm)):
            data = rows("{:.3f},{:.5f}", own.time_s, values)
            (folder / name / f"{channel}.csv").write_text("time_s,value\n" + data)
    return [A, C]


def pulled(head: str) -> Callable[[Path], list[Press]]:
    """A test that pulls: what rises is tension, and the tip goes away from the specimen."""

    def write(folder: Path) -> list[Press]:
        (folder / "g.csv").write_text(head + rows("{:.3f};{:.5f};{:.5f}", *A))
        return [A.times(-1, -1)]

    return write


MAKERS: dict[str, Callable[[Path], list[Press]]] = {
    write.__name__: write
    for write in (
        bluehill_below_each_other, bluehill_side_by_side, test_suite_cycles, test_suite_pulls_are_positive,
        test_xpert_with_statistics, test_xpert_text, trapezium, win_test_scans, mach_1, micro_squisher, piuma,
        rheo_compass, rheo_compass_intervals, lab_view_comments, lab_view_of_several_x, chart_with_remarks,
        names_with_the_number_of_the_specimen,
        signals_listed_above, channels_listed_above, capstone, jpk_segments, time_begins_anew,
        time_begins_anew_behind_words, capitals, glued_units, a_channel_a_file,
    )
}  # fmt: skip
MAKERS |= {
    "tension in a name": pulled("Time (s);Tensile extension (mm);Tensile load (N)\n"),
    "Zug in a name": pulled("Zeit [s];Weg [mm];Zugkraft [N]\n"),
    "Zug above": pulled("Prüfart;Zugversuch\n\nZeit [s];Weg [mm];Kraft [N]\n"),
}


def dynamometer(torque: str) -> Iterator[str]:
    """The lines of a report of an isokinetic dynamometer, right-aligned between blanks."""
    yield "BIODEX MEDICAL SYSTEMS\n\nName:       DOE, JOHN\nProtocol:   Isokinetic\n\n"
    yield "     mSec   TORQUE   POSITION   POS(ANAT)   VELOCITY\n"
    yield f"            {torque:>6}    DEGREES    DEGREES     DEG/SEC\n\n"
    speed = np.gradient(10 * A.way_mm, A.time_s)
    yield rows("{:9.0f} {:8.1f} {:10.1f} {:10.1f} {:10.1f}", A.time_s * 1e3, A.force_N * 5, *[A.way_mm * 10] * 2, speed)
