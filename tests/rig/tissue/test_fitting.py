"""Fits against trials whose truth is known, made by another program than the one that fits."""

from dataclasses import replace

import numpy as np
import pytest

from mock_devices.testing.made.synthetic import SPEEDS_MM_S, Bench, along, index_force
from rig.errors import DataError, UsageError
from rig.tissue.fitting import BINS, Steps, early_offset, fit_law, residual_force
from rig.tissue.judging import given_forces, judge
from rig.tissue.laws import Constant, Index, Law
from rig.tissue.laws_elastic import Layer
from rig.tissue.laws_viscous import HuntCrossley, QuasiLinear, StandardLinear
from rig.tissue.registry import LAWS
from rig.trials.curves import Curve, loading_curve


@pytest.fixture(scope="module")
def curves() -> list[Curve]:
    """Three trials at each of five speeds on the default tissue."""
    return [loading_curve(cycle) for cycle in Bench().cycles()]


def test_a_tissue_that_never_changes_is_recovered_to_a_percent(curves: list[Curve]) -> None:
    fit = fit_law(Index, curves)
    assert fit.law.values == pytest.approx([0.12, 0.22, 0.01], rel=0.01)
    assert fit.rmse_N < 0.01
    assert fit.at_bounds == ()


def scattered(seed: int) -> list[Curve]:
    """Fifteen trials whose tissue differs by 2 % from one to the next."""
    random = np.random.default_rng(seed)
    curves = []
    for speed_mm_s in SPEEDS_MM_S:
        for trial in range(3):
            scatter = 1 + 0.02 * random.standard_normal(2)
            force = index_force(0.12 * scatter[0], 0.22 * scatter[1])
            curves.append(loading_curve(Bench(force=force).cycle(speed_mm_s, 100 * int(speed_mm_s) + trial)))
    return curves


def test_intervals_hold_the_truth_about_as_often_as_they_say() -> None:
    truth, held = {"a_N_mm": 0.12, "b_per_mm": 0.22, "damping_N_s_mm": 0.01}, []
    for seed in range(6):
        curves = scattered(seed)
        fit = fit_law(Index, curves)
        judged = judge(fit, curves, given_forces(curves), fit.offsets_mm)
        assert judged.interval_method == "jackknife over trials"
        held += [lower <= truth[name] <= upper for name, (lower, upper) in judged.intervals.items()]
    assert sum(held) >= 15, f"{sum(held)} of {len(held)} intervals of 95 % held"


def test_the_offsets_put_contact_where_the_surface_is(curves: list[Curve]) -> None:
    fit = fit_law(Index, curves)
    surfaces = [curve.contact.position_mm + offset for curve, offset in zip(curves, fit.offsets_mm, strict=True)]
    assert surfaces == pytest.approx([20.0] * len(curves), abs=0.03)


def test_a_linear_tissue_gives_an_index_law_without_stiffening() -> None:
    bench = Bench(force=index_force(a_N_mm=0.6, b_per_mm=0.0, damping_N_s_mm=0.004))
    curves = [loading_curve(cycle) for cycle in bench.cycles(trials=2)]
    constant, index = fit_law(Constant, curves), fit_law(Index, curves)
    assert constant.law.values == pytest.approx([0.6, 0.004], rel=0.03)
    assert index.law.values == pytest.approx([0.6, 0.0, 0.004], abs=0.01)
    assert constant.rmse_N < 0.01


def test_a_law_that_does_not_fit_is_pushed_to_its_bound_and_says_so(curves: list[Curve]) -> None:
    fit = fit_law(Constant, curves)
    assert fit.at_bounds == ("damping_N_s_mm",)
    assert fit.rmse_N > 20 * fit_law(Index, curves).rmse_N


def test_a_trial_weighs_the_same_whatever_its_speed() -> None:
    curves = [loading_curve(Bench().cycle(speed)) for speed in (5.0, 30.0)]
    counts = np.bincount(Steps(curves).curve_of)
    assert len(curves[0].depth_mm) > 5 * len(curves[1].depth_mm)
    assert counts == pytest.approx([BINS, BINS], abs=2)


def test_offsets_stay_within_what_contact_allows(curves: list[Curve]) -> None:
    for kind in (Constant, Index):
        fit = fit_law(kind, curves)
        for curve, offset in zip(curves, fit.offsets_mm, strict=True):
            lower, upper = curve.offset_bounds_mm
            assert lower <= offset <= upper


def test_a_fit_from_a_near_start_ends_at_the_same_place(curves: list[Curve]) -> None:
    fit = fit_law(Index, curves)
    near = replace(fit, law=Index(a_N_mm=0.2, b_per_mm=0.1, damping_N_s_mm=0.05), offsets_mm=np.zeros(len(curves)))
    assert fit_law(Index, curves, near).law.values == pytest.approx(fit.law.values, rel=1e-3)


def test_sparse_imported_trials_are_enough() -> None:
    bench = Bench(rate_Hz=40.0, axis_rate_Hz=25.0, noise_N=0.02)
    curves = [loading_curve(cycle) for cycle in bench.cycles(speeds_mm_s=(2.0, 5.0, 10.0))]
    assert fit_law(Index, curves).law.values == pytest.approx([0.12, 0.22, 0.01], rel=0.1)


def test_a_clock_offset_between_force_and_axis_does_not_touch_the_parameters() -> None:
    curves = [loading_curve(cycle) for cycle in Bench(clock_s=0.03).cycles(trials=2)]
    assert fit_law(Index, curves).law.values == pytest.approx([0.12, 0.22, 0.01], rel=0.03)


