"""Units, scales and senses that stand elsewhere than behind a name are read, or asked; none of them is passed over."""

import json
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from numpy.typing import NDArray

from rig.errors import UsageError
from rig.intake.proposal import propose
from rig.intake.questions import OpenQuestion
from rig.intake.units import unit_of
from rig.recording.sessions import Session
from tests.rig.intake.makers import A, Press, rows
from tests.rig.intake.test_foreign import came_in

FORM, DAYS = "{:.3f},{:.5f},{:.5f}", "Date,Position (mm),Force (N)"
LBF_N = 4.4482216152605  # NIST SP 811


def check(session: Session, *presses: Press) -> None:
    """The recordings hold the presses, in N, mm and s."""
    assert len(session.trials) == len(presses)
    for trial, own in zip(session.trials, presses, strict=True):
        force, axis = (session.recording(trial.name).tables[name] for name in ("force", "axis"))
        assert np.diff(force["capture_ns"]) * 1e-9 == pytest.approx(np.diff(own.time_s), abs=1e-5)
        assert np.diff(axis["capture_ns"]) * 1e-9 == pytest.approx(np.diff(own.time_s), abs=1e-5)
        assert force["fz_N"] == pytest.approx(own.force_N, abs=1e-3, nan_ok=True)
        assert axis["position_mm"] == pytest.approx(own.way_mm, abs=1e-3)


def written(folder: Path, head: str, form: str, *columns: NDArray[np.generic]) -> None:
    (folder / "a.csv").write_text(f"{head}\n{rows(form, *columns)}")


def parquet(folder: Path, whole: dict[str, str], *own: dict[str, str]) -> None:
    fields = [("time", 1e3 * A.time_s), ("force", 1e3 * A.force_N), ("position", 1e3 * A.way_mm)]
    said = [*own, *[{}] * (len(fields) - len(own))]
    schema = [pa.field(name, pa.float64(), metadata=more) for (name, _), more in zip(fields, said, strict=True)]
    table = pa.table([values for _, values in fields], schema=pa.schema(schema, metadata=whole))
    pq.write_table(table, folder / "a.parquet")


def test_units_in_the_metadata_of_a_parquet_file(folder: Path) -> None:
    units = {"time": "ms", "force": "mN", "position": "um"}
    parquet(folder, {"PANDAS_ATTRS": json.dumps({"lab": "x", "units": units})})
    check(came_in(folder), A)


def test_a_key_a_column_in_the_metadata_of_a_parquet_file(folder: Path) -> None:
    parquet(folder, {"time_unit": "ms", "force_unit": "mN", "unit.position": "um"})
    check(came_in(folder), A)


def test_units_of_the_fields_of_a_parquet_file_in_any_case(folder: Path) -> None:
    parquet(folder, {}, {"Unit": "ms"}, {"UNITS": "mN"}, {"unit": "um"})
    check(came_in(folder), A)


def test_packed_numbers_of_netcdf_are_unpacked(folder: Path) -> None:
    """CF conventions 8.1: packed times ``scale_factor`` plus ``add_offset``; 2.5.1: ``_FillValue`` is none."""
    counts = np.round((A.force_N - 1.0) / 5e-4).astype(np.int16)
    counts[100] = -32768
    with h5py.File(folder / "a.nc", "w") as file:
        for name, values, more in (
            ("time", A.time_s, {"units": "s"}),
            ("displacement", np.round(A.way_mm / 2e-4).astype(np.int16), {"units": "mm", "scale_factor": [2e-4]}),
            ("force", counts, {"units": "N", "scale_factor": 5e-4, "add_offset": 1.0, "_FillValue": np.int16(-32768)}),
        ):
            file.create_dataset(name, data=values).attrs.update(more)
    force_N = A.force_N.copy()
    force_N[100] = np.nan
    check(came_in(folder), A._replace(force_N=force_N))


@pytest.mark.parametrize(
    ("names", "units"),
    [(["time", "force", "position"], ["ms", "mN", "um"]), ("time, force, position", "ms, mN, um")],
    ids=["lists", "texts"],
)
def test_units_of_the_columns_of_an_hdf5_matrix(folder: Path, names: object, units: object) -> None:
    with h5py.File(folder / "a.h5", "w") as file:
        made = file.create_dataset("data", data=np.stack([1e3 * column for column in A], axis=1)[:, [0, 2, 1]])
        made.attrs["columns"], made.attrs["column_units"] = names, units
    check(came_in(folder), A)


