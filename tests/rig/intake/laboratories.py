"""Files of a foreign laboratory: exports of further programs, logs of its own boards, and what it has published.

Laid out by the manuals and published examples of testXpert (ZwickRoell), Bluehill in French (Instron), ARAMIS (GOM),
Track Manager (Qualisys), pedar (novel), I-Scan (Tekscan), PuTTY, npTDMS, rosbag, OpenSim and Proteus (NETZSCH).
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import openpyxl
import scipy.io

from tests.rig.intake.makers import A, B, C, Press, comma, rows, side_by_side

STAMP_NS = 1_614_852_672_000_000_000  # 4 March 2021


def units_by_in(folder: Path) -> list[Press]:
    """Thousands with points, decimals with commas, units behind a German *in*."""
    head = 'Prüfvorschrift;"Eindrückversuch ä"\nWerkstoff;Gel\n\n'
    head += '"Prüfzeit in s";"Standardkraft in mN";"Standardweg in µm"\n'
    cells = (f"{t:.2f};{1e3 * f:,.2f};{1e3 * w:,.2f}" for t, w, f in zip(*A, strict=True))
    text = "\r\n".join(cell.translate(str.maketrans(",.", ".,")) for cell in cells)
    (folder / "Probe_1.TRA").write_bytes((head + text + "\r\n").encode("cp1252"))
    return [A]


def bluehill_in_french(folder: Path) -> list[Press]:
    for number, own in enumerate((A, C), 1):
        head = f'"Résultats 1"\n;"Charge maximale";"Module"\n;"(N)";"(MPa)"\n1;"10,4";"0,1"\n\n"Eprouvette {number}"\n'
        head += '"Temps";"Déplacement";"Charge"\n"(s)";"(mm)";"(N)"\n'
        data = comma(rows('"{:.3f}";"{:.5f}";"{:.5f}"', *own))
        (folder / f"Essai_RawData_{number}.csv").write_bytes((head + data).encode("cp1252"))
    return [A, C]


def stages_of_a_camera(folder: Path) -> list[Press]:
    """A row a stage, with what the camera's analogue inputs held."""
    head = '"Stage";"Rel. time [s]";"Analog input 1: Force [N]";"Point 1.dX [mm]";"Point 1.dY [mm]"\n'
    count = np.arange(A.time_s.size)
    data = rows("{:.0f};{:.3f};{:.5f};{:.5f};{:.5f}", count, A.time_s, A.force_N, 0.001 * A.way_mm, -A.way_mm)
    (folder / "gel.csv").write_text(head + data)
    return [A]


def markers_and_plate(folder: Path) -> list[Press]:
    """A file of markers, and one of the force plate beside it, at a rate of its own."""
    head = "NO_OF_FRAMES\t250\nNO_OF_CAMERAS\t8\nNO_OF_MARKERS\t1\nFREQUENCY\t50\nDATA_INCLUDED\t3D\n"
    head += "MARKER_NAMES\ttip\nFrame\tTime\ttip X\ttip Y\ttip Z\n"
    count = np.arange(1, A.time_s.size + 1)
    data = rows("{:.0f}\t{:.5f}\t1.0\t2.0\t{:.5f}", count, A.time_s, 100 - A.way_mm)
    (folder / "press_1.tsv").write_text(head + data)
    head = "NO_OF_SAMPLES\t250\nFREQUENCY\t50\nFIRST_SAMPLE\t1\nDESCRIPTION\tplate 1\n"
    head += "SAMPLE\tTIME\tForce_X\tForce_Y\tForce_Z\n"
    data = rows("{:.0f}\t{:.5f}\t0.01\t0.02\t{:.5f}", count, A.time_s, A.force_N)
    (folder / "press_1_f.tsv").write_text(head + data)
    return [A]


def log_of_a_board_that_was_reset(folder: Path) -> list[Press]:
    """What a terminal kept of a board: its own line, what the board says when it starts, and its rows, twice."""
    text = ""
    for own in (A, C):
        text += "=~=~=~=~=~= PuTTY log 2021.03.04 10:11:12 =~=~=~=~=~=\r\nHX711 ready\r\nms,load_g,pos_um\r\n"
        text += rows("{:.0f},{:.4f},{:.2f}", own.time_s * 1e3, own.force_N / 9.80665e-3, own.way_mm * 1e3)
    (folder / "putty.log").write_text(text)
    return [A, C]


