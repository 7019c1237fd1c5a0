"""Laws with damping and memory against closed forms worked out by hand."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from rig.errors import UsageError
from rig.tissue.history import History
from rig.tissue.laws_viscous import HuntCrossley, Prony, QuasiLinear, StandardLinear

SLS = StandardLinear(k_N_mm=0.5, k1_N_mm=0.2, tau_s=0.4)
PRONY = Prony(k_N_mm=0.5, k1_N_mm=0.1, tau1_s=0.05, k2_N_mm=0.2, tau2_s=1.5)
QLV = QuasiLinear(A_N=0.3, b_per_mm=0.3, relaxation_ratio=0.4, tau_s=0.5)


def test_hunt_crossley_does_not_jump_at_contact_and_its_damping_grows_with_depth() -> None:
    law = HuntCrossley(a_N_mmn=0.2, exponent=1.5, lambda_N_s_mmn1=0.004)
    assert law.force(4.0, 10.0) == pytest.approx(0.2 * 8 + 0.004 * 8 * 10)
    assert law.force(0.0, 30.0) == 0
    assert law.damping(np.array([1.0, 4.0])) == pytest.approx([0.004, 0.032])
    assert law.depth(1.92, 10.0) == pytest.approx(4.0)


def test_hunt_crossley_loses_to_a_bounce_what_its_damping_takes() -> None:
    """The cycle x = X sin(pi t / T): loss = int lambda x^n v^2 dt, twice the way in."""
    law, deep_mm, whole_s = HuntCrossley(a_N_mmn=0.2, exponent=2.0, lambda_N_s_mmn1=0.004), 5.0, 1.0
    time_s = np.linspace(0.0, whole_s, 20_001)
    phase = np.pi * time_s / whole_s
    depth_mm, rate_mm_s = deep_mm * np.sin(phase), deep_mm * np.pi / whole_s * np.cos(phase)
    work_mJ = float(np.trapezoid(law.force(depth_mm, rate_mm_s) * rate_mm_s, time_s))
    closed_mJ = 0.004 * deep_mm**4 * math.pi / whole_s * math.pi / 8
    assert work_mJ == pytest.approx(closed_mJ, rel=1e-4)


def test_a_sudden_depth_relaxes_as_the_standard_linear_solid_says() -> None:
    time_s = np.concatenate([[0.0, 1e-9], np.geomspace(1e-3, 10.0, 40)])
    held_mm = np.where(time_s > 0, 3.0, 0.0)
    force_N = SLS.force(held_mm, 0.0, History.at(time_s))
    assert force_N[1:] == pytest.approx(3.0 * (0.5 + 0.2 * np.exp(-time_s[1:] / 0.4)), rel=1e-8)


def test_loading_at_one_speed_follows_its_closed_form() -> None:
    """F = k x + k1 v tau (1 - exp(-x / (v tau))), also where v tau is far smaller or larger than x."""
    for rate_mm_s in (0.01, 1.0, 30.0, 1e4):
        depth_mm = np.array([0.1, 2.0, 8.0])
        closed_N = 0.5 * depth_mm - 0.2 * rate_mm_s * 0.4 * np.expm1(-depth_mm / (rate_mm_s * 0.4))
        assert SLS.force(depth_mm, rate_mm_s) == pytest.approx(closed_N, rel=1e-9)
        steps = History.at(depth_mm[:1] / rate_mm_s + np.array([-depth_mm[0] / rate_mm_s, 0.0]))
        assert SLS.force([0.0, depth_mm[0]], rate_mm_s, steps)[1] == pytest.approx(closed_N[0], rel=1e-9)


def test_two_terms_of_prony_relax_each_in_its_time() -> None:
    time_s = np.array([0.0, 1e-9, 0.05, 1.5, 100.0])
    force_N = PRONY.force([0.0, 2.0, 2.0, 2.0, 2.0], 0.0, History.at(time_s))
    closed = 0.5 + 0.1 * np.exp(-time_s / 0.05) + 0.2 * np.exp(-time_s / 1.5)
    assert force_N[1:] == pytest.approx(2.0 * closed[1:], rel=1e-8)
    assert PRONY.tangent_stiffness(2.0) == pytest.approx(0.8)
    assert PRONY.slope(np.array(2.0)) == pytest.approx(0.5)


def test_one_term_of_prony_is_the_standard_linear_solid() -> None:
    time_s, law = np.linspace(0, 1, 50), Prony(k_N_mm=0.5, k1_N_mm=0.2, tau1_s=0.4, k2_N_mm=0.0, tau2_s=1.0)
    depth_mm = 3.0 * np.sin(3.0 * time_s)
    assert law.force(depth_mm, 0.0, History.at(time_s)) == pytest.approx(SLS.force(depth_mm, 0.0, History.at(time_s)))


def test_a_quasi_linear_ramp_and_hold_is_fungs_integral() -> None:
    """F(t) = int G(t-s) e'(x(s)) v ds over the ramp, by a general integrator."""
    rate_mm_s, ramp_s = 10.0, 0.6
    time_s = np.concatenate([np.linspace(0, ramp_s, 3001), [0.7, 1.0, 3.0]])
    found_N = QLV.force(rate_mm_s * np.minimum(time_s, ramp_s), 0.0, History.at(time_s))
    for at in (1500, 3000, 3001, 3002, 3003):
        now_s = float(time_s[at])

        def integrand(s: float, now_s: float = now_s) -> float:
            relaxed = 1 + 0.4 * math.exp(-(now_s - s) / 0.5)
            return relaxed * 0.3 * 0.3 * math.exp(0.3 * rate_mm_s * s) * rate_mm_s

        closed_N = quad(integrand, 0.0, min(now_s, ramp_s))[0]
        assert found_N[at] == pytest.approx(closed_N, rel=1e-6)
    assert QLV.force(6.0, rate_mm_s) == pytest.approx(found_N[3000], rel=1e-6)


def test_memory_is_exact_for_straight_pieces_however_long() -> None:
    """A triangle in three samples is as good as in three thousand."""
    few = SLS.force([0.0, 4.0, 1.0], 0.0, History.at([0.0, 0.5, 0.8]))
    fine_s = np.concatenate([np.linspace(0.0, 0.5, 1501), np.linspace(0.5, 0.8, 1501)[1:]])
    many = SLS.force(np.interp(fine_s, [0.0, 0.5, 0.8], [0.0, 4.0, 1.0]), 0.0, History.at(fine_s))
    assert few[1:] == pytest.approx(many[[1500, 3000]], rel=1e-9)


def test_paths_end_to_end_do_not_remember_each_other() -> None:
    time_s, depth_mm = np.linspace(0, 0.5, 30), np.linspace(0, 6, 30)
    alone = QLV.force(depth_mm, 0.0, History.at(time_s))
    both = QLV.force(np.tile(depth_mm, 2), 0.0, History.at(time_s, time_s))
    assert both == pytest.approx(np.tile(alone, 2))


def test_a_history_that_goes_backwards_or_has_another_length_is_refused() -> None:
    with pytest.raises(UsageError, match=r"times that rise: sample 3 comes -0.1 s after"):
        History.at([0.0, 0.2, 0.1])
    with pytest.raises(UsageError, match=r"times that rise: sample 2 comes nan s"):
        History.at([0.0, math.nan])
    with pytest.raises(UsageError, match=r"2 times for 3 depths"):
        SLS.force([0.0, 1.0, 2.0], 0.0, History.at([0.0, 0.1]))