def matlab_5(folder: Path) -> None:
    more = {"force_unit": "mN", "disp_unit": "um"}
    scipy.io.savemat(folder / "a.mat", {"time": A.time_s, "force": 1e3 * A.force_N, "disp": 1e3 * A.way_mm, **more})


def matlab_73(folder: Path) -> None:
    with h5py.File(folder / "a.mat", "w", userblock_size=512) as file:
        for name, own in (("time", A.time_s), ("force", 1e3 * A.force_N), ("disp", 1e3 * A.way_mm)):
            file.create_dataset(name, data=own[None]).attrs["MATLAB_class"] = np.bytes_("double")
        for name, text in (("force_unit", "mN"), ("disp_unit", "um")):
            letters = np.array([[ord(letter)] for letter in text], np.uint16)
            file.create_dataset(name, data=letters).attrs["MATLAB_class"] = np.bytes_("char")


def time_series(folder: Path) -> None:
    """As MATLAB's ``timeseries`` becomes by ``struct``."""
    units = {"force": (1e3 * A.force_N, "mN"), "disp": (1e3 * A.way_mm, "um")}
    made = {name: {"Time": A.time_s, "Data": own, "DataInfo": {"Units": unit}} for name, (own, unit) in units.items()}
    scipy.io.savemat(folder / "a.mat", made)


@pytest.mark.parametrize("order", [("names", "units"), ("units", "names")])
def test_units_in_a_list_beside_a_matrix_of_matlab(folder: Path, order: tuple[str, str]) -> None:
    lists = {"names": ["time", "disp", "force"], "units": ["ms", "um", "mN"]}
    texts = {name: np.array(lists[name], object) for name in order}
    scipy.io.savemat(folder / "a.mat", {**texts, "data": np.stack([1e3 * own for own in A], axis=1)})
    check(came_in(folder), A)


@pytest.mark.parametrize("write", [matlab_5, matlab_73, time_series], ids=lambda write: write.__name__)
def test_units_in_texts_of_a_matlab_file_are_the_usual_answers(folder: Path, write: Callable[[Path], None]) -> None:
    write(folder)
    assert [question.usual for question in propose(folder).questions] == ["mN", "um"]
    check(came_in(folder, "mN", "um"), A)


def test_an_array_of_channels_that_say_what_they_are_called(folder: Path) -> None:
    channels = np.zeros(3, [(name, object) for name in ("name", "unit", "values")])
    for number, own in enumerate((("Time", "s", A.time_s), ("Force", "mN", 1e3 * A.force_N), ("Weg", "mm", A.way_mm))):
        channels[number] = own
    scipy.io.savemat(folder / "a.mat", {"data": {"channels": channels, "operator": "jk"}})
    check(came_in(folder), A)


@pytest.mark.parametrize(
    ("unit", "force"), [("10^-3 N", 1e3), ("x10 mN", 1e2), ("0.1 N", 10.0), ("1/1000 N", 1e3), ("1e-3 N", 1e3)]
)
def test_so_many_of_a_unit_are_asked_for_their_scale(folder: Path, unit: str, force: float) -> None:
    head = f"Time (s),Position (mm),Force ({unit})"
    written(folder, head, FORM, A.time_s, A.way_mm, force * A.force_N)
    (question,) = propose(folder).questions
    assert f"is in {unit}, which is none of" in question.text
    assert (question.usual, question.line.endswith('scale = "?" }')) == ("", True)
    check(came_in(folder, f"{1 / force}"), A)


def test_so_many_seconds_are_asked_for_their_rate(folder: Path) -> None:
    written(folder, "Time (0.1 s),Position (mm),Force (N)", FORM, 10 * A.time_s, A.way_mm, A.force_N)
    (question,) = propose(folder).questions
    said = "a.csv: time 'Time (0.1 s)' is in 0.1 s, which is none that is known; how many are a second?"
    assert question.text == said
    assert question.line == 'time = { column = "Time (0.1 s)", form = "counter", rate_Hz = "?" }'
    check(came_in(folder, "10"), A)


def test_units_above_the_table_are_those_of_their_columns_and_of_no_other(folder: Path) -> None:
    head = "Load Units,lbf\nDisplacement Units,inch\nTime Units,min\n\nTime,Displacement,Load"
    written(folder, head, "{:.9f},{:.8f},{:.8f}", A.time_s / 60, A.way_mm / 25.4, A.force_N / LBF_N)
    assert [question.usual for question in propose(folder).questions] == ["lbf", "inch"]
    check(came_in(folder, "lbf", "inch"), A)


