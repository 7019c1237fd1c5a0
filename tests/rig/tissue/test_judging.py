"""The study's error, on numbers one can check by hand, and on curves the law was not fitted to."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from mock_devices.testing.made.synthetic import Bench, index_force
from rig.errors import DataError
from rig.tissue import judging
from rig.tissue.fitting import LawFit, fit_law
from rig.tissue.judging import Errors, Prediction, displacement_at, errors_of, given_forces, judge
from rig.tissue.laws import Constant, Index
from rig.tissue.laws_viscous import StandardLinear
from rig.tissue.study import rows
from rig.trials.contact import Contact
from rig.trials.curves import Curve, loading_curve


def made_curve(depth_mm: list[float], force_N: list[float], name: str = "made", speed_mm_s: float = 10.0) -> Curve:
    """A curve of given points."""
    depth, force = np.array(depth_mm), np.array(force_N)
    return Curve(
        name, speed_mm_s, depth, force, np.full(len(depth), speed_mm_s), Contact(20.0, 19.9, 20.1, 0.03), 0.0, 0.01,
        depth / speed_mm_s,
    )  # fmt: skip


def test_the_studys_own_numbers_come_out_of_the_studys_own_rows() -> None:
    errors = Errors(
        force_N=np.array([1.0]), measured_mm=np.array([[8.497]]), predicted_mm=np.array([[8.497 + 4.8856]]), rmse_N=0.0
    )
    assert errors.max_error_mm == pytest.approx(4.8856)
    assert errors.max_error_percent == pytest.approx(57.5, abs=0.01)


def test_the_error_of_a_row_is_a_displacement_at_a_force() -> None:
    depth = [0.01 * step for step in range(1, 1001)]
    curve = made_curve(depth, [0.5 * x for x in depth])
    law = Constant(k_N_mm=0.4, damping_N_s_mm=0.02)
    errors = errors_of([Prediction(curve, law, offset_mm=0.0, origin_mm=0.0)], np.array([1.0, 2.0, 4.0]))
    assert errors.measured_mm[0] == pytest.approx([2.0, 4.0, 8.0])
    assert errors.predicted_mm[0] == pytest.approx([(1 - 0.2) / 0.4, (2 - 0.2) / 0.4, (4 - 0.2) / 0.4])
    assert errors.error_mm[0] == pytest.approx([0.0, 0.5, 1.5])
    assert errors.error_percent[0] == pytest.approx([0.0, 12.5, 18.75])
    assert errors.max_error_mm == pytest.approx(1.5)
    assert errors.max_error_percent == pytest.approx(18.75)


def test_the_origin_changes_the_percentage_and_not_the_error() -> None:
    depth = [0.01 * step for step in range(1, 1001)]
    curve, law = made_curve(depth, [0.5 * x for x in depth]), Constant(k_N_mm=0.4, damping_N_s_mm=0.0)
    plain, shifted = (errors_of([Prediction(curve, law, 0.1, origin)], np.array([2.0])) for origin in (0.0, 0.5))
    assert plain.error_mm == pytest.approx(shifted.error_mm)
    assert shifted.error_percent[0, 0] / plain.error_percent[0, 0] == pytest.approx(4.0 / 3.5)


def test_rows_that_a_curve_did_not_reach_do_not_count() -> None:
    curve = made_curve([0.5, 1.0, 2.0], [0.5, 1.0, 2.0])
    errors = errors_of(
        [Prediction(curve, Constant(k_N_mm=1.0, damping_N_s_mm=0.0), 0.0, 0.0)], np.array([0.1, 1.5, 3.0])
    )
    assert np.isnan(errors.measured_mm[0]).tolist() == [True, False, True]
    assert [row.force_N for row in rows(errors)] == [1.5]


def test_a_displacement_too_small_to_be_measured_has_no_percentage() -> None:
    errors = Errors(np.array([1.0]), np.array([[0.05]]), np.array([[0.5]]), 0.0)
    assert errors.max_error_mm == pytest.approx(0.45)
    with pytest.raises(DataError, match=r"no trial crosses a given force"):
        _ = errors.max_error_percent
    assert rows(errors)[0].error_percent is None


def test_displacement_is_read_off_a_noisy_curve_to_hundredths() -> None:
    curve = loading_curve(Bench(noise_N=0.03).cycle(10.0))
    offset_mm = 20.0 - curve.contact.position_mm
    law = Index(a_N_mm=0.12, b_per_mm=0.22, damping_N_s_mm=0.01)
    forces = np.array([0.5, 1.0, 2.0, 4.0])
    assert displacement_at(curve, forces) - offset_mm == pytest.approx(law.depth(forces, 10.0), abs=0.05)


def test_displacement_is_read_off_sparse_samples_along_a_monotone_curve() -> None:
    depth = [0.0, 2.0, 4.0, 6.0, 8.0]
    curve = made_curve(depth, [x**2 for x in depth])
    assert displacement_at(curve, np.array([16.0, 25.0, 49.0, 65.0]))[:3] == pytest.approx([4, 5, 7], abs=0.1)
    assert np.isnan(displacement_at(curve, np.array([65.0]))[0])


def test_rows_are_even_and_end_where_every_whole_trial_arrives() -> None:
    whole = [made_curve([0, 5.0], [0, force], f"t{force}") for force in (5.0, 5.2, 5.5)]
    assert given_forces(whole) == pytest.approx(np.arange(1, 11) * 0.5)
    stopped = made_curve([0, 1.0], [0, 1.0], "pain stop")
    assert given_forces([*whole, stopped])[-1] == pytest.approx(5.0)


def test_the_same_tissue_is_predicted_as_well_on_trials_and_speeds_left_out() -> None:
    curves = [loading_curve(cycle) for cycle in Bench().cycles(trials=2)]
    fit = fit_law(Index, curves)
    judged = judge(fit, curves, given_forces(curves), fit.offsets_mm)
    for errors in (judged.fitted, judged.trials_left_out, judged.speeds_left_out):
        assert errors is not None
        assert errors.measured_mm.shape == (10, 10)
        assert errors.max_error_mm < 0.08
        assert errors.rmse_N < 0.02


def test_a_speed_with_a_tissue_of_its_own_is_judged_harder_when_it_is_left_out() -> None:
    soft, stiff = Bench(), Bench(force=index_force(a_N_mm=0.18))
    curves = [loading_curve(cycle) for cycle in stiff.cycles(trials=2, speeds_mm_s=(15.0,))]
    curves += [loading_curve(cycle) for cycle in soft.cycles(trials=2, speeds_mm_s=(5.0, 30.0))]
    fit = fit_law(Index, curves)
    judged = judge(fit, curves, given_forces(curves), fit.offsets_mm)
    assert judged.speeds_left_out is not None
    fitted, left_out = (errors.error_mm[:2].max() for errors in (judged.fitted, judged.speeds_left_out))
    assert left_out > 1.3 * fitted


def test_scattered_trials_widen_the_intervals() -> None:
    random = np.random.default_rng(5)
    spread = [index_force(a_N_mm=0.12 * (1 + 0.1 * random.standard_normal())) for _ in range(8)]
    alike = [loading_curve(Bench().cycle(10.0, seed)) for seed in range(8)]
    apart = [loading_curve(Bench(force=force).cycle(10.0, seed)) for seed, force in enumerate(spread)]
    widths = []
    for curves in (alike, apart):
        fit = fit_law(Index, curves)
        lower, upper = judge(fit, curves, given_forces(curves), fit.offsets_mm).intervals["a_N_mm"]
        widths.append(upper - lower)
    assert widths[1] > 3 * widths[0]


@pytest.mark.parametrize("trials", [3, 5])
def test_what_the_data_say_nothing_of_is_uncertain_by_its_whole_range(trials: int) -> None:
    """Tissue without memory leaves no branch to relax, so its time may be anything; by residuals and by leaving out."""
    curves = [loading_curve(cycle) for cycle in Bench().cycles(trials=1)][:trials]
    fit = fit_law(StandardLinear, curves)
    assert fit.at_bounds[0] == "k1_N_mm"
    judged = judge(fit, curves, given_forces(curves), fit.offsets_mm)
    assert judged.intervals["tau_s"] == (1e-3, 1e3)
    assert judged.interval_method.startswith("least squares" if trials == 3 else "jackknife over trials")


def test_of_many_trials_some_leave_together_and_each_is_left_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    curves = [made_curve([0.0, 2.0, 4.0, 6.0], [0.0, 0.5, 1.6, 3.6], f"t{number}") for number in range(100)]
    fit, without = fit_law(Index, curves[:3]), list[int]()

    def counted(law: type[Index], kept: Sequence[Curve], _start: LawFit) -> LawFit:
        without.append(len(curves) - len(kept))
        return fit

    monkeypatch.setattr(judging, "fit_law", counted)
    fit = replace(fit, offsets_mm=np.zeros(100), holds_N2_mm2=np.ones(100))
    pairs = judging._without_each(curves, fit, lambda curve: curve.name)
    assert sorted(without) == [2] * 20 + [3] * 20
    assert sorted(curve.name for curve, _ in pairs) == sorted(curve.name for curve in curves)
