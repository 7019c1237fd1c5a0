"""What recording costs, beside rivals in the same run: `python -m benchmarks.recording [--minutes 2]`; last line JSON.

Three streams at 1 kHz (force, axis, loop) of numbers with noise. Written: the recorder's own turns on a full ring, as
share of a core at 1 kHz, and without pause. Read: our reader, h5py of the same tables, and the stock MCAP reader of the
same file. All times are processor time of this process; each is the median of five.
"""

import argparse
import json
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
from mcap.reader import make_reader
from numpy.typing import NDArray

from rig.channel import Received
from rig.channels import AXIS, FORCE, LOOP, Stream
from rig.recording.mcap_file import RecordingWriter
from rig.recording.messages import Close, Open
from rig.recording.reader import read_recording
from rig.recording.recorder import BATCH, DRAIN_PERIOD_S, Recorder
from rig.recording.ring import RingReader, RingWriter

STREAMS = (FORCE, AXIS, LOOP)
RATE_Hz = 1000
REPEATS = 5
# The stock reader takes 20 us a row: of a longer file it reads the beginning.
STOCK_ROWS = 60_000
TURNS = 60
HOUR_ROWS = 3600 * RATE_Hz * len(STREAMS)


def rows_of(stream: Stream, first: int, count: int, noise: np.random.Generator) -> NDArray[np.void]:
    """Rows as a bench would make them: numbers that count, and readings with noise of a converter's last digits."""
    rows = np.zeros(count, stream.dtype)
    rows["seq"] = np.arange(first, first + count)
    rows["capture_ns"] = rows["seq"] * 1_000_000 + noise.integers(0, 20_000, count)
    rows["arrival_ns"] = rows["capture_ns"] + 100_000 + noise.integers(0, 20_000, count)
    for name in (name for name in stream.dtype.names or () if stream.kinds[name] is float):
        rows[name] = np.round(noise.normal(size=count), 4)
    return rows


def processor_s(work: Callable[[], object]) -> float:
    """Of the fastest half of REPEATS runs the slowest: a busy computer only ever adds."""
    times = []
    for _ in range(REPEATS):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return statistics.median_low(times)


def record_file(path: Path, seconds: int) -> int:
    """A recording as the recorder lays it out, five chunks a second; its rows."""
    noise, count = np.random.default_rng(1), RATE_Hz // 5
    writer = RecordingWriter(path, {})
    for number in range(seconds * 5):
        for stream in STREAMS:
            writer.add(stream.id, rows_of(stream, number * count, count, noise).tobytes())
        writer.flush()
    writer.finish({"outcome": "done"})
    return seconds * RATE_Hz * len(STREAMS)


class Bench:
    """A ring that is filled by this process, and the recorder that empties it."""

    def __init__(self, folder: Path) -> None:
        self._ring = RingWriter.create(folder / "ring", slots=1 << 16)
        self._reader = RingReader.open(self._ring.path)
        self.recorder, self._now_ns, self._seq = Recorder(self._reader), 0, 0
        self._noise = np.random.default_rng(2)
        self.recorder.handle(Received(1, Open(path=str(folder / "recorded.mcap"), metadata={})))

    def put(self, count: int) -> None:
        """That many rows of each stream."""
        for stream in STREAMS:
            for row in rows_of(stream, self._seq, count, self._noise):
                self._ring.put(stream.id, row.tobytes())
        self._seq += count

    def turn(self, period_s: float) -> float:
        """Processor time of one turn of the recorder."""
        self._now_ns += round(period_s * 1e9)
        began = time.process_time()
        self.recorder.step(self._now_ns)
        return time.process_time() - began

    def close(self) -> dict[str, object]:
        """Ends the recording; what the recorder says of it."""
        closed = self.recorder.handle(Received(2, Close(summary={}))).model_dump()
        self._reader.close()
        self._ring.close()
        return closed