def test_one_trial_can_be_fitted_with_intervals_from_its_residuals() -> None:
    curves = [loading_curve(Bench().cycle(30.0))]
    fit = fit_law(Index, curves)
    judged = judge(fit, curves, given_forces(curves), fit.offsets_mm)
    assert judged.interval_method.startswith("least squares")
    assert judged.trials_left_out is None
    assert judged.speeds_left_out is None
    for name, truth in (("a_N_mm", 0.12), ("b_per_mm", 0.22)):
        assert judged.intervals[name][0] <= truth <= judged.intervals[name][1]


def test_a_left_out_trial_finds_its_contact_from_its_first_quarter_of_force(curves: list[Curve]) -> None:
    law = Index(a_N_mm=0.12, b_per_mm=0.22, damping_N_s_mm=0.01)
    for curve in curves:
        assert curve.contact.position_mm + early_offset(law, curve) == pytest.approx(20.0, abs=0.06)
    curve = curves[0]
    wrong_later = replace(
        curve, force_N=np.where(curve.force_N > 0.3 * curve.max_force_N, curve.max_force_N, curve.force_N)
    )
    assert early_offset(law, wrong_later) == early_offset(law, curve)


def test_residuals_are_modelled_minus_measured(curves: list[Curve]) -> None:
    law = Index(a_N_mm=0.12, b_per_mm=0.22, damping_N_s_mm=0.01)
    higher = replace(curves[0], force_N=curves[0].force_N + 0.5)
    offset_mm = 20.0 - curves[0].contact.position_mm
    depths, residuals = residual_force(law, higher, offset_mm)
    assert np.all(depths > 0)
    assert residuals[5:] == pytest.approx(-0.5, abs=0.03)


@pytest.mark.parametrize(
    ("truth", "within"),
    [
        # Where force starts without a slope, contact is seen less sharply, and that moves force at 1 mm.
        (HuntCrossley(a_N_mmn=0.1, exponent=1.7, lambda_N_s_mmn1=0.0015), 0.2),
        (StandardLinear(k_N_mm=0.4, k1_N_mm=0.3, tau_s=0.2), 0.05),
        (QuasiLinear(A_N=0.4, b_per_mm=0.3, relaxation_ratio=0.5, tau_s=0.2), 0.1),
    ],
    ids=["hunt_crossley", "sls", "qlv"],
)
def test_damping_that_grows_and_memory_are_recovered_from_loading_at_five_speeds(truth: Law, within: float) -> None:
    curves = [loading_curve(cycle) for cycle in Bench(force=along(truth), noise_N=0.002).cycles(trials=1)]
    fit = fit_law(type(truth), curves)
    assert fit.law.values == pytest.approx(truth.values, rel=within)
    assert fit.rmse_N < 0.01


def test_a_law_with_more_parameters_than_the_tissue_shows_still_settles() -> None:
    """Fung's A and b on a straight line: only their product shows, so the fit walks along a valley."""
    bench = Bench(force=index_force(a_N_mm=0.6, b_per_mm=0.0, damping_N_s_mm=0.01))
    fit = fit_law(QuasiLinear, [loading_curve(cycle) for cycle in bench.cycles(trials=1)])
    assert fit.law.slope(np.array([0.0, 8.0])) == pytest.approx(0.6, rel=0.15)
    assert fit.rmse_N < 0.1


def test_every_law_can_be_fitted(curves: list[Curve]) -> None:
    for kind in LAWS.values():
        fit = fit_law(kind, curves[::3])
        assert fit.rmse_N < 0.8, kind.name
        assert np.all(np.isfinite(fit.information))


def test_a_known_parameter_keeps_its_value_and_has_no_interval(curves: list[Curve]) -> None:
    fit = fit_law(Layer, curves, known={"thickness_mm": 20.0})
    assert fit.law.values[1:4] == pytest.approx([3.0, 20.0, 0.45])
    assert fit.at_bounds == ("damping_N_s_mm",)
    constant = fit_law(Constant, curves)
    assert fit.law.tangent_stiffness(1.0) == pytest.approx(constant.law.tangent_stiffness(1.0), rel=1e-4)
    judged = judge(fit, curves, given_forces(curves), fit.offsets_mm)
    assert judged.intervals["thickness_mm"] == (20.0, 20.0)
    assert judged.intervals["E_MPa"][0] < fit.law.values[0] < judged.intervals["E_MPa"][1]


def test_a_parameter_the_law_has_not_cannot_be_known(curves: list[Curve]) -> None:
    with pytest.raises(UsageError, match=r"the index law has no parameter k; it has a_N_mm, b_per_mm, damping_N_s_mm"):
        fit_law(Index, curves, known={"k": 1.0})


def test_no_curves_are_refused() -> None:
    with pytest.raises(DataError, match=r"no curves to fit the index law to"):
        fit_law(Index, [])


def test_too_few_points_are_refused_with_their_number() -> None:
    curve = loading_curve(Bench().cycle(5.0))
    few = np.array([0, 600, 1200])
    short = replace(curve, depth_mm=curve.depth_mm[few], force_N=curve.force_N[few], rate_mm_s=curve.rate_mm_s[few])
    with pytest.raises(DataError, match=r"[23] points in 1 trials are too few for the 3 parameters of the index law"):
        fit_law(Index, [short])
