"""Files that are damaged, locked, empty or of another kind than was thought, each written by another library."""

import gzip
import json
import os
import struct
import tempfile
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from mcap.writer import CompressionType, Writer

from rig.config.table import parse
from rig.errors import DataError
from rig.intake.mapping import DataMapping
from rig.intake.proposal import propose
from rig.intake.session import import_folder
from rig.recording.sessions import Session
from tests.rig.recording.measured import NOW, write

TIME_S = np.arange(400) * 0.01
COLUMNS = {"t": TIME_S, "F": np.sin(TIME_S), "x": TIME_S**2}


def rows() -> list[tuple[float, ...]]:
    return [tuple(map(float, row)) for row in zip(*COLUMNS.values(), strict=True)]


def text() -> str:
    return "t,F,x\n" + "".join(f"{t:.2f},{force:.6f},{way:.6f}\n" for t, force, way in rows())


def make_workbook(path: Path) -> None:
    book = openpyxl.Workbook()
    for row in [("t", "F", "x"), *rows()]:
        book["Sheet"].append(row)
    book.save(path)


def make_hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name, values in COLUMNS.items():
            file.create_dataset(name, data=values, chunks=(100,), compression="gzip", fletcher32=True)


def make_mcap(path: Path) -> None:
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        channel = writer.register_channel("cell", "json", 0)
        for row in rows():
            body = json.dumps(dict(zip(COLUMNS, row, strict=True))).encode()
            writer.add_message(channel, round(row[0] * 1e9), body, round(row[0] * 1e9))
        writer.finish()


MAKERS: dict[str, Callable[[Path], object]] = {
    "a.csv.gz": lambda path: path.write_bytes(gzip.compress(text().encode(), mtime=0)),
    "a.xlsx": make_workbook,
    "a.mat": lambda path: scipy.io.savemat(path, COLUMNS, do_compression=True),
    "a.h5": make_hdf5,
    "a.parquet": lambda path: pq.write_table(pa.table(COLUMNS), path, row_group_size=100, write_page_checksum=True),
    "a.mcap": make_mcap,
}


def imported(folder: Path, files: str, out: str = "out", **form: object) -> Session:
    columns = {"force": {"column": "F", "unit": "N"}, "position": {"column": "x", "unit": "mm"}}
    table = {"files": files, "time": {"column": "t", "unit": "s"}, "columns": columns, **form}
    return import_folder(folder, parse(DataMapping, {"tables": [table]}, "made"), folder.parent / out, NOW)


def forces_N(session: Session) -> list[float]:
    forces: list[float] = session.recording(session.trials[0].name).tables["force"]["fz_N"].tolist()
    return forces


@pytest.mark.parametrize("name", MAKERS)
def test_a_file_that_was_cut_is_refused(folder: Path, name: str) -> None:
    MAKERS[name](folder / name)
    good = (folder / name).read_bytes()
    assert imported(folder, name).trials[0].samples == {"force": 400, "axis": 400}
    for share in (0.0, 0.02, 0.3, 0.6, 0.9, 0.99):
        (folder / name).write_bytes(good[: int(share * len(good))])
        with pytest.raises(DataError, match=rf"{name}.*(not readable|ends above)") as caught:
            imported(folder, name, "again")
        assert "\n" not in str(caught.value)
        assert not (folder.parent / "again").exists()


@pytest.mark.parametrize("name", MAKERS)
def test_bytes_that_changed_are_refused_or_make_no_difference(folder: Path, name: str) -> None:
    MAKERS[name](folder / name)
    good = (folder / name).read_bytes()
    expected, refused = forces_N(imported(folder, name)), 0
    for number in range(24):
        at = (2 * number + 1) * len(good) // 48
        (folder / name).write_bytes(good[:at] + bytes([good[at] ^ 1]) + good[at + 1 :])
        try:
            again = imported(folder, name, f"out{number}")
        except DataError as error:
            refused += 1
            assert name in str(error)
            assert "\n" not in str(error)
        else:
            assert forces_N(again) == expected
    assert refused >= 6


def test_an_encrypted_workbook_is_to_be_saved_without_its_password(folder: Path) -> None:
    (folder / "a.xlsx").write_bytes(compound_file({"EncryptionInfo": bytes(4096), "EncryptedPackage": bytes(4096)}))
    with pytest.raises(DataError, match=r"a\.xlsx: encrypted; save it without a password"):
        imported(folder, "a.xlsx")


