"""The benchmark of contact says no to a surface that is off, and to intervals that promise too much."""

import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import contact
from benchmarks.contact import LIMBS, OTHERS, PHANTOM, SENSORS, Row, missed, totals
from mock_devices.testing.limb_bench import Limb

SOFT = Limb(0.05, 0.0, 0.0)
COUNT = 40


def rows(
    sensor: str = "", limb: Limb = PHANTOM, error_mm: float = 0.14, within_mm: float = 0.15, lost: int = 0
) -> list[Row]:
    """Good figures of both sensors; of ``sensor`` on ``limb`` the last error, its interval and how many missed."""
    good = Row("", PHANTOM, np.full(COUNT, 0.05), np.ones(COUNT, bool), np.full(COUNT, 0.15))
    bad = replace(
        good,
        errors_mm=np.append(good.errors_mm[1:], error_mm),
        held=np.arange(COUNT) >= lost,
        within_mm=np.append(good.within_mm[1:], within_mm),
    )
    return [
        replace(bad if (name, each) == (sensor, limb) else good, sensor=name, limb=each)
        for name in SENSORS
        for each in LIMBS
    ]


def test_good_figures_are_let_pass() -> None:
    assert missed(rows()) == []
    found = totals(rows())
    assert (found["approaches"], found["known"], found["interval_holds"]) == (560, 560, 1.0)
    assert 0.993 < found["low"] < 0.994 and found["high"] == 1.0


@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("error_mm", [0.201, -0.201, float("nan")])
def test_a_surface_that_is_off_by_more_than_depth_is_promised_to_is_told(sensor: str, error_mm: float) -> None:
    for limb in LIMBS:
        (said,) = missed(rows(sensor, limb, error_mm))
        assert said.startswith(f"{sensor} on {limb.a_N_mm:g}, ") and said.endswith("mm, not by 0.2 mm at most")


@pytest.mark.parametrize("sensor", SENSORS)
def test_where_the_trial_says_itself_that_it_is_not_known_it_may_be_off_but_not_on_the_mock_benchs_limb(
    sensor: str,
) -> None:
    assert missed(rows(sensor, SOFT, error_mm=0.3, within_mm=0.4)) == []
    (said,) = missed(rows(sensor, PHANTOM, error_mm=0.3, within_mm=0.4))
    assert said == f"{sensor} on 0.12, 0.22, 0.01: off by 0.300 mm, not by 0.2 mm at most"


@pytest.mark.parametrize("sensor", SENSORS)
def test_intervals_that_hold_the_surface_less_often_than_they_say_are_told(sensor: str) -> None:
    assert missed(rows(sensor, SOFT, lost=14)) == []
    assert missed(rows(sensor, SOFT, lost=15)) == [
        f"{sensor}: 0.946 of the intervals held the surface, not 0.95 as they say"
    ]


@pytest.mark.parametrize("sensor", SENSORS)
def test_a_sensor_that_made_no_approach_is_told(sensor: str) -> None:
    assert missed([row for row in rows() if row.sensor != sensor]) == [f"{sensor}: made no approach"]


@pytest.mark.parametrize(("error_mm", "code"), [(0.14, 0), (0.25, 1)])
def test_the_command_ends_with_1_and_an_object(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error_mm: float, code: int
) -> None:
    found = {(row.sensor, row.limb): row for row in rows("robotiq-ft300", PHANTOM, error_mm)}
    monkeypatch.setattr(contact, "approaches", lambda name, limb, _count: found[name, limb])
    monkeypatch.setattr("sys.argv", ["contact"])
    assert contact.main() == code
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert last["ok"] is (code == 0) and last["largest_error_known_mm"] == error_mm and len(last["missed"]) == code


def test_real_approaches_with_either_sensor_are_good(capsys: pytest.CaptureFixture[str]) -> None:
    made: Sequence[Row] = [contact.approaches(sensor, PHANTOM, 2) for sensor in SENSORS]
    assert missed(made) == []
    assert len(capsys.readouterr().out.splitlines()) == len(SENSORS)
    assert OTHERS[0].force_N(4.0, 0.0) == pytest.approx(0.15 * 8.0)
