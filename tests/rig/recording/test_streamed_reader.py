"""Recordings read by a window, against the stock reader on the same bytes, and within bounds of memory and time."""

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from rig.channels import AXIS, CDR_HEADER, EVENT, FORCE, LOOP, STREAMS, Stream
from rig.errors import DataError
from rig.recording import file_window, growing_table, scan
from rig.recording.file_window import FileWindow
from rig.recording.growing_table import GrowingTable
from rig.recording.mcap_file import RecordingWriter
from rig.recording.reader import read_recording
from tests.rig.recording.conftest import event

NUMERIC = (FORCE, AXIS, LOOP)


def random_rows(stream: Stream, first: int, count: int, seed: int) -> "np.ndarray[tuple[int], np.dtype[np.void]]":
    """Rows of any bits but those of the numbers that MCAP repeats, which go upwards."""
    random = np.random.default_rng(seed)
    rows = np.frombuffer(random.bytes(count * stream.dtype.itemsize), stream.dtype).copy()
    for name in ("seq", "capture_ns", "arrival_ns"):
        rows[name] = np.arange(first, first + count)
    return rows


def stock(path: Path) -> dict[str, list[bytes]]:
    """Bodies by stream, as the stock reader finds them in the order of the file."""
    found: dict[str, list[bytes]] = {stream.name: [] for stream in STREAMS}
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages(log_time_order=False):
            found[channel.topic].append(message.data[len(CDR_HEADER) :])
    return found


Piece = tuple[int, int, bool]


