"""An axis' dynamics as they are kept: what a force law takes of them, and what makes them unfit."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from rig.computer import computer_id
from rig.config.axis_dynamics import TimeEstimate
from rig.config.calibration import Calibration
from rig.config.calibration_files import read_dynamics, text_of, with_files
from rig.errors import UsageError
from tests.calibrations import axis_dynamics

NOW = datetime(2026, 3, 1, 9, 0, tzinfo=UTC)


def test_the_response_counts_hold_filter_and_age_once() -> None:
    known = axis_dynamics(date=NOW, delay=TimeEstimate(s=0.001, within_s=0.0))
    known = known.model_copy(update={"force_age_s": 0.0012})
    found = known.response
    # 1 ms, half a cycle of 1 kHz, half a sample of 1 kHz, and 1.2 ms until the loop looks.
    assert found.delay_s == pytest.approx(0.001 + 0.0005 + 0.0005 + 0.0012)
    assert (found.lag1_s, found.lag2_s) == (0.0025, 0.0037)
    assert found.tip_lag_s == pytest.approx(0.001 + 0.0005 + 0.0062)


def test_a_file_is_read_as_it_was_written_and_named_by_the_wiring(tmp_path: Path) -> None:
    known, file = axis_dynamics(date=NOW), tmp_path / "dynamics.json"
    file.write_text(text_of(known))
    assert read_dynamics(file) == known
    assert with_files(Calibration(dynamics=file)).of_dynamics == known
    with pytest.raises(UsageError, match="no such file; run `rig calibrate`"):
        with_files(Calibration(dynamics=tmp_path / "other.json"))
    file.write_text(text_of(known).replace('"gain"', '"gian"'))
    with pytest.raises(UsageError, match=r"gian.*gain"):
        read_dynamics(file)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"gain": -1.0}, r"have a gain of -1 \(bounds 1 \+- 0.05\)"),
        ({"gain": 1.06}, r"have a gain of 1.06"),
        ({"coherence": 0.7}, r"are coherent to 0.70 only \(bound 0.9\)"),
        ({"misfit": 0.2}, r"are no delay and two lags: 20.0 % off \(bound 10 %\)"),
        ({"delay": TimeEstimate(s=0.002, within_s=0.0011)}, r"delay 2.00 \+- 1.10 ms \(bound \+- 1 ms\)"),
        ({"total": TimeEstimate(s=0.007, within_s=0.0006)}, r"delay and lags 7.00 \+- 0.60 ms \(bound \+- 0.5 ms\)"),
    ],
)
def test_what_says_too_little_is_unfit_with_number_and_bound(changes: dict[str, object], sentence: str) -> None:
    assert Calibration(of_dynamics=axis_dynamics(date=NOW)).unfit(NOW) == []
    [reason] = Calibration(of_dynamics=axis_dynamics(date=NOW).model_copy(update=changes)).unfit(NOW)
    with pytest.raises(UsageError, match=sentence):
        raise UsageError(reason)


def test_an_old_one_is_unfit_and_names_the_command() -> None:
    [reason] = Calibration(of_dynamics=axis_dynamics(date=NOW)).unfit(NOW + timedelta(days=400))
    assert "400 days old, calibration.max_age_days is 365" in reason
    assert "`rig calibrate axis --dynamics`" in reason


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"computer": "lab-7-0badcafe"}, f"were identified on lab-7-0badcafe, this is {computer_id()}"),
        ({"rate_Hz": 500.0}, "were identified at 500 Hz, loop.rate_Hz is 1000"),
        ({"force_product": "robotiq-ft300"}, "beside a robotiq-ft300, force.product is bota-sensone"),
    ],
)
def test_one_of_another_loop_does_not_hold_here(changes: dict[str, object], sentence: str) -> None:
    here = (computer_id(), 1000.0, "bota-sensone")
    assert axis_dynamics().elsewhere(*here) == []
    [reason] = axis_dynamics().model_copy(update=changes).elsewhere(*here)
    assert sentence in reason


def test_a_computer_is_told_from_another_by_the_machines_number(tmp_path: Path) -> None:
    one, other, none = tmp_path / "one", tmp_path / "other", tmp_path / "none"
    one.write_text("6e1f\n")
    other.write_text("77aa\n")
    assert computer_id(one) == computer_id(one)
    assert len({computer_id(one), computer_id(other), computer_id(none)}) == 3