def test_an_encrypted_xls_is_to_be_saved_without_its_password(folder: Path) -> None:
    """The records that begin one of BIFF8 ([MS-XLS] 2.4.21, 2.4.117): what follows FilePass cannot be read by anyone.

    A made stream, as no program here writes one; the reader stops at that record as at a real one.
    """
    begin = struct.pack("<HHHHHHII", 0x0809, 16, 0x0600, 0x0005, 0x1CFE, 0x07CD, 0xC1, 0x0306)
    password = struct.pack("<HHHHH", 0x002F, 54, 1, 1, 1) + bytes(range(48))
    (folder / "a.xls").write_bytes(compound_file({"Workbook": (begin + password).ljust(4096, b"\0")}))
    with pytest.raises(DataError, match=r"a\.xls: encrypted; save it without a password"):
        imported(folder, "a.xls")
    with pytest.raises(
        DataError, match=r"no table with force and position was found in it \(.*a\.xls: encrypted; save"
    ):
        propose(folder)


def compound_file(streams: dict[str, bytes]) -> bytes:
    """The container of an encrypted workbook, [MS-CFB] version 3; streams of whole sectors, 4096 bytes or more."""
    end, free, sector = 0xFFFFFFFE, 0xFFFFFFFF, 512
    table, entries, at = [0xFFFFFFFD, end], [_entry("Root Entry", 5, 1, end, 0)], 2
    for number, (name, data) in enumerate(streams.items(), start=1):
        count = len(data) // sector
        entries.append(_entry(name, 2, free, at, len(data), number + 1 if number < len(streams) else free))
        table += [*range(at + 1, at + count), end]
        at += count
    head = bytes.fromhex("d0cf11e0a1b11ae1") + bytes(16) + struct.pack("<HHHHH6x", 0x3E, 3, 0xFFFE, 9, 6)
    head += struct.pack("<IIIIIIIIII", 0, 1, 1, 0, 4096, end, 0, end, 0, 0) + struct.pack("<108I", *[free] * 108)
    allocated = struct.pack("<128I", *table, *[free] * (128 - len(table)))
    return head + allocated + b"".join(entries).ljust(sector, b"\0") + b"".join(streams.values())


def _entry(name: str, kind: int, child: int, start: int, size: int, right: int = 0xFFFFFFFF) -> bytes:
    text = name.encode("utf-16-le")
    head = text.ljust(64, b"\0") + struct.pack("<HBBIII", len(text) + 2, kind, 1, 0xFFFFFFFF, right, child)
    return head + bytes(36) + struct.pack("<IQ", start, size)


def test_an_object_in_a_mat_file_is_named_with_its_class(folder: Path) -> None:
    scipy.io.savemat(folder / "a.mat", {"t": TIME_S, "x": COLUMNS["x"]})
    with (folder / "a.mat").open("ab") as file:
        file.write(matlab_object("F", "timeseries"))
    with pytest.raises(
        DataError, match=r"no column 'F'; .*; F \(a timeseries\) cannot be read; save objects of MATLAB"
    ):
        imported(folder, "a.mat")


def matlab_object(name: str, kind: str) -> bytes:
    """An object as MATLAB keeps it in version 5: class 17, its name, the system of its kind, references elsewhere."""
    references = np.array([0xDD000000, 2, 1, 1, 1, 1], "<u4").tobytes()
    numbers = [(6, struct.pack("<II", 13, 0)), (5, struct.pack("<ii", 6, 1)), (1, b""), (6, references)]
    inner = b"".join(_element(*item) for item in numbers)
    parts = [(6, struct.pack("<II", 17, 0)), (1, name.encode()), (1, b"MCOS"), (1, kind.encode()), (14, inner)]
    return _element(14, b"".join(_element(*item) for item in parts))


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def test_a_cell_array_of_version_7_3_is_named(folder: Path) -> None:
    with h5py.File(folder / "a.mat", "w", userblock_size=512) as file:
        file["t"], file["#refs#/a"] = TIME_S, COLUMNS["F"]
        file.create_dataset("F", data=[file["#refs#/a"].ref] * 2, dtype=h5py.ref_dtype)
    with pytest.raises(DataError, match=r"no column 'F'; there are 't'; F cannot be read"):
        imported(folder, "a.mat")


