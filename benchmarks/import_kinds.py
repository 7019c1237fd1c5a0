"""Processor time of an import by kind of file: ``python -m benchmarks.import_kinds [--trials 25] [--kinds csv]``.

A trial is 60 s of force, axis and marker at 1 kHz in one file of six columns. Last line: one JSON object.
"""

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.csv as arrow_csv
import pyarrow.parquet as pq
import scipy.io
from numpy.typing import NDArray

from rig.config.table import parse
from rig.intake.mapping import DataMapping
from rig.intake.session import import_folder

Columns = dict[str, NDArray[np.float64]]
ROWS, RATE_HZ = 60_000, 1000.0
UNITS = {"force": "N", "position": "mm", "x": "mm", "y": "mm", "z": "mm"}


def main() -> None:
    """Prints seconds a kind."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=25)
    parser.add_argument("--kinds", nargs="+", default=list(WRITERS), choices=list(WRITERS))
    asked = parser.parse_args()
    found = {kind: _seconds(kind, asked.trials) for kind in asked.kinds}
    print(json.dumps({"trials": asked.trials, "processor_s": found}))


def _seconds(kind: str, trials: int) -> float:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "in"
        folder.mkdir()
        for number in range(trials):
            WRITERS[kind](folder / f"trial_{number}.{kind}", _columns(number))
        columns = {quantity: {"column": quantity, "unit": unit} for quantity, unit in UNITS.items()}
        table = {"files": f"*.{kind}", "time": {"column": "t", "unit": "s"}, "columns": columns}
        mapping = parse(DataMapping, {"tables": [table]}, "benchmark")
        start_s = time.process_time()
        import_folder(folder, mapping, Path(name) / "out", datetime.now(UTC))
        took_s = round(time.process_time() - start_s, 2)
    print(f"{kind}: {took_s} s for {trials} trials", flush=True)
    return took_s


def _columns(seed: int) -> Columns:
    noise = np.random.default_rng(seed).standard_normal((len(UNITS), ROWS))
    return {"t": np.arange(ROWS) / RATE_HZ} | {name: np.round(row, 5) for name, row in zip(UNITS, noise, strict=True)}


def _write_workbook(path: Path, columns: Columns) -> None:
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("data")
    sheet.append(list(columns))
    for row in np.stack(list(columns.values()), axis=1).tolist():
        sheet.append(row)
    book.save(path)


WRITERS: dict[str, Callable[[Path, Columns], object]] = {
    "csv": lambda path, columns: arrow_csv.write_csv(pa.table(columns), path),
    "parquet": lambda path, columns: pq.write_table(pa.table(columns), path),
    "mat": lambda path, columns: scipy.io.savemat(path, columns, do_compression=True),
    "xlsx": _write_workbook,
}


if __name__ == "__main__":
    main()