def live_share(folder: Path) -> float:
    """Of a core, for three streams at 1 kHz, all but waking up."""
    bench, spent_s, count = Bench(folder), 0.0, round(DRAIN_PERIOD_S * RATE_Hz)
    for _ in range(TURNS):
        bench.put(count)
        spent_s += bench.turn(DRAIN_PERIOD_S)
    bench.close()
    return spent_s / (TURNS * DRAIN_PERIOD_S)


def sustained_rows_s(folder: Path) -> tuple[float, int]:
    """Rows a second where the ring is always full, and rows that were lost."""
    bench, spent_s, count = Bench(folder), 0.0, BATCH // len(STREAMS)
    for _ in range(TURNS):
        bench.put(count)
        spent_s += bench.turn(BATCH / 200_000)
    closed = bench.close()
    samples = closed["samples"]
    assert isinstance(samples, dict)
    kept = sum(samples.values())
    return kept / spent_s, TURNS * count * len(STREAMS) - kept


def write_h5(path: Path, tables: dict[str, NDArray[np.void]]) -> None:
    """The same tables as HDF5, in chunks as large, packed and with checksums as a recording is."""
    with h5py.File(path, "w") as file:
        for name, table in tables.items():
            if table.size:
                chunks = (min(len(table), 8192),)
                file.create_dataset(name, data=table, chunks=chunks, compression="gzip", shuffle=True, fletcher32=True)


def read_h5(path: Path) -> int:
    """Rows read."""
    with h5py.File(path) as file:
        return sum(len(file[name][()]) for name in file)


def read_stock(path: Path) -> int:
    """Messages taken out by the stock reader, not decoded."""
    count = 0
    with path.open("rb") as file:
        for _ in make_reader(file).iter_messages(log_time_order=False):
            count += 1
            if count == STOCK_ROWS:
                break
    return count


def reading(path: Path, rows: int) -> dict[str, float]:
    """Times a row [us] and their ratios."""
    tables = read_recording(path).tables
    beside = path.with_suffix(".h5")
    write_h5(beside, tables)
    del tables
    ours = 1e6 * processor_s(lambda: read_recording(path)) / rows
    h5 = 1e6 * processor_s(lambda: read_h5(beside)) / rows
    stock = 1e6 * processor_s(lambda: read_stock(path)) / min(rows, STOCK_ROWS)
    return {
        "read_us_row": round(ours, 3),
        "h5py_us_row": round(h5, 3),
        "stock_us_row": round(stock, 2),
        "read_over_h5py": round(ours / h5, 2),
        "read_over_stock": round(ours / stock, 3),
    }


def hour(folder: Path) -> dict[str, float]:
    """An hour of three streams, read in a process of its own that says what it took."""
    import subprocess  # noqa: PLC0415 - only here

    path = folder / "hour.mcap"
    record_file(path, 3600)
    code = (
        "import resource, sys, time; from pathlib import Path; from rig.recording.reader import read_recording; "
        "began = time.process_time(); found = read_recording(Path(sys.argv[1])); spent = time.process_time() - began; "
        "rows = sum(map(len, found.tables.values())); "
        "print(rows, spent, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    out = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=True).stdout
    rows, spent_s, peak_kB = out.split()
    assert int(rows) == HOUR_ROWS
    return {"hour_s": round(float(spent_s), 2), "hour_GB": round(int(peak_kB) / 1e6, 2)}


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.recording", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--minutes", type=int, default=2, help="of the recording that is read beside the rivals")
    parser.add_argument("--hour", action="store_true", help="reads an hour too; takes 1 GB of disk and of memory")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "live").mkdir()
        (folder / "full").mkdir()
        path = folder / "read.mcap"
        rows = record_file(path, 60 * options.minutes)
        rate, lost = sustained_rows_s(folder / "full")
        found: dict[str, float] = {"recorder_core_percent": round(100 * live_share(folder / "live"), 3)}
        found |= {"sustained_rows_s": round(rate), "lost": lost, **reading(path, rows)}
        found |= hour(folder) if options.hour else {}
    for key, value in found.items():
        print(f"{key:24}{value:>12g}")
    print(json.dumps(found))


if __name__ == "__main__":
    main()
