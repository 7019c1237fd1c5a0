"""Made-up recordings in six forms that laboratories publish: ``python examples/forms/make.py FOLDER``.

Strokes of 8 mm into a tissue that stiffens and relaxes, at 2, 4 and 8 mm/s.
"""

import gzip
import sys
from pathlib import Path

import numpy as np
import scipy.io
from numpy.typing import NDArray

Column = NDArray[np.float64]
SPEEDS_MM_S = (2.0, 4.0, 8.0)
STEP_S = 0.02


def stroke(speed_mm_s: float, start_mm: float, seed: int) -> tuple[Column, Column, Column]:
    """Time [s], way [mm] and compressive force [N]: rest at ``start_mm`` from the surface, in, hold of 2 s, out."""
    way_mm = np.arange(0, 8 - min(start_mm, 0), speed_mm_s * STEP_S)
    rest = np.zeros(40)
    travel_mm = np.concatenate([rest, way_mm, np.full(100, way_mm[-1]), way_mm[::-1], rest])
    depth_mm = np.maximum(start_mm + travel_mm, 0)
    elastic_N = 0.15 * depth_mm * np.exp(0.15 * depth_mm)
    recent_N = np.zeros_like(elastic_N)
    for i in range(1, len(elastic_N)):
        recent_N[i] = recent_N[i - 1] * np.exp(-STEP_S / 1.5) + elastic_N[i] - elastic_N[i - 1]
    noise_N = 0.003 * np.random.default_rng(seed).standard_normal(len(elastic_N))
    return STEP_S * np.arange(len(depth_mm)), travel_mm, np.maximum(0.7 * elastic_N + 0.3 * recent_N, 0) + noise_N


def write_machine(folder: Path) -> None:
    """A file a specimen as a testing machine exports it, from a small preload: settings, names, units, Latin-1."""
    folder.mkdir(parents=True)
    for number, speed_mm_s in enumerate(SPEEDS_MM_S, start=1):
        lines = ["Prüfgerät;Z005", "Kraftaufnehmer;50 N", "", "Prüfzeit;Standardkraft;Standardweg", "s;N;mm"]
        for time_s, travel_mm, force_N in zip(*stroke(speed_mm_s, 0.2, number), strict=True):
            lines.append(f"{time_s:.2f};{force_N:.4f};{travel_mm:.4f}".replace(".", ","))
        (folder / f"Probe {number}.csv").write_text("\n".join(lines) + "\n", encoding="latin-1")


def write_matlab(folder: Path) -> None:
    """One file of a study: a struct a subject, in it a struct a trial, in it vectors without units."""
    folder.mkdir(parents=True)
    study: dict[str, dict[str, dict[str, Column]]] = {}
    for seed, subject in enumerate(("S01", "S02"), start=1):
        for number, speed_mm_s in enumerate(SPEEDS_MM_S, start=1):
            time_s, travel_mm, force_N = stroke(speed_mm_s, -1.5, 10 * seed + number)
            trial = {"time": time_s, "force": force_N, "displacement": travel_mm}
            study.setdefault(subject, {})[f"trial{number}"] = trial
    scipy.io.savemat(folder / "study.mat", study)


def write_stacked(folder: Path) -> None:
    """All recordings below each other in one table, told apart by a column; the position is a gap that closes."""
    folder.mkdir(parents=True)
    lines = ["sample,time_ms,load_mN,gap_um"]
    for number, speed_mm_s in enumerate(SPEEDS_MM_S, start=1):
        for time_s, travel_mm, force_N in zip(*stroke(speed_mm_s, -1.5, 30 + number), strict=True):
            lines.append(f"gel {number},{1e3 * time_s:.0f},{1e3 * force_N:.1f},{15000 - 1e3 * travel_mm:.0f}")
    (folder / "all.csv").write_text("\n".join(lines) + "\n")


def write_asmi(folder: Path) -> None:
    """As well plates under a gantry were published: a folder a run, a file a well, settings above each table."""
    run = folder / "run_001_20250711_090000"
    run.mkdir(parents=True)
    settings = (
        "Target_Z(mm),-15.000", "Force_Limit(N),45.0", "Force_Exceeded,False", "Stop_Z(mm),N/A",
        "Sampling_Period(ms),20", "Well_X(mm),116.500", "Well_Y(mm),84.000", "",
        "Timestamp(s),Z_Position(mm),Force(N),Movement",
    )  # fmt: skip
    for number, speed_mm_s in enumerate(SPEEDS_MM_S, start=1):
        lines = ["Test_Time,2025-07-11 09:00:00", f"Well,A{number}", *settings]
        for time_s, travel_mm, force_N in zip(*stroke(speed_mm_s, -1.5, 50 + number), strict=True):
            lines.append(f"{time_s:.3f},{-travel_mm:.3f},{-force_N:.3f},Down")
        (run / f"well_A{number}_20250711_090000.csv").write_text("\n".join(lines) + "\n")


def write_vhb(folder: Path) -> None:
    """As strips of elastomer were published, pulled: names and units in Chinese; GBK and quotes but for relaxation."""
    folder.mkdir(parents=True)
    lines = ["时间,位移,力", "(s),(mm),(N)"]
    lines += [f"{t:g},{w:g},{f:.4f}" for t, w, f in zip(*stroke(SPEEDS_MM_S[-1], 0.0, 70), strict=True)]
    (folder / "relaxation_1.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    for number, speed_mm_s in enumerate(SPEEDS_MM_S, start=1):
        lines = ["", "时间,位移,力", "(s),(mm),(N)"]
        for time_s, travel_mm, force_N in zip(*stroke(speed_mm_s, 0.0, 70 + number), strict=True):
            lines.append(f'"{time_s:.4f}","{travel_mm:.4f}","{force_N:.4f}"')
        (folder / f"0d0{number}_2d0.csv").write_text("\n".join(lines) + "\n", encoding="gb18030")


def write_perineal(folder: Path) -> None:
    """As a testing machine on meat was published: all recordings below each other in one packed table."""
    folder.mkdir(parents=True)
    lines = ["recording,t_s,force_N,extension_mm,tool_gap_mm"]
    for number, speed_mm_s in enumerate(SPEEDS_MM_S, start=1):
        for time_s, travel_mm, force_N in zip(*stroke(speed_mm_s, -1.5, 90 + number), strict=True):
            lines.append(f"240101_A|RDG1 {number},{time_s:.2f},{force_N:.6f},{travel_mm:.6f},{15 - travel_mm:.6f}")
    (folder / "recordings.csv.gz").write_bytes(gzip.compress("\n".join(lines).encode() + b"\n", mtime=0))


if __name__ == "__main__":
    place = Path(sys.argv[1])
    write_machine(place / "machine")
    write_matlab(place / "matlab")
    write_stacked(place / "stacked")
    write_asmi(place / "asmi")
    write_vhb(place / "vhb4910")
    write_perineal(place / "perineal_indentation")
