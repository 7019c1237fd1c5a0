"""One long file through `rig import`: ``python -m benchmarks.large_import [--gigabytes 2] [--kind csv]``.

A logger's file of eight channels at 1 kHz is made beside the system's temporary files, imported by a process of its own
and removed. Last line: one JSON object with the process's largest memory, its processor time and its time.
"""

import argparse
import json
import resource
import sys
import tempfile
import time
from pathlib import Path
from subprocess import PIPE, run

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

RATE_HZ = 1000.0
MOST_GB = 1.5
PIECE_ROWS = 500_000
CHANNELS = ("t", "F", "x", "Fx", "Fy", "T1", "T2", "U")
MAPPING = """[[tables]]
files = "long.{kind}"
time = {{ column = "t", unit = "s" }}

[tables.columns]
force = {{ column = "F", unit = "N" }}
position = {{ column = "x", unit = "mm" }}
"""


def main() -> int:
    """Makes the file, imports it, and prints what that took; 1 where it took more memory than is allowed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--gigabytes", type=float, default=2.0)
    parser.add_argument("--kind", choices=("csv", "parquet", "h5"), default="csv")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder, out = Path(name) / "in", Path(name) / "out"
        folder.mkdir()
        path = folder / f"long.{asked.kind}"
        rows = _write(path, asked.gigabytes * 1e9)
        (folder / "mapping.toml").write_text(MAPPING.format(kind=asked.kind))
        print(f"{path.name}: {path.stat().st_size / 1e9:.2f} GB, {rows} rows", flush=True)
        start_s = time.monotonic()
        done = run([Path(sys.executable).with_name("rig"), "import", str(folder), "--out", str(out)],
                   stdout=PIPE, text=True, check=True)  # fmt: skip
        took_s = time.monotonic() - start_s
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        print(done.stdout)
        print(json.dumps({
            "file_GB": round(path.stat().st_size / 1e9, 2), "rows": rows,
            "recording_GB": round((out / "long.mcap").stat().st_size / 1e9, 2),
            "largest_memory_GB": round(used.ru_maxrss * 1024 / 1e9, 3),
            "processor_s": round(used.ru_utime + used.ru_stime, 1), "seconds": round(took_s, 1),
        }))  # fmt: skip
        return int(used.ru_maxrss * 1024 / 1e9 >= MOST_GB)


def _write(path: Path, size_B: float) -> int:
    """Rows until the file has that size; how many."""
    return _write_hdf5(path, size_B) if path.suffix == ".h5" else _write_rows(path, size_B)


def _write_hdf5(path: Path, size_B: float) -> int:
    rows = int(size_B / 8 / len(CHANNELS))
    with h5py.File(path, "w") as file:
        data = [file.create_dataset(name, (rows,), "f8", chunks=(1 << 14,)) for name in CHANNELS]
        for first in range(0, rows, PIECE_ROWS):
            for dataset, column in zip(data, _columns(first), strict=True):
                dataset[first : first + PIECE_ROWS] = column[: rows - first]
    return rows


def _write_rows(path: Path, size_B: float) -> int:
    first = 0
    schema = pa.schema([(name, pa.float64()) for name in CHANNELS])
    csv = path.suffix == ".csv"
    with path.open("wb") as file, (arrow_csv.CSVWriter if csv else pq.ParquetWriter)(file, schema) as writer:
        while file.tell() < size_B:
            writer.write_table(pa.table(_columns(first), schema=schema))
            first += PIECE_ROWS
    return first


def _columns(first: int) -> list[NDArray[np.float64]]:
    """A piece of every channel, from row ``first`` on."""
    time_s = (first + np.arange(PIECE_ROWS)) / RATE_HZ
    noise = np.round(np.random.default_rng(first).standard_normal((len(CHANNELS) - 3, PIECE_ROWS)), 5)
    way = np.round(5 - 5 * np.cos(time_s), 4)
    return [time_s, np.round(0.3 * way + 0.005 * noise[0], 5), way, *noise]


if __name__ == "__main__":
    sys.exit(main())
