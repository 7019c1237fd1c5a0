"""Pictures of a loop show the loop: gain, phase that begins at -180 degrees, and sensitivity at known points."""

import numpy as np
import pytest

from rig.report.loop_figures import bode_figure, nyquist_figure

FREQUENCY_HZ = np.geomspace(0.1, 100.0, 200)
S = 2j * np.pi * FREQUENCY_HZ
# Two integrals and a lead: 180 degrees of lag at low frequencies, 90 at high ones.
LOOP = 50.0 * (1 + S / 10.0) / S**2


def test_gain_and_phase_are_drawn_over_frequency() -> None:
    gain, phase = bode_figure(FREQUENCY_HZ, {"1 N": LOOP}).axes
    np.testing.assert_allclose(np.asarray(gain.lines[0].get_ydata(), dtype=np.float64), np.abs(LOOP))
    degrees = np.asarray(phase.lines[0].get_ydata())
    assert degrees[0] == pytest.approx(-180.0 + np.degrees(np.arctan(2 * np.pi * 0.1 / 10.0)))
    assert degrees[-1] == pytest.approx(-90.0, abs=1.0)


def test_the_curve_passes_minus_1_at_the_distance_that_sensitivity_says() -> None:
    plane, sensitivity = nyquist_figure(FREQUENCY_HZ, {"1 N": LOOP}).axes
    curve = next(line for line in plane.lines if line.get_label() == "1 N")
    distance = np.hypot(np.asarray(curve.get_xdata()) + 1, np.asarray(curve.get_ydata()))
    np.testing.assert_allclose(1 / distance, np.asarray(sensitivity.lines[0].get_ydata(), dtype=np.float64))