@settings(deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(pieces=st.lists(st.tuples(st.integers(0, 3), st.integers(0, 40), st.booleans()), max_size=25))
def test_what_is_read_is_what_the_stock_reader_reads_however_it_was_cut_into_chunks(
    pieces: list[Piece], tmp_path: Path
) -> None:
    path = tmp_path / "any.mcap"
    path.unlink(missing_ok=True)
    writer = RecordingWriter(path, {"trial": {"speed_mm_s": "5"}})
    for seed, (which, count, ends) in enumerate(pieces):
        if which == len(NUMERIC):
            writer.add(EVENT.id, EVENT.pack(event(seed)))
        elif count:
            writer.add(NUMERIC[which].id, random_rows(NUMERIC[which], seed * 100, count, seed).tobytes())
        if ends:
            writer.flush()
    writer.finish({"outcome": "done"})
    found, expected = read_recording(path), stock(path)
    assert {name: table.tobytes() for name, table in found.tables.items()} == {
        stream.name: b"".join(expected[stream.name]) for stream in STREAMS if not stream.has_text
    }
    assert [EVENT.pack(each) for each in found.events] == expected[EVENT.name]
    assert (found.complete, found.damage, found.cut) == (True, (), "")


@pytest.fixture
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    """A window of 100 bytes: every record lies across several."""
    monkeypatch.setattr(file_window, "WINDOW", 100)
    monkeypatch.setattr(scan, "WINDOW", 100)


def written(path: Path, chunks: int = 12, rows: int = 50) -> list[int]:
    """A recording with gaps in its numbers; the sizes of the file at the end of each chunk."""
    writer, ends = RecordingWriter(path, {}), []
    for number in range(chunks):
        for stream in NUMERIC:
            writer.add(stream.id, random_rows(stream, number * 1000, rows, number).tobytes())
        writer.flush()
        ends.append(path.stat().st_size)
    writer.finish({"outcome": "done"})
    return ends


def test_records_across_windows_are_read_whole(tmp_path: Path, narrow: None) -> None:
    written(tmp_path / "a.mcap")
    table = read_recording(tmp_path / "a.mcap").tables["loop"]
    assert table["seq"].tolist() == [1000 * number + row for number in range(12) for row in range(50)]


def test_behind_damage_across_windows_the_rest_is_found(tmp_path: Path, narrow: None) -> None:
    path = tmp_path / "a.mcap"
    ends = written(path)
    data = bytearray(path.read_bytes())
    data[ends[3] : ends[3] + 300] = bytes(300)
    path.write_bytes(data)
    found = read_recording(path)
    kept = [number for number in range(12) if number != 4]
    assert found.tables["axis"]["seq"].tolist() == [1000 * number + row for number in kept for row in range(50)]
    assert len(found.damage) == 1
    expected = b"".join(random_rows(FORCE, number * 1000, 50, number).tobytes() for number in kept)
    assert found.tables["force"].tobytes() == expected


def test_definitions_lost_with_the_first_chunk_are_those_of_our_writer(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    written(path)
    data = bytearray(path.read_bytes())
    data[data.index(b"\x04\0\0\0zstd") + 200] ^= 0xFF
    path.write_bytes(data)
    found = read_recording(path)
    assert len(found.tables["force"]) == 11 * 50
    assert found.damage


def test_a_file_that_is_cut_while_it_is_read_ends_where_it_was_cut(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    ends = written(path)
    with FileWindow(path) as window:
        assert window[:8] == path.read_bytes()[:8]
        path.write_bytes(path.read_bytes()[: ends[2]])
        found = scan.Scan()
        window._held = b""  # what was read before is as it was
        assert len(list(scan.good_chunks(window, found))) == 3
    assert found.cut or found.damage


def test_a_window_gives_what_slices_of_the_bytes_give(tmp_path: Path, narrow: None) -> None:
    data = bytes(range(256)) * 4
    (tmp_path / "bytes").write_bytes(data)
    with FileWindow(tmp_path / "bytes") as window:
        for start, end in [(0, 8), (5, 5), (90, 210), (3, 9), (1000, 1024), (1020, 4000), (700, 100)]:
            assert window[start:end] == data[start:end], (start, end)
        assert window[-30:] == data[-30:]
        assert len(window) == 1024


@pytest.mark.parametrize("text", [b"", b"{}", b"MCAP", b"\x89MCAP1\r\n" + bytes(100)])
def test_what_is_no_recording_is_one_sentence(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "a.mcap").write_bytes(text)
    if text:
        with pytest.raises(DataError, match="not a recording"):
            read_recording(tmp_path / "a.mcap")
    else:
        assert read_recording(tmp_path / "a.mcap").cut


def test_a_table_grows_and_keeps_each_row(monkeypatch: pytest.MonkeyPatch) -> None:
    """Past the size from which it is moved instead of copied."""
    monkeypatch.setattr(growing_table, "LARGE_BYTES", 1 << 20)
    table = GrowingTable(AXIS.dtype.itemsize)
    parts = [random_rows(AXIS, 10 * number, number * 37, number) for number in range(1, 60)]
    for part in parts:
        strided = np.zeros((len(part), 200), np.uint8)
        strided[:, 30 : 30 + AXIS.dtype.itemsize] = part.view(np.uint8).reshape(len(part), -1)
        table.add(strided[:, 30 : 30 + AXIS.dtype.itemsize])
    rows = table.rows(AXIS.dtype)
    assert rows.tobytes() == np.concatenate(parts).tobytes()
    with pytest.raises(ValueError, match="read-only"):
        rows["seq"][0] = 1


def advised(address: int) -> bool:
    """Whether the memory there is to have huge pages: flag `hg` of proc_pid_smaps(5)."""
    inside = False
    for line in Path("/proc/self/smaps").read_text().splitlines():
        first, _, rest = line.partition(" ")
        if "-" in first:
            begin, end = (int(part, 16) for part in first.split("-"))
            inside = begin <= address < end
        elif inside and first == "VmFlags:":
            return "hg" in rest.split()
    return False


def test_a_large_table_has_huge_pages_where_the_system_has_them() -> None:
    table = GrowingTable(AXIS.dtype.itemsize)
    for _ in range(3):
        table.add(np.ones((40_000, AXIS.dtype.itemsize), np.uint8))
        assert advised(table.rows(AXIS.dtype).ctypes.data) == Path("/sys/kernel/mm/transparent_hugepage").exists()


PEAK = """
import json, resource, sys
from pathlib import Path
from rig.recording.reader import read_recording
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
found = read_recording(Path(sys.argv[1]))
after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([1000 * (after - before), sum(table.nbytes for table in found.tables.values())]))
"""


def test_reading_takes_the_memory_of_the_tables_and_little_more(tmp_path: Path) -> None:
    """Half again of 40 MB would be the file beside its tables; twice would be a copy of them."""
    written(tmp_path / "a.mcap", chunks=120, rows=1000)
    command = [sys.executable, "-c", PEAK, str(tmp_path / "a.mcap")]
    taken, tables = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert tables == 120 * 1000 * sum(stream.dtype.itemsize for stream in NUMERIC)
    assert taken < 1.4 * tables


def test_reading_is_an_order_faster_than_the_stock_reader_a_row(tmp_path: Path) -> None:
    """Measured: 1.5 % (`python -m benchmarks.recording`); on a busy computer in the same minute still below a tenth."""
    written(tmp_path / "a.mcap", chunks=10, rows=3000)

    def spent_s(read: object) -> float:
        began = time.process_time()
        read(tmp_path / "a.mcap")  # type: ignore[operator]
        return time.process_time() - began

    # In turn, so that a processor that is slower for a while is so for both.
    shares = [spent_s(read_recording) / spent_s(stock) for _ in range(3)]
    assert min(shares) < 0.1
