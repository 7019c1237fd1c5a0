"""Times as days since year 0, in two columns of which one is whole seconds, and in a unit that nobody knows.

The numbers of days are MATLAB's own: datenum(1970, 1, 1) is 719529 and datenum(2000, 1, 1) is 730486, by its manual.
"""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from rig.config.table import parse
from rig.intake.mapping import DataMapping
from rig.intake.proposal import propose
from rig.intake.session import import_folder
from tests.rig.intake.instruments import text
from tests.rig.intake.test_foreign import COUNT, FORCE_N, TIME_S, WAY_MM, came_in, check, lines
from tests.rig.recording.measured import NOW

DAY_S, SECOND_NS = 86_400.0, 1_000_000_000
NOON_2000 = 730_486.5
AT_NOON_NS = int(datetime(2000, 1, 1, 12, tzinfo=UTC).timestamp()) * SECOND_NS
CLOCK = [datetime(2026, 3, 1, 10, 3, 29) + timedelta(seconds=float(t)) for t in TIME_S + 0.4]
WHOLE = {
    "stamps": ("Time,ms", [f"{at:%H:%M:%S}" for at in CLOCK], 1e3),
    "days and stamps": ("Timestamp,Milliseconds", [f"{at:%d.%m.%Y %H:%M:%S}" for at in CLOCK], 1e3),
    "ISO": ("timestamp,time_us", [f"{at:%Y-%m-%dT%H:%M:%S}" for at in CLOCK], 1e6),
    "seconds": ("Time (s),Time (ms)", [str(int(t + 0.4)) for t in TIME_S], 1e3),
    "without a unit": ("Time,msec", [str(1_772_359_409 + int(t + 0.4)) for t in TIME_S], 1e3),
}  # fmt: skip


@pytest.mark.parametrize("name", ["time", "datenum", "t"])
def test_days_since_year_0_are_told_from_others(folder: Path, name: str) -> None:
    days = NOON_2000 + TIME_S / DAY_S
    vectors = {name: days, "position_mm": WAY_MM, "force_N": FORCE_N}
    scipy.io.savemat(folder / "a.mat", {key: column[:, None] for key, column in vectors.items()})
    assert propose(folder).tree["tables"][0]["time"] == {"column": name, "form": "datenum"}
    session = came_in(folder)
    at_ns = session.recording("a").tables["force"]["capture_ns"]
    assert at_ns[0] == AT_NOON_NS
    assert (at_ns - at_ns[0]) * 1e-9 == pytest.approx(TIME_S, abs=2e-5)  # 64 bits tell 10 us of such a day


def test_a_mapping_names_days_since_year_0(folder: Path, tmp_path: Path) -> None:
    text("day,mm,N\n", lines("{:.10f},{:.5f},{:.5f}", NOON_2000 + TIME_S / DAY_S, WAY_MM, FORCE_N))(folder)
    time = {"column": "day", "form": "datenum"}
    columns = {"force": {"column": "N", "unit": "N"}, "position": {"column": "mm", "unit": "mm"}}
    mapping = parse(DataMapping, {"tables": [{"files": "*.csv", "time": time, "columns": columns}]}, "made")
    session = import_folder(folder, mapping, tmp_path / "out", NOW)
    assert session.recording("a").tables["axis"]["capture_ns"][0] == AT_NOON_NS


@pytest.mark.parametrize("form", WHOLE)
def test_whole_seconds_and_a_column_of_the_rest_are_one_time(folder: Path, form: str) -> None:
    names, whole, parts = WHOLE[form]
    rest = np.round((TIME_S + 0.4) % 1 * parts)
    rows = zip(whole, rest, WAY_MM, FORCE_N, strict=True)
    text(f"{names},Position (mm),Force (N)\n", "".join(f"{a},{b:.0f},{c:.5f},{d:.5f}\n" for a, b, c, d in rows))(folder)
    session = came_in(folder)
    assert len(session.trials) == 1
    check(session)


@pytest.mark.parametrize("other", ["latency (ms)", "Duration_ms"])
def test_what_is_no_rest_of_a_second_is_left_alone(folder: Path, other: str) -> None:
    rows = lines("{:.2f},{:.0f},{:.5f},{:.5f}", TIME_S, np.arange(COUNT) % 7, WAY_MM, FORCE_N)
    text(f"Time (s),{other},Position (mm),Force (N)\n", rows)(folder)
    assert propose(folder).tree["tables"][0]["time"] == {"column": "Time (s)", "unit": "s"}


@pytest.mark.parametrize(("said", "rate"), [("Ticks", "50"), ("1/50 s", "50"), ("s", ""), ("Seconds (s)", "")])
def test_a_line_of_units_above_that_nobody_knows_is_asked(folder: Path, said: str, rate: str) -> None:
    times = TIME_S * (50 if rate else 1)
    text(f"Time Units,{said}\nTime,Position (mm),Force (N)\n", lines("{:.2f},{:.5f},{:.5f}", times, WAY_MM, FORCE_N))(
        folder
    )
    questions = propose(folder).questions
    assert [said in question.text and question.usual == "" for question in questions] == [True] * bool(rate)
    check(came_in(folder, *[rate] * bool(rate)))


@pytest.mark.parametrize("parts", [True, False])
def test_a_zone_behind_a_blank_is_a_zone(folder: Path, parts: bool) -> None:
    times = TIME_S if parts else np.arange(COUNT)
    stamps = [(datetime(2000, 1, 1, 13) + timedelta(seconds=float(at))).isoformat(" ") for at in times]
    stamps = [f"{at if '.' in at or not parts else at + '.0'} +0100" for at in stamps]
    rows = "".join(f"{at};{way:.5f};{force:.5f}\n" for at, way, force in zip(stamps, WAY_MM, FORCE_N, strict=True))
    text("Date Time;Stroke (mm);Load (N)\n", rows)(folder)
    at_ns = came_in(folder).recording("a").tables["force"]["capture_ns"]
    assert at_ns[0] == AT_NOON_NS
    assert (at_ns - at_ns[0]) * 1e-9 == pytest.approx(times)


def test_coarse_noise_in_the_air_is_no_end_of_a_range(folder: Path) -> None:
    place_mm = np.interp(np.arange(600), [0, 300, 600], [0, 9.5, 0])
    force_N = 0.5 * np.maximum(place_mm - 1.5, 0) + np.random.default_rng(1).normal(0, 0.0003, 600)
    rows = lines("{:.2f},{:+.3f},{:.3f}", np.arange(600) * 0.02, force_N, place_mm)
    text("Time (s),Force (N),Disp (mm)\n", rows)(folder)
    assert not [doubt for doubt in propose(folder).doubts if "its largest" in doubt]
