"""The open loop over frequency, with python-control as the judge, and in closed form."""

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.law.loop_response import (
    Constants,
    Rates,
    TrueTissue,
    common,
    grid,
    margins,
    noise_share,
    open_loop,
    tissue_ratio,
)
from rig.config.axis_response import AxisResponse

AXIS = AxisResponse(0.002, 0.0025, 0.0037, 0.0067)
FAST = Rates(0.001, 0.001)
AS_TOLD = TrueTissue(100.0, 1.0, 1.0)


def discrete(axis: AxisResponse, law: Constants, tissue: TrueTissue, sample_s: float) -> control.TransferFunction:
    """The law as difference equations, the axis as Pade and two lags: exact at frequencies far below the rate's."""
    z = control.tf([1.0, 0.0], [1.0], sample_s)
    step = (1 - 1 / z) / sample_s
    tissue_side = 1 / (tissue.corner_rad_s + step)  # of w, with B' = 1
    return law.crossover_rad_s * (1 + law.lead_s * step) ** 2 * tissue_side * (1 + law.drift_rad_s / step) / step


def physical(axis: AxisResponse, tissue: TrueTissue) -> control.TransferFunction:
    delay = control.tf(*control.pade(axis.delay_s, 6))
    lags = control.tf([1.0], [axis.lag1_s, 1.0]) * control.tf([1.0], [axis.lag2_s, 1.0])
    return control.tf([tissue.damping, tissue.stiffness * tissue.corner_rad_s], [1.0]) * lags * delay


@settings(deadline=None, max_examples=30)
@given(
    st.floats(20, 120), st.floats(0, 0.006), st.floats(1, 40), st.floats(10, 500), st.floats(0.5, 2), st.floats(0.5, 2)
)
def test_the_open_loop_is_the_one_of_python_control(
    crossover: float, lead_s: float, drift: float, corner: float, stiffness: float, damping: float
) -> None:
    law, tissue = Constants(crossover, lead_s, drift), TrueTissue(corner, stiffness, damping)
    omega = np.geomspace(0.5, 1000.0, 30)
    theirs = discrete(AXIS, law, tissue, 0.001)(np.exp(1j * omega * 0.001)) * physical(AXIS, tissue)(1j * omega)
    np.testing.assert_allclose(open_loop(AXIS, FAST, law, tissue, omega), theirs, rtol=1e-3)


@pytest.mark.parametrize("stiffness", [0.5, 1.0, 2.0])
def test_margins_are_those_of_python_control(stiffness: float) -> None:
    law, tissue = Constants(70.0, 0.004, 20.0), TrueTissue(100.0, stiffness, 1.0)
    omega = grid(FAST, 1000)
    loop = open_loop(AXIS, FAST, law, tissue, omega)
    found = margins(loop[None, :], omega)
    data = control.frd(loop, omega)
    gain, phase, _, crossover = control.margin(data)
    assert found.crossover_rad_s[0] == pytest.approx(crossover, rel=1e-3)
    assert found.phase_deg[0] == pytest.approx(phase, abs=0.1)
    assert found.gain[0] == pytest.approx(gain, rel=0.01)


def test_a_pure_integral_with_delay_has_the_margins_of_the_textbook() -> None:
    """L = wc exp(-s D) / s: 90 - wc D degrees, pi / (2 wc D)."""
    omega = np.geomspace(0.1, 3000.0, 2000)
    loop = (20.0 * np.exp(-1j * omega * 0.01) / (1j * omega))[None, :]
    found = margins(loop, omega)
    assert found.crossover_rad_s[0] == pytest.approx(20.0, rel=1e-6)
    assert found.phase_deg[0] == pytest.approx(90.0 - math.degrees(0.2), abs=0.01)
    assert found.gain[0] == pytest.approx(math.pi / 2 / 0.2, rel=1e-3)


def test_an_unstable_loop_has_a_phase_margin_below_0() -> None:
    omega = np.geomspace(0.1, 3000.0, 2000)
    loop = (200.0 * np.exp(-1j * omega * 0.01) / (1j * omega))[None, :]
    assert margins(loop, omega).phase_deg[0] < 0


def test_two_integrals_that_begin_at_minus_180_degrees_count_as_that_and_not_as_180() -> None:
    omega = np.geomspace(0.1, 1000.0, 2000)
    loop = (100.0 * (1 + 1j * omega / 10.0) / (1j * omega) ** 2)[None, :]
    crossover = margins(loop, omega).crossover_rad_s[0]
    assert margins(loop, omega).phase_deg[0] == pytest.approx(math.degrees(math.atan(crossover / 10.0)), abs=0.01)


@given(st.floats(5, 600))
def test_where_tissue_is_as_told_every_tissue_is_the_same_plant(corner: float) -> None:
    """k + B s over k + B (1 - 1/z) / t is 1 but for the sampling: the loop does not see which tissue it is."""
    omega = np.geomspace(1.0, 200.0, 50)
    ratio = tissue_ratio(AS_TOLD._replace(corner_rad_s=corner), FAST, omega)
    assert np.all(np.abs(ratio - 1) < 0.5 * 200.0 * 0.001 + 1e-3)


@pytest.mark.parametrize("sample_s", [0.002, 0.005, 0.01])
def test_a_slower_sensor_delays_by_half_of_what_its_samples_are_apart_more(sample_s: float) -> None:
    omega = np.array([2.0])
    slow, fast = (common(AXIS, Rates(0.001, each_s), 0.0, omega) for each_s in (sample_s, 0.001))
    assert float(np.angle(fast / slow)[0]) / 2.0 == pytest.approx(0.5 * (sample_s - 0.001), rel=1e-3)


def test_noise_through_a_slow_integral_keeps_the_share_of_a_first_order_filter() -> None:
    """x' = x + a (v - x) has a standard deviation of sqrt(a / (2 - a)) of the noise's."""
    rates, law = Rates(0.001, 0.001), Constants(5.0, 0.0, 0.0)
    omega = np.geomspace(0.01, math.pi / 0.001, 4000)
    quick = AxisResponse(0.0, 0.0, 0.0, 0.0)
    loop = open_loop(quick, rates, law, TrueTissue(np.array([100.0]), np.ones(1), np.ones(1)), omega)
    assert noise_share(loop, omega, rates)[0] == pytest.approx(math.sqrt(0.005 / (2 - 0.005)), rel=0.02)
