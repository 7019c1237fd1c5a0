"""From a model to the table and the span of tissue: closed forms, and models that no law is made for."""

from dataclasses import replace

import numpy as np
import pytest

from controller.law.gain_table import gain_rows, span_of
from controller.law.loop_response import Rates
from mock_devices.testing.models import index_model
from rig.errors import UsageError
from rig.tissue.model import Model

FAST, SLOW = Rates(0.001, 0.001), Rates(0.001, 0.01)


def depths(model: Model) -> list[float]:
    return [float(depth) for depth in np.linspace(0.0, model.valid.depth_mm, 20)]


def uncertain(model: Model, **errors: float) -> Model:
    """The same model with standard errors, and intervals of two of them to either side."""
    names = [parameter.name for parameter in model.law.parameters]
    deviations = np.array([errors.get(name, 0.0) for name in names])
    intervals = {
        name: (value - 2 * sd, value + 2 * sd)
        for name, value, sd in zip(names, model.law.values, deviations, strict=True)
    }
    return replace(model, covariance=np.diag(deviations**2), intervals=intervals)


def test_rows_are_force_tangent_and_damping_at_each_depth() -> None:
    model = index_model(0.12, 0.22, 0.01)
    rows = gain_rows(model, depths(model))
    for row in rows:
        growth = np.exp(0.22 * row.depth_mm)
        assert row.force_N == pytest.approx(0.12 * row.depth_mm * growth)
        assert row.tangent_N_mm == pytest.approx(0.12 * (1 + 0.22 * row.depth_mm) * growth)
        assert row.damping_N_s_mm == pytest.approx(max(0.01, 0.0015 * row.tangent_N_mm))
    assert rows[0].damping_N_s_mm == 0.01


def test_the_span_is_half_to_twice_a_model_that_is_known() -> None:
    model = index_model(2.0, 0.0, 0.01)
    span = span_of(model, gain_rows(model, depths(model)), FAST)
    assert span.stiffness == (0.5, 2.0)
    assert span.damping == (1.0, 1.0)
    assert span.corners_rad_s == pytest.approx((200.0,) * len(span.corners_rad_s))
    assert span.damping_shares == (1.0,) * len(span.corners_rad_s)


def test_the_share_of_true_damping_is_below_1_where_the_law_takes_more() -> None:
    model = index_model(2.0, 0.0, 0.001)
    span = span_of(model, gain_rows(model, depths(model)), FAST)
    assert span.damping_shares == pytest.approx((0.001 / 0.003,) * len(span.corners_rad_s))


def test_a_model_that_knows_less_has_a_wider_span() -> None:
    """Stiffness with a standard error of 0.4 of itself: two of them reach from 0.2 to 1.8."""
    model = uncertain(index_model(2.0, 0.0, 0.01), a_N_mm=0.8, damping_N_s_mm=0.002)
    span = span_of(model, gain_rows(model, depths(model)), FAST)
    assert span.stiffness == pytest.approx((0.2, 2.0), abs=1e-6)
    assert span.damping == pytest.approx((0.6, 1.4), abs=1e-6)


def test_each_parameter_reaches_as_far_as_its_own_interval() -> None:
    """Stiffness by 2 standard errors of 0.6, damping by 3 of 0.002."""
    model = uncertain(index_model(2.0, 0.0, 0.01), a_N_mm=0.6, damping_N_s_mm=0.002)
    model = replace(model, intervals={**model.intervals, "damping_N_s_mm": (0.004, 0.016)})
    span = span_of(model, gain_rows(model, depths(model)), FAST)
    assert span.stiffness == pytest.approx((0.4, 2.0), abs=1e-6)
    assert span.damping == pytest.approx((0.4, 1.6), abs=1e-6)


def test_a_model_without_tangent_stiffness_is_refused_with_the_depth() -> None:
    flat = index_model(0.12, 0.22, 0.01)
    with pytest.raises(UsageError, match=r"tangent stiffness at -1 mm is 0 N/mm; gains need it above 0"):
        gain_rows(flat, (-1.0, 1.0))


def test_a_model_without_damping_is_refused() -> None:
    model = index_model(0.12, 0.22, 0.0)
    with pytest.raises(UsageError, match=r"damping is 0 N s/mm, 0 to 0; .* needs it above 0 .*several speeds"):
        span_of(model, gain_rows(model, depths(model)), FAST)


def test_a_damping_whose_interval_reaches_zero_is_refused_with_the_interval() -> None:
    model = uncertain(index_model(0.12, 0.22, 0.01), damping_N_s_mm=0.006)
    with pytest.raises(UsageError, match=r"damping is 0\.01 N s/mm, 0 to 0\.022; .* its whole interval"):
        span_of(model, gain_rows(model, depths(model)), FAST)


@pytest.mark.parametrize("standard_error", [0.002, 0.0])
@pytest.mark.parametrize("interval", [(0.0, 0.012), (-0.001, 0.011)])
def test_an_interval_that_reaches_zero_on_one_side_is_refused_whatever_the_standard_error(
    standard_error: float, interval: tuple[float, float]
) -> None:
    model = uncertain(index_model(0.12, 0.22, 0.01), damping_N_s_mm=standard_error)
    model = replace(model, intervals={**model.intervals, "damping_N_s_mm": interval})
    with pytest.raises(UsageError, match=r"damping is 0\.01 N s/mm, 0 to 0\.02"):
        span_of(model, gain_rows(model, depths(model)), FAST)


def test_a_stiffness_whose_interval_reaches_zero_is_refused_with_the_interval() -> None:
    """2 N/mm with a standard error of 1.1: two of them reach from below zero to 4.2."""
    model = uncertain(index_model(2.0, 0.0, 0.01), a_N_mm=1.1)
    with pytest.raises(UsageError, match=r"the model's stiffness is 2 N/mm, 0 to 4\.2; .* its whole interval"):
        span_of(model, gain_rows(model, depths(model)), FAST)


def test_of_tissue_too_stiff_where_it_is_deep_trials_that_press_less_deep_make_a_model_to_track_with() -> None:
    deep, less_deep = index_model(0.5, 0.2, 0.03, force_N=80.0), index_model(0.5, 0.2, 0.03, force_N=30.0)
    with pytest.raises(UsageError, match=r"above the 20 N/mm .*: fit trials that press less deep"):
        span_of(deep, gain_rows(deep, depths(deep)), FAST)
    span_of(less_deep, gain_rows(less_deep, depths(less_deep)), FAST)


@pytest.mark.parametrize(("rates", "limit"), [(FAST, 20), (SLOW, 10)], ids=["1 kHz", "100 Hz"])
def test_tissue_that_may_be_stiffer_than_the_limit_is_refused_with_force_and_bound(rates: Rates, limit: int) -> None:
    known = index_model(0.99 * limit, 0.0, 0.1)
    span_of(known, gain_rows(known, depths(known)), rates)
    model = uncertain(known, a_N_mm=0.02 * limit)
    with pytest.raises(UsageError, match=rf"tissue may have .* N/mm, above the {limit} N/mm up to which"):
        span_of(model, gain_rows(model, depths(model)), rates)
