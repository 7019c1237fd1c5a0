"""Further forms of laboratories that came in wrongly, with too many questions or not at all before they were tried.

Each is written by another library, or letter by letter, and has to come out as the press it was made from.
"""

import decimal
import gzip
import pickle
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from rig.errors import DataError
from rig.intake.mapping import FileForm
from rig.intake.proposal import propose
from rig.intake.readers import open_sheets
from tests.rig.intake.instruments import PRESS, comma, text
from tests.rig.intake.test_foreign import COUNT, FORCE_N, ROWS, TIME_S, WAY_MM, came_in, check, lines

HEAD = "Time (s),Position (mm),Force (N)\n"
# As Cyrillic machines name time, force and way, with the units s, N and mm.
CYRILLIC = "Время, с;Перемещение, мм;Сила, Н\n"
ROW = lines("{:.3f};{:.5f};{:.5f}", TIME_S, WAY_MM, FORCE_N)


def pandas_fixed(folder: Path) -> None:
    """`DataFrame.to_hdf` with its fixed format: the names of a block's columns stand beside its values."""
    with h5py.File(folder / "a.h5", "w") as file:
        group = file.create_group("frame")
        group["axis0"] = np.array([b"note", b"time_s", b"position_mm", b"force_N"])
        group["axis1"] = np.arange(COUNT)
        group["block0_items"] = np.array([b"time_s", b"position_mm", b"force_N"])
        group["block0_values"] = np.column_stack([TIME_S, WAY_MM, FORCE_N])
        group["block1_items"] = np.array([b"note"])
        group["block1_values"] = np.ones((COUNT, 1), np.int8)


def pandas_table(folder: Path) -> None:
    """The same with its table format: PyTables' rows of blocks, an index beside them, and names in pickles."""
    blocks = [("index", np.int64), ("values_block_0", np.float64, (2,)), ("values_block_1", np.int64, (1,))]
    rows = np.zeros(COUNT, blocks)
    rows["index"] = np.arange(COUNT)
    rows["values_block_0"], rows["values_block_1"] = np.column_stack([WAY_MM, FORCE_N]), 1e3 * TIME_S[:, None]
    with h5py.File(folder / "a.h5", "w") as file:
        table = file.create_dataset("run/table", data=rows)
        table.attrs["index_kind"] = np.bytes_(b"integer")
        for number, names in enumerate((["position_mm", "force_N"], ["millis"])):
            table.attrs[f"values_block_{number}_kind"] = np.bytes_(pickle.dumps(names, protocol=0))
        file["run/_i_table/index/sortedLR"], file["run/_i_table/index/indicesLR"] = np.arange(9), np.arange(7)


def channels_with_units(folder: Path) -> None:
    """A struct a channel, with its unit."""
    found = {"Time": (TIME_S, "s"), "Load": (FORCE_N * 1e3, "mN"), "Stroke": (WAY_MM, "mm")}
    channels = {name: {"data": values, "unit": unit} for name, (values, unit) in found.items()}
    scipy.io.savemat(folder / "a.mat", {**channels, "Operator": "x"})


def time_above_channels(folder: Path) -> None:
    """Time in the struct of the recording, and its channels in one below."""
    recording = {"time_s": TIME_S, "channels": {"load_N": FORCE_N, "stroke_mm": WAY_MM}}
    scipy.io.savemat(folder / "a.mat", {"recording": recording})


def decimals(folder: Path) -> None:
    """Numbers of a database, which are no floats."""
    force = pa.array([decimal.Decimal(f"{force:.5f}") for force in FORCE_N])
    pq.write_table(pa.table({"time_s": TIME_S, "force_N": force, "position_mm": WAY_MM}), folder / "a.parquet")


def gaps_in_a_sheet(folder: Path) -> None:
    """A workbook with empty rows between its cycles."""
    book = openpyxl.Workbook()
    book["Sheet"].append(["Time (s)", "Position (mm)", "Force (N)"])
    for row in ROWS[:30]:
        book["Sheet"].append(list(map(float, row)))
    for number, row in enumerate(ROWS[30:], start=35):
        for column, value in enumerate(row, start=1):
            book["Sheet"].cell(number, column, float(value))
    book.save(folder / "a.xlsx")


