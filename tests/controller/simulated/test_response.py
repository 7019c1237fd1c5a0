"""The simulated axis' response, found anew by sines, and fitted by a delay and two lags."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from controller.simulated.bench import MOTOR, POSITION_LOOP, SENSING
from controller.simulated.segments import hold_compiled
from mock_devices.testing.made.subjects import RESPONSE, SLOW_RESPONSE
from rig.simulation.axis_plant import ForceSensing, ModelledLimb, at_rest

Column = NDArray[np.float64]
FREQUENCIES_HZ = np.array([1, 2, 3, 5, 8, 10, 15, 20, 25, 30, 40, 50, 60])
SPRING = ModelledLimb(np.array([0.0, 100.0]), np.array([0.0, 100.0]), 0.0)


def response(frequency_Hz: int, sensing: ForceSensing) -> tuple[complex, complex]:
    """Set-point to force sensed and to tip, on 1 N/mm without dry friction, from whole turns of a sine."""
    motor, hold, state = MOTOR._replace(coulomb_N_m=0.0), hold_compiled(), at_rest(25.0)
    swing_mm = 0.2 * np.sin(2 * np.pi * frequency_Hz * np.arange(3000) * 1e-3)
    forces_N, places_mm = np.empty(3000), np.empty(3000)
    for cycle, mm in enumerate(swing_mm):
        forces_N[cycle], places_mm[cycle] = state.sensed_N, state.position_mm
        state = hold(state, motor, POSITION_LOOP, SPRING, sensing, 25.0 + mm, 8)
    turn = np.exp(-2j * np.pi * frequency_Hz * np.arange(1000) * 1e-3)
    given, felt, there = (complex(np.sum(values[-1000:] * turn)) for values in (swing_mm, forces_N, places_mm))
    return felt / given * np.exp(-2j * np.pi * frequency_Hz * 1e-3 * sensing.delay_cycles), there / given


def fitted(sensing: ForceSensing, up_to_Hz: float) -> tuple[float, float, float]:
    frequencies_Hz = FREQUENCIES_HZ[up_to_Hz >= FREQUENCIES_HZ]
    found = np.array([response(int(frequency_Hz), sensing)[0] for frequency_Hz in frequencies_Hz])
    s = 2j * np.pi * frequencies_Hz

    def error(values: Column) -> Column:
        ratio = np.exp(-s * values[0]) / ((1 + s * values[1]) * (1 + s * values[2])) / found - 1
        return np.concatenate([ratio.real, ratio.imag])

    delay_s, one_s, other_s = least_squares(error, np.array([0.002, 0.002, 0.004])).x
    return delay_s, min(one_s, other_s), max(one_s, other_s)


def test_the_axis_with_the_fast_sensor_answers_as_the_laws_of_these_tests_are_told() -> None:
    assert fitted(SENSING, 60.0) == pytest.approx(RESPONSE[:3], abs=0.0002)
    assert -np.angle(response(2, SENSING)[1]) / (2 * np.pi * 2) == pytest.approx(RESPONSE.tip_lag_s, abs=0.0001)


def test_the_axis_with_the_slow_sensor_answers_as_the_laws_of_these_tests_are_told() -> None:
    slow = SENSING._replace(filter_s=0.003, delay_cycles=4)
    delay_s, one_s, other_s = fitted(slow, 25.0)
    assert delay_s + one_s + other_s == pytest.approx(SLOW_RESPONSE.lag_s, abs=0.0003)
    assert delay_s == pytest.approx(SLOW_RESPONSE.delay_s, abs=0.0006)