def test_of_a_folder_of_mixed_kinds_what_is_data_is_taken_and_the_rest_said(folder: Path) -> None:
    write(
        folder,
        {"notes.txt": "Pressed on Monday.\nAll went well.\n", "sub/a.csv": text().replace("t,F,x", "t_s,F_N,x_mm")},
    )
    (folder / "photo.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    (folder / "broken.mat").write_bytes(b"MATLAB 5.0 MAT-file" + bytes(200))
    book = openpyxl.Workbook()
    book["Sheet"].append(["subject", "age"])
    book.save(folder / "subjects.xlsx")
    proposal = propose(folder)
    assert [table["files"] for table in proposal.tree["tables"]] == ["**/*.csv"]
    assert any("broken.mat: not readable as a MAT file" in doubt for doubt in proposal.doubts)


def test_each_file_is_read_in_its_own_unit(folder: Path) -> None:
    write(folder, {"a.csv": "t,F [N],x\n0,1000,0\n1,2000,1\n", "b.csv": "t,F [kN],x\n0,1.5,0\n1,2,1\n"})
    columns = {"force": {"column": 2}, "position": {"column": "x", "unit": "mm"}}
    session = imported(folder, "*.csv", columns=columns)
    found = [session.recording(name).tables["force"]["fz_N"].tolist() for name in "ab"]
    assert found == [[1000.0, 2000.0], [1500.0, 2000.0]]


@pytest.mark.parametrize("files", [{}, {".hidden.csv": "t,F,x\n0,1,1\n"}])
def test_a_folder_without_data_is_one_sentence(folder: Path, files: dict[str, str]) -> None:
    write(folder, files)
    with pytest.raises(DataError, match=r"no file is of the pattern '\*\.csv'; there are none at all"):
        imported(folder, "*.csv")
    with pytest.raises(DataError, match="no table with force and position"):
        propose(folder)


@pytest.fixture(name="shared")
def _shared() -> Iterator[Path]:
    """A folder another user may write to, where this one may read everything as well."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o777)
        (Path(name) / "in").mkdir()
        yield Path(name) / "in"


LOCKABLE: dict[str, Callable[[Path], object]] = {
    **MAKERS,
    "a.csv": lambda path: path.write_text(text()),
    "sub": lambda path: write(path, {"more.csv": text()}),
}


@pytest.mark.parametrize("name", LOCKABLE)
def test_what_may_not_be_read_is_named(shared: Path, name: str) -> None:
    write(shared, {"good.csv": text()})
    locked = shared / name
    LOCKABLE[name](locked)
    locked.chmod(0)
    user = os.geteuid()
    try:
        if user == 0:
            os.seteuid(65534)
        with pytest.raises(DataError, match=rf"{name}: you may not read it; ask its owner"):
            imported(shared, "**/*.csv" if name == "sub" else name)
    finally:
        os.seteuid(user)
        locked.chmod(0o700)


def test_a_long_text_is_read_piece_by_piece(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.intake.text.BLOCK_BYTES", 1 << 14)
    # Of shorter ones all rows are kept until they are looked at.
    monkeypatch.setattr("rig.intake.writing.LONGEST_ROWS", 2_000)
    line = "".join(f"{at / 1000:.3f},{at % 7}.125,{at % 5}.25\n" for at in range(20_000))
    write(folder, {"a.csv": "t,F,x\n" + line})
    said: list[str] = []
    table = {"files": "a.csv", "time": {"column": "t", "unit": "s"}, "columns": {"force": {"column": "F", "unit": "N"}}}
    mapping = parse(DataMapping, {"tables": [table]}, "made")
    tracemalloc.start()
    try:
        session = import_folder(folder, mapping, folder.parent / "out", NOW, lambda text, _: said.append(text))
        peak_B = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert session.trials[0].samples == {"force": 20_000}
    # A row of the recording has 96 bytes: all of them at once would be 1.9 MB.
    assert peak_B < 1.2e6
    assert len(said) > 15
    assert said[-1] == "a: 20000 samples"
