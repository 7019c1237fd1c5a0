"""A drive axis is read in the units its makers count in, and refused where something of it is missing."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest

from rig.config.table import parse
from rig.errors import DataError
from rig.intake.axis import Array, AxisData, AxisUnits, read_axis
from rig.intake.mapping import DataMapping

Facts = Mapping[str, object]
TIME_S = np.arange(40, dtype=np.float64) * 0.01
PLACE, EFFORT = np.sin(TIME_S), np.cos(3 * TIME_S)


def written(folder: Path, name: str, **columns: Array) -> None:
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(folder / name, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")


def read(
    folder: Path, columns: Mapping[str, Facts], only: str = "", lever_mm: float | None = None, effort: str = "force"
) -> AxisData:
    table = {"files": "*.csv", "time": {"column": "t", "unit": "s"}, "columns": columns}
    lever = {} if lever_mm is None else {"lever_mm": lever_mm}
    mapping = parse(DataMapping, {"tables": [table | lever], "axis": {"effort": effort}}, "mapping")
    return read_axis(folder, mapping, only)


@pytest.mark.parametrize(
    ("place", "drive", "lever_mm", "factors", "units"),
    [
        ({"unit": "m"}, {"unit": "kN"}, None, (1, 1), AxisUnits("m", "kN")),
        ({"scale": 2.0}, {"scale": 35.0}, None, (2, 35), AxisUnits("mm", "N")),
        ({"unit": "deg"}, {"unit": "N m"}, 80.0, (1, 1), AxisUnits("deg", "N m")),
        ({"scale": 2.0}, {"scale": 3.0}, 500.0, (0.004, 1.5), AxisUnits("rad", "N m")),
    ],
    ids=["stated", "scaled", "turning", "turning-scaled"],
)
def test_positions_and_efforts_stay_in_their_units(
    tmp_path: Path, place: Facts, drive: Facts, lever_mm: float | None, factors: tuple[int, int], units: AxisUnits
) -> None:
    written(tmp_path, "a.csv", t=TIME_S, x=PLACE, u=EFFORT)
    columns: dict[str, Facts] = {"position": {"column": "x", **place}, "force": {"column": "u", **drive}}
    found = read(tmp_path, columns, lever_mm=lever_mm)
    assert found.units == units
    assert found.recordings[0].position == pytest.approx(factors[0] * PLACE, abs=1e-9)
    assert found.recordings[0].effort == pytest.approx(factors[1] * EFFORT, abs=1e-9)
    assert found.recordings[0].time_s == pytest.approx(TIME_S)


def test_set_point_and_second_encoder_are_in_the_position_s_unit(tmp_path: Path) -> None:
    written(tmp_path, "a.csv", t=TIME_S, x=PLACE, u=EFFORT, r=1e3 * PLACE, l=1e6 * PLACE, p=EFFORT)
    columns: dict[str, Facts] = {
        "position": {"column": "x", "unit": "m"}, "force": {"column": "u", "unit": "N"},
        "setpoint": {"column": "r", "unit": "mm"}, "load_position": {"column": "l", "unit": "um"},
        "excitation": {"column": "p", "scale": 2.0},
    }  # fmt: skip
    (recording,) = read(tmp_path, columns).recordings
    assert recording.setpoint == pytest.approx(PLACE, abs=1e-9)
    assert recording.load_position == pytest.approx(PLACE, abs=1e-9)
    assert recording.excitation == pytest.approx(2 * EFFORT, abs=1e-9)


def test_a_current_may_drive_and_a_speed_may_move(tmp_path: Path) -> None:
    written(tmp_path, "a.csv", t=TIME_S, v=np.full(40, 60.0), i=EFFORT)
    columns = {"velocity": {"column": "v", "unit": "r/min"}, "current": {"column": "i", "unit": "A"}}
    found = read(tmp_path, columns, lever_mm=30.0, effort="current")
    assert found.units == AxisUnits("rad", "A")
    assert found.recordings[0].position == pytest.approx(2 * np.pi * TIME_S, abs=1e-6)


PLAIN: Mapping[str, Facts] = {"position": {"column": "x", "unit": "mm"}, "force": {"column": "u", "unit": "N"}}


def test_copies_count_once_and_only_chooses(tmp_path: Path) -> None:
    for name, way in (("a", PLACE), ("b", PLACE), ("c", 2 * PLACE)):
        written(tmp_path, f"{name}.csv", t=TIME_S, x=way, u=EFFORT)
    assert [recording.name for recording in read(tmp_path, PLAIN).recordings] == ["a", "c"]
    assert [recording.name for recording in read(tmp_path, PLAIN, only="b*").recordings] == ["b"]
    with pytest.raises(DataError, match="no recording's name is of the pattern 'z'"):
        read(tmp_path, PLAIN, only="z")


def test_an_axis_without_effort_or_motion_is_refused(tmp_path: Path) -> None:
    written(tmp_path, "a.csv", t=TIME_S, x=PLACE, u=EFFORT)
    with pytest.raises(DataError, match="recording a holds no force; name its column in the mapping"):
        read(tmp_path, {"position": PLAIN["position"]})
    with pytest.raises(DataError, match="recording a holds no position; name its column in the mapping"):
        read(tmp_path, {"force": PLAIN["force"]})