def converted_tdms(folder: Path) -> list[Press]:
    """As npTDMS makes a frame of a group: channels by their paths, time as an index without a name."""
    head = ",/'Measured Data'/'Force (N)',/'Measured Data'/'Position (mm)'\n"
    (folder / "converted.csv").write_text(head + rows("{:.6f},{:.5f},{:.5f}", A.time_s, A.force_N, A.way_mm))
    return [A]


def bag_of_two_topics(folder: Path) -> list[Press]:
    """A file a topic, as `rostopic echo -p` writes them, with stamps in nanoseconds."""
    stamp = (STAMP_NS + np.round(A.time_s * 1e9)).astype(np.int64)
    count = np.arange(stamp.size)
    head = "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.wrench.force.x,field.wrench.force.y,"
    head += "field.wrench.force.z\n"
    (folder / "wrench.csv").write_text(head + rows("{},{},{},ft,0.01,0.02,{:.5f}", stamp, count, stamp, A.force_N))
    head = "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.pose.position.x,"
    head += "field.pose.position.y,field.pose.position.z\n"
    data = rows("{},{},{},base,0.4,0.1,{:.8f}", stamp, count, stamp, 0.5 - 1e-3 * A.way_mm)
    (folder / "pose.csv").write_text(head + data)
    return [A]


def array_of_structs(folder: Path) -> list[Press]:
    trials = np.zeros(3, [(name, object) for name in ("subject", "time_s", "force_N", "disp_mm")])
    for number, own in enumerate((A, B, C)):
        trials[number] = (f"S{number}", own.time_s[:, None], own.force_N[:, None], own.way_mm[:, None])
    scipy.io.savemat(folder / "study.mat", {"trials": trials})
    return [A, B, C]


def merged_cells(folder: Path) -> list[Press]:
    """Two specimens beside each other, each under a title over three columns, names over two rows."""
    book = openpyxl.Workbook()
    sheet = book["Sheet"]
    sheet.append(["Soft tissue study 2021"])
    sheet.append(["Specimen 1", None, None, "Specimen 2", None, None])
    sheet.append(["Time", "Displacement", "Force"] * 2)
    sheet.append(["s", "mm", "N"] * 2)
    for place in ("A1:F1", "A2:C2", "D2:F2"):
        sheet.merge_cells(place)
    for at in range(A.time_s.size):
        cells = [float(own[at]) if at < own.size else None for one in (A, C) for own in one]
        sheet.append(cells)
    book.save(folder / "study.xlsx")
    return [A, C]


def line_of_json_above(folder: Path) -> list[Press]:
    """What the logger knows in a line of JSON, the rate as well, above rows that are counted."""
    head = '# {"device": "press 2", "sample_rate_hz": 50, "specimen": "gel 3", "created": "2021-03-04T10:11:12"}\n'
    count = np.arange(A.time_s.size)
    head += "index,force_N,position_mm\n"
    (folder / "log.csv").write_text(head + rows("{},{:.5f},{:.5f}", count, A.force_N, A.way_mm))
    return [A]


def gbk(folder: Path) -> list[Press]:
    head = "试样编号,3\n试验速度,10 mm/min\n\n时间(s),试验力(N),位移(mm)\n"
    (folder / "a.csv").write_bytes((head + rows("{:.3f},{:.5f},{:.5f}", A.time_s, A.force_N, A.way_mm)).encode("gbk"))
    return [A]


def shift_jis(folder: Path) -> list[Press]:
    head = "試験種類,圧縮\n試験片名,ゲル\n\n時間,試験力,ストローク\nsec,N,mm\n"
    data = rows("{:.3f},{:.5f},{:.5f}", A.time_s, A.force_N, A.way_mm)
    (folder / "a.csv").write_bytes((head + data).encode("cp932"))
    return [A]