def test_days_of_a_spreadsheet_in_a_text(folder: Path) -> None:
    written(folder, DAYS, "{:.11f},{:.5f},{:.5f}", 44_259 + A.time_s / 86_400, A.way_mm, A.force_N)
    check(came_in(folder), A)


def test_a_time_that_fits_no_unit_has_no_usual_one(folder: Path) -> None:
    """Days since 1 January 4713 BC, as astronomers count them."""
    written(folder, DAYS, "{:.11f},{:.5f},{:.5f}", 2_459_000 + A.time_s / 86_400, A.way_mm, A.force_N)
    (question,) = propose(folder).questions
    assert (question.usual, question.line) == ("", 'time = { column = "Date", unit = "?" }')


def test_columns_of_labview_with_times_of_their_own(folder: Path) -> None:
    slow = slice(None, None, 2)
    head = "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tMulti\n***End_of_Header***\t\n\t\nChannels\t2\n"
    head += "X_Dimension\tTime\t\tTime\n***End_of_Header***\nX_Value\tForce (N)\tX_Value\tPosition (mm)\n"
    places = [f"{at:.3f}\t{way:.5f}" for at, way in zip(A.time_s[slow], A.way_mm[slow], strict=True)]
    places += ["\t"] * (A.time_s.size - len(places))
    cells = zip(A.time_s, A.force_N, places, strict=True)
    (folder / "a.lvm").write_text(head + "".join(f"{at:.3f}\t{force:.5f}\t{place}\n" for at, force, place in cells))
    tables = came_in(folder).recording("a").tables
    assert tables["force"]["fz_N"] == pytest.approx(A.force_N, abs=1e-4)
    assert tables["axis"]["position_mm"] == pytest.approx(A.way_mm[slow], abs=1e-4)
    assert tables["axis"]["capture_ns"] == pytest.approx(1e9 * A.time_s[slow], abs=10)


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("Prüfzeit in s", "s"), ("time_in_s", "s"), ("Weg in mm", "mm"), ("speed_in_s", "in/s"),
        ("v_vel_in_min", "in/min"), ("Disp./µm", "um"), ("Speed/mm/s", "mm/s"), ("stiffness_N_mm", ""),
        ("Kraft [kp]", "kp"), ("Travel in mm", "mm"), ("generated force in N", "N"), ("Speed in mm", "mm"),
        ("SPEED_IN_S", "in/s"), ("travel_in_s", "s"),
    ],
)  # fmt: skip
def test_the_unit_at_the_end_of_a_name(name: str, unit: str) -> None:
    assert unit_of(name) == unit


def test_a_question_without_a_candidate_shows_a_line_of_that_quantity(folder: Path) -> None:
    question = OpenQuestion("which?", (0,), "position")
    assert question.line == 'columns.position = { column = "?", unit = "?" }'
    with pytest.raises(UsageError, match="is none of the columns"):
        question.value("mm")


def test_whole_numbers_whose_thousands_a_comma_parts(folder: Path) -> None:
    whole = Press(A.time_s, np.round(A.way_mm, 3), np.round(A.force_N, 3))
    head, form = "Time (ms),Position (um),Force (mN)", '"{:,.0f}","{:,.0f}","{:,.0f}"'
    written(folder, head, form, *(1e3 * own for own in whole))
    assert not [doubt for doubt in propose(folder).doubts if "thousands" in doubt]
    check(came_in(folder), whole)


def test_a_comma_before_three_digits_in_each_cell_of_a_column_stays_a_doubt(folder: Path) -> None:
    data = rows("{:.0f};{:.3f};{:.3f}", np.arange(A.time_s.size), 10 + A.way_mm, 20 + A.force_N).replace(".", ",")
    (folder / "a.csv").write_text("Rate (Hz);50\n\nSample;Position (mm);Force (N)\n" + data)
    assert any("it may part thousands" in doubt for doubt in propose(folder).doubts)
    check(came_in(folder), Press(A.time_s, 10 + A.way_mm, 20 + A.force_N))


def test_minutes_and_seconds_with_a_decimal_comma(folder: Path) -> None:
    cells = zip(A.time_s, A.way_mm, A.force_N, strict=True)
    data = "".join(f"00:{at:06.3f};{way:.5f};{force:.5f}\n" for at, way, force in cells).replace(".", ",")
    (folder / "a.csv").write_text("Zeit;Weg (mm);Kraft (N)\n" + data)
    check(came_in(folder), A)