def with_gaps(folder: Path) -> None:
    """Empty rows between cycles, as a spreadsheet saves them: nothing but separators."""
    rows = PRESS.splitlines(keepends=True)
    text(HEAD, "".join([*rows[:20], ",,\n", *rows[20:40], "\n", ",,\n", *rows[40:]]))(folder)


FORMS: dict[str, Callable[[Path], None]] = {
    "pandas' fixed format": pandas_fixed,
    "pandas' table format": pandas_table,
    "an Arduino's clock, last": text(
        "position_mm,force_N,millis\n", lines("{:.5f},{:.5f},{:.0f}", WAY_MM, FORCE_N, 1e3 * TIME_S)
    ),
    "a struct a channel with its unit": channels_with_units,
    "time above a struct of channels": time_above_channels,
    "decimals in Parquet": decimals,
    "empty rows between cycles": with_gaps,
    "empty rows in a sheet": gaps_in_a_sheet,
    "Cyrillic": text(CYRILLIC, comma(ROW), encoding="cp1251"),
    "micrometres behind a slash": text(
        "Zeit/s;Weg/\u00b5m;Kraft/N\n", lines("{:.3f};{:.2f};{:.5f}", TIME_S, WAY_MM * 1e3, FORCE_N), encoding="cp1252"
    ),
    "an ending of its own": text(HEAD, name="run1.xyz"),
    "no ending": text(HEAD, name="run1"),
    "words for a force beyond the range": text(
        HEAD, PRESS + f"{TIME_S[-1] + 0.02:.3f},2.0,OVERLOAD\n{TIME_S[-1] + 0.04:.3f},2.0,OVLD\n"
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_further_form_comes_in_without_a_question(folder: Path, form: str) -> None:
    FORMS[form](folder)
    session = came_in(folder)
    assert [trial.samples["force"] for trial in session.trials] == [COUNT + 2 * form.startswith("words")]
    if form.startswith("words"):
        force = session.recording("a").tables["force"]
        assert force["fz_N"][:COUNT] == pytest.approx(FORCE_N)
        assert not force["valid"][COUNT:].any()
    else:
        check(session, abs_N=2e-4)


@pytest.mark.parametrize("column", ["repetition", "series_4711"])
def test_a_number_that_changes_where_time_begins_anew_tells_recordings_apart(folder: Path, column: str) -> None:
    rows = [lines(f"arm,{number},{{:.3f}},{{:.5f}},{{:.5f}}", TIME_S, WAY_MM, FORCE_N + number) for number in (1, 2)]
    text(f"site,{column},time_s,position_mm,force_N\n", "".join(rows))(folder)
    session = came_in(folder)
    found = [session.recording(trial.name).tables["force"]["fz_N"] for trial in session.trials]
    assert found == [pytest.approx(FORCE_N + number) for number in (1, 2)]


def test_time_that_begins_anew_below_an_empty_row_is_another_recording(folder: Path) -> None:
    rows = [lines(f"{number},{{:.3f}},{{:.5f}},{{:.5f}}", TIME_S, WAY_MM, FORCE_N + number) for number in (1, 2)]
    text("series,time_s,position_mm,force_N\n", ",,,\n".join(rows))(folder)
    assert [trial.samples["force"] for trial in came_in(folder).trials] == [COUNT, COUNT]


def test_one_name_beside_one_vector_is_no_name_of_it(folder: Path) -> None:
    with h5py.File(folder / "a.h5", "w") as file:
        file["operator"] = np.array([b"time_s"])
        file["time_s"], file["force_N"], file["position_mm"] = TIME_S, FORCE_N, WAY_MM
    check(came_in(folder))


def test_a_time_that_is_missing_is_named_and_no_rate_is_asked(folder: Path) -> None:
    rows = PRESS.splitlines(keepends=True)
    text(HEAD, "".join([*rows[:20], rows[20][rows[20].index(",") :], *rows[21:]]))(folder)
    with pytest.raises(DataError, match=r"a\.csv line 22, column Time \(s\): no time .*write it, or take the row out"):
        came_in(folder)


@pytest.mark.parametrize(
    "write",
    [
        lambda path: path.write_bytes(np.column_stack([TIME_S, WAY_MM, FORCE_N]).tobytes()),
        lambda path: openpyxl.Workbook().save(path),
        lambda path: path.write_bytes((HEAD + PRESS).encode()[:500] + bytes(300)),
    ],
    ids=["numbers as a program holds them", "a workbook by another name", "zeros after a power failure"],
)
def test_bytes_of_no_text_are_one_sentence(folder: Path, write: Callable[[Path], None]) -> None:
    write(folder / "a.dat")
    with pytest.raises(DataError, match=r"a\.dat: its bytes are not those of a text; copy it again, or save it as"):
        propose(folder)


@pytest.mark.parametrize("name", ["a.json", "a.xml", "a.md", "a.py"])
def test_a_text_of_another_kind_is_no_table(folder: Path, name: str) -> None:
    text(HEAD, name=name)(folder)
    with pytest.raises(DataError, match=f"no reader for {name}"):
        propose(folder)


@pytest.mark.parametrize("name", ["a.mat.gz", "a.h5.gz", "a.parquet.gz", "a.mcap.gz"])
def test_arrays_behind_gzip_are_one_sentence_with_a_mapping_and_left_aside_without(folder: Path, name: str) -> None:
    (folder / name).write_bytes(gzip.compress(bytes(200), mtime=0))
    with pytest.raises(DataError, match=r"no reader for \.gz; leave it out of the pattern or unpack it"):
        list(open_sheets(folder / name, FileForm.model_construct(sheets="**/*")))
    text(HEAD + PRESS)(folder)
    assert f"left aside, no reader for them: {name}" in propose(folder).doubts


def test_lines_of_json_behind_gzip_are_those_lines(folder: Path) -> None:
    lines = "".join(f'{{"t_s": {t}, "force_N": {force}, "depth_mm": {way}}}\n' for t, way, force in zip(
        TIME_S, WAY_MM, FORCE_N, strict=True
    ))  # fmt: skip
    (folder / "a.jsonl.gz").write_bytes(gzip.compress(lines.encode(), mtime=0))
    assert propose(folder).tree["tables"][0]["columns"]["force"]["column"] == "force_N"
    ((_, sheet),) = open_sheets(folder / "a.jsonl.gz", FileForm.model_construct(sheets="**/*"))
    assert sheet.header == ("t_s", "force_N", "depth_mm")


def waveforms(folder: Path, **of_the_way: float) -> None:
    """As `TdmsFile.as_hdf` of npTDMS 1.13 lays out channels with waveform properties."""
    own = {"wf_increment": 0.02, "wf_start_offset": 0.0, "wf_samples": TIME_S.size}
    with h5py.File(folder / "a.h5", "w") as file:
        for name, values, unit, more in (("Force", FORCE_N, "N", {}), ("Position", WAY_MM, "mm", of_the_way)):
            dataset = file.create_dataset(f"Measured Data/{name}", data=values)
            dataset.attrs.update({**own, "wf_start_time": "2021-03-04T00:00:00.000000Z", "unit_string": unit, **more})


def test_waveform_properties_say_the_time_of_channels(folder: Path) -> None:
    waveforms(folder)
    check(came_in(folder))


@pytest.mark.parametrize("apart", [{"wf_increment": 0.1}, {"wf_start_offset": 0.1}])
def test_channels_of_other_times_are_not_taken_for_one_table(folder: Path, apart: dict[str, float]) -> None:
    waveforms(folder, **apart)
    with pytest.raises(DataError, match="Force, Position differ in wf_increment or wf_start_offset; save each with a"):
        came_in(folder, "50")
