"""``python -m benchmarks.imported``: processor time of `rig import` for 25 trials of 60 s, three streams at 1 kHz.

The files are of force, axis and marker, a folder a trial, written with six digits. Timed is the command as a whole, in
a process of its own, with the start of the program, table and picture; then its parts by themselves, and beside them
what mcap's own writer takes for as many rows without reading or looking at any: 12 s where 6 s were asked for.
"""

import os
import resource
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from subprocess import DEVNULL, run
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv
from mcap.writer import Writer
from numpy.typing import NDArray

from rig.channels import FORCE
from rig.config.table import load
from rig.intake.mapping import DataMapping
from rig.intake.session import import_folder
from rig.report.came_in import look_at, save_came_in
from rig.results.incoming import Looked

GOAL_S = 6.0
TRIALS, SECONDS, RATE_HZ = 25, 60, 1000
STOCK_ROWS = 150_000
COLUMNS = {"force": {"force": "force_N"}, "axis": {"position": "position_mm"}, "marker": {k: f"{k}_mm" for k in "xyz"}}
Column = NDArray[np.float64]
Made = TypeVar("Made")


def stroke(time_s: Column) -> Column:
    """Position [mm]: from 5 mm above a surface at 20 mm to 8 mm below it, held for 45 s, and back."""
    return np.interp(time_s, [0, 2, 6, 51, 55, 60], [15, 15, 28, 28, 15, 15])


def write_folder(folder: Path) -> None:
    """The measured files, of tissue that stiffens as the index law says."""
    random = np.random.default_rng(7)
    for number in range(TRIALS):
        time_s = number * 100 + np.arange(SECONDS * RATE_HZ) / RATE_HZ
        place_mm = stroke(time_s - time_s[0])
        depth_mm = np.maximum(place_mm - 20, 0)
        force_N = 0.12 * depth_mm * np.exp(0.22 * depth_mm) + 0.005 * random.standard_normal(len(time_s))
        marker_mm = random.normal(0, 0.05, (3, len(time_s))) + np.array([[0.1], [0.2], [-0.97]]) * place_mm
        streams = {"force": [force_N], "axis": [place_mm], "marker": list(marker_mm)}
        (folder / f"trial_{number:02d}").mkdir(parents=True)
        for stream, columns in streams.items():
            names = ["time_s", *COLUMNS[stream].values()]
            table = pa.table([np.round(column, 6) for column in (time_s, *columns)], names)
            arrow_csv.write_csv(table, folder / f"trial_{number:02d}" / f"{stream}.csv")


def mapping() -> str:
    """How those files are read."""
    tables = ['recording = "{recording}"']
    for stream, columns in COLUMNS.items():
        tables += [f'[[tables]]\nfiles = "{{recording:trial_*}}/{stream}.csv"', 'time = { column = "time_s" }']
        tables += [f'columns.{quantity} = {{ column = "{name}" }}' for quantity, name in columns.items()]
    return "\n".join(tables)


def timed(name: str, work: Callable[[], Made]) -> Made:
    """What ``work`` makes; prints the seconds of processor it took."""
    began_s = time.process_time()
    made = work()
    print(f"{name}: {time.process_time() - began_s:.2f} s of processor time")
    return made


def whole_s(folder: Path, file: Path, out: Path) -> float:
    """Seconds of processor that the command takes as a process of its own, its start with them.

    It runs twice, so that the program's bytecode is there as in any run but the first; the second counts.
    """
    rig, env = Path(sys.executable).with_name("rig"), {**os.environ, "PYTHONPYCACHEPREFIX": str(out.parent / "code")}
    env.pop("PYTHONDONTWRITEBYTECODE", None)
    used_s = []
    for number in range(2):
        place = str(out / str(number))
        run([rig, "import", str(folder), "--mapping", str(file), "--out", place], stdout=DEVNULL, env=env, check=True)
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        used_s.append(used.ru_utime + used.ru_stime)
    return used_s[1] - used_s[0]


def stock_writer_s() -> float:
    """Seconds of processor that mcap's own writer takes for all rows, told from some of them."""
    written, row = BytesIO(), FORCE.dtype.itemsize
    numbers = np.random.default_rng(7).bytes(STOCK_ROWS * row)
    began_s = time.process_time()
    writer = Writer(written)
    writer.start("", "benchmarks.imported")
    channel = writer.register_channel("force", "row", writer.register_schema("row", "", b""))
    for number in range(STOCK_ROWS):
        writer.add_message(channel, number, numbers[number * row : (number + 1) * row], number, number)
    writer.finish()
    return (time.process_time() - began_s) * TRIALS * SECONDS * RATE_HZ * len(COLUMNS) / STOCK_ROWS


def main() -> int:
    """Writes the files, imports them by the command, then part by part; 1 where the goal is missed."""
    with TemporaryDirectory() as scratch:
        folder, file = Path(scratch) / "measured", Path(scratch) / "mapping.toml"
        write_folder(folder)
        (Path(scratch) / "by_command").mkdir()
        file.write_text(mapping())
        took_s = whole_s(folder, file, Path(scratch) / "by_command")
        print(f"rig import, all of it: {took_s:.2f} s of processor time (goal: below {GOAL_S:g} s)")
        read = load(DataMapping, file)
        out, now, looked = Path(scratch) / "out", datetime.now(UTC), Looked()
        watched = "  session, looked at on the way"
        session = timed(watched, lambda: import_folder(folder, read, out, now, see=looked.add))
        found = timed("  contact, and the picture", lambda: look_at(session, looked=looked))
        timed("  its files", lambda: save_came_in(session, found))
        stock_s = stock_writer_s()
        print(
            f"mcap's own writer alone, for as many rows: {stock_s:.1f} s; the import takes {took_s / stock_s:.2f} of it"
        )
    return int(took_s >= GOAL_S)


if __name__ == "__main__":
    sys.exit(main())
