"""What is read from a recorded run: jumps with settling and overshoot, and how well a moving reference was followed."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from controller.experiments import comparison, tracking
from controller.experiments.comparison import compared_run, study_levels
from controller.loop.modes import Mode
from mock_devices.testing.models import index_model
from rig.errors import DataError
from rig.results.tables import run_table, study_table

Column = NDArray[np.float64]
TIME_S = np.arange(3000, dtype=np.float64) * 1e-3
CONTACT = np.full(3000, int(Mode.CONTACT))
STEP_N = np.where(TIME_S < 1.0, 1.0, 2.0)


def after(response: Column) -> Column:
    """1 N, then from 1 s on 1 N plus ``response`` of the time since, shape (2000,)."""
    return np.concatenate([np.ones(1000), 1.0 + response])


def test_a_first_order_rise_settles_after_four_time_constants_without_overshoot() -> None:
    rise = 1 - np.exp(-TIME_S[:2000] / 0.05)
    (jump,) = comparison.jumps(TIME_S, STEP_N, after(rise), CONTACT)
    assert (jump.from_N, jump.to_N) == (1.0, 2.0)
    assert jump.settling_s == pytest.approx(0.05 * math.log(50), abs=0.003)
    assert jump.overshoot_percent < 0.01
    assert abs(jump.error_N) < 1e-6


def test_overshoot_is_in_percent_of_the_jump_and_error_in_percent_of_the_force() -> None:
    response = np.where(TIME_S[:2000] < 0.1, 1.3, 1.01)
    (jump,) = comparison.jumps(TIME_S, STEP_N, after(response), CONTACT)
    assert jump.overshoot_percent == pytest.approx(30.0)
    assert jump.error_N == pytest.approx(0.01)
    assert jump.error_percent == pytest.approx(0.5)
    assert jump.settling_s == pytest.approx(0.1, abs=0.006)


def test_a_jump_down_overshoots_downwards() -> None:
    (jump,) = comparison.jumps(TIME_S, 3.0 - STEP_N, 3.0 - after(np.full(2000, 1.1)), CONTACT)
    assert jump.overshoot_percent == pytest.approx(10.0)


def test_force_that_leaves_the_band_again_has_not_settled() -> None:
    swinging = 1.0 + 0.05 * np.sin(2 * np.pi * TIME_S[:2000])
    (jump,) = comparison.jumps(TIME_S, STEP_N, after(swinging), CONTACT)
    run = compared_run("firm", (jump,))
    assert jump.settling_s is None
    assert run.worst.settling_s is None
    assert run_table([run]).rows[0][5] == "–"


def test_the_response_to_the_next_jump_does_not_count_as_error_of_this_one() -> None:
    stairs_N = np.where(TIME_S < 2.0, STEP_N, 3.0)
    first, second = comparison.jumps(TIME_S, stairs_N, stairs_N, CONTACT)
    assert max(first.largest_error_N, second.largest_error_N) < 1e-12


def test_a_recording_without_a_jump_is_refused() -> None:
    with pytest.raises(DataError, match="no jump of the reference force"):
        comparison.jumps(TIME_S, np.ones(3000), np.ones(3000), CONTACT)


def test_the_studys_table_has_the_error_in_newtons_percent_and_millimetres_of_the_tip() -> None:
    """On 2 N/mm at every depth, 0.01 N are 5 um."""
    jumps = comparison.jumps(TIME_S, STEP_N, after(np.full(2000, 1.01)), CONTACT)
    (level,) = levels = study_levels(jumps, index_model(2.0, 0.0, 0.01))
    assert (level.given_N, level.actual_N, level.error_percent) == pytest.approx((2.0, 2.01, 0.5))
    assert level.position_error_mm == pytest.approx(0.005)
    table = study_table([compared_run("firm", jumps, levels)])
    assert list(table.rows[0]) == ["firm", "2.00", "2.010", "+0.010", "+0.50", "0.005"]


def test_amplitude_and_lag_of_a_sine_are_found() -> None:
    reference_N = 2.0 + 0.5 * np.sin(2 * np.pi * 5.0 * TIME_S)
    force_N = 2.0 + 0.45 * np.sin(2 * np.pi * 5.0 * (TIME_S - 0.01))
    found = tracking.followed(TIME_S, reference_N, force_N, CONTACT)
    assert found.amplitude_ratio == pytest.approx(0.9, abs=0.005)
    assert found.lag_s == pytest.approx(0.01, abs=0.0005)


def test_a_reference_at_rest_has_no_amplitude() -> None:
    found = tracking.followed(TIME_S, np.full(3000, 2.0), np.full(3000, 2.1), CONTACT)
    assert found.amplitude_ratio is None
    assert found.rms_error_N == pytest.approx(0.1)