def unicode_text(folder: Path) -> list[Press]:
    """As a spreadsheet saves Unicode text on a German computer, its high bytes first."""
    head = "Zeit [s]\tKraft [N]\tWeg [mm]\r\n"
    data = comma(rows("{:.3f}\t{:.5f}\t{:.5f}", A.time_s, A.force_N, A.way_mm)).replace("\n", "\r\n")
    (folder / "a.txt").write_bytes(b"\xfe\xff" + (head + data).encode("utf-16-be"))
    return [A]


def storage_of_a_simulation(folder: Path) -> list[Press]:
    """A motion and a force in one table, as OpenSim reads and writes them, in metres."""
    head = "press\nversion=1\nnRows=250\nnColumns=3\ninDegrees=no\n"
    head += "Units are S.I. units (seconds, meters, Newtons, ...)\nendheader\ntime\tground_force_vz (N)\ttip_tz (m)\n"
    (folder / "a.sto").write_text(head + rows("{:.8f}\t{:.8f}\t{:.8f}", A.time_s, A.force_N, 1e-3 * A.way_mm))
    return [A]


def names_behind_two_hashes(folder: Path) -> list[Press]:
    head = "#EXPORTTYPE:;DATA ALL\n#FORMAT:;NETZSCH5\n#DECIMAL:;COMMA\n#SEPARATOR:;SEMICOLON\n#SAMPLE:;gel\n"
    head += "##Time/min;Disp./µm;Force/N;Temp./°C\n"
    data = comma(rows("{:.7f};{:.3f};{:.5f};37.0", A.time_s / 60, A.way_mm * 1e3, A.force_N))
    (folder / "a.txt").write_bytes((head + data).encode("cp1252"))
    return [A]


def insole_and_motion(folder: Path) -> list[Press]:
    """The force of a pressure insole in one file, what was moved in another."""
    head = "file name:\tgel.fgt\ndate/time\t04.03.21 10:11:12\nsensor type\tpedar insole\n\n"
    head += "time[secs]\tforce[N]\tmax press[kPa]\tarea[cm²]\n"
    data = rows("{:.3f}\t{:.5f}\t{:.3f}\t12.5", A.time_s, A.force_N, 8 * A.force_N)
    (folder / "gel_force.fgt").write_bytes((head + data).encode("cp1252"))
    (folder / "gel_position.csv").write_text("time_s,position_mm\n" + rows("{:.3f},{:.5f}", A.time_s, A.way_mm))
    return [A]


def three_side_by_side_in_words(folder: Path) -> list[Press]:
    """A published table: a recording's three columns each, told apart by what is in brackets."""
    names = ",".join(f"Time_{tag} (s),Disp_{tag} (mm),Force_{tag} (N)" for tag in ("A", "B", "C"))
    (folder / "Figure_3_source_data.csv").write_text(names + "\n" + side_by_side("{:.3f},{:.5f},{:.5f}", A, B, C))
    return [A, B, C]


LABORATORIES: dict[str, Callable[[Path], list[Press]]] = {
    write.__name__: write
    for write in (
        units_by_in, bluehill_in_french, stages_of_a_camera, markers_and_plate, log_of_a_board_that_was_reset,
        converted_tdms, bag_of_two_topics, array_of_structs, merged_cells, line_of_json_above, gbk, shift_jis,
        unicode_text, storage_of_a_simulation, names_behind_two_hashes, insole_and_motion, three_side_by_side_in_words,
    )
}  # fmt: skip


def map_of_pressure(folder: Path) -> None:
    """Frames of a sensor sheet, a matrix each: a force in parts, and no motion."""
    text = "DATA_TYPE MOVIE\nVERSION I-Scan 7.60\nROWS 4\nCOLS 4\nSECONDS_PER_FRAME 0.02\nUNITS kPa\nASCII_DATA @@\n"
    for frame in range(1, 31):
        text += f"\nFrame {frame}\n" + "".join(",".join(f"{frame * k}" for k in range(4)) + "\n" for _ in range(4))
    (folder / "map.csv").write_text(text)


def plate_alone(folder: Path) -> None:
    """A force plate's export without anything that moves."""
    head = "BioWare\nAcq. rate (Hz)\t50\n\nabs time (s)\tFx\tFy\tFz\ns\tN\tN\tN\n"
    (folder / "plate.txt").write_text(head + rows("{:.3f}\t0.01\t0.02\t{:.5f}", A.time_s, A.force_N))
