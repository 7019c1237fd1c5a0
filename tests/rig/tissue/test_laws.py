"""The laws against closed forms worked out by hand, and against what every tissue law must obey."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.errors import UsageError
from rig.tissue.laws import Constant, Index, Law
from rig.tissue.laws_extended import Extended
from rig.tissue.registry import LAWS, law_named

depths_mm = st.floats(0.001, 15.0)
rates_mm_s = st.floats(0.0, 60.0)
laws: st.SearchStrategy[Law] = st.one_of(
    st.builds(Constant, k_N_mm=st.floats(0.01, 20), damping_N_s_mm=st.floats(0, 0.1)),
    st.builds(Index, a_N_mm=st.floats(0.01, 5), b_per_mm=st.floats(0, 0.6), damping_N_s_mm=st.floats(0, 0.1)),
)


def test_the_index_law_at_numbers_one_can_check_with_a_pencil() -> None:
    law = Index(a_N_mm=0.5, b_per_mm=0.2, damping_N_s_mm=0.01)
    assert law.force(5.0) == pytest.approx(0.5 * 5 * math.e)
    assert law.force(5.0, 30.0) == pytest.approx(0.5 * 5 * math.e + 0.3)
    assert law.secant_stiffness(5.0) == pytest.approx(0.5 * math.e)
    assert law.tangent_stiffness(5.0) == pytest.approx(0.5 * math.e * 2)


def test_the_tangent_exceeds_the_secant_by_one_plus_b_x() -> None:
    law = Index(a_N_mm=0.12, b_per_mm=0.22, damping_N_s_mm=0.0)
    depth = np.linspace(0.1, 10, 30)
    ratio = law.tangent_stiffness(depth) / law.secant_stiffness(depth)
    assert ratio == pytest.approx(1 + 0.22 * depth)


def test_the_constant_law_has_one_stiffness() -> None:
    law = Constant(k_N_mm=0.8, damping_N_s_mm=0.02)
    assert law.force([0.0, 2.0, 5.0], 10.0) == pytest.approx([0.2, 1.8, 4.2])
    assert law.tangent_stiffness([0.0, 7.0]) == pytest.approx([0.8, 0.8])
    assert law.secant_stiffness([0.0, 7.0]) == pytest.approx([0.8, 0.8])
    assert law.depth(4.2, 10.0) == pytest.approx(5.0)


@given(laws, st.floats(-20, -1e-9), rates_mm_s)
def test_nothing_acts_outside_the_tissue(law: Law, depth_mm: float, rate_mm_s: float) -> None:
    assert law.force(depth_mm, rate_mm_s) == 0
    assert law.tangent_stiffness(depth_mm) == 0
    assert law.secant_stiffness(depth_mm) == 0


@given(laws, depths_mm, st.floats(0.001, 5.0), rates_mm_s)
def test_force_grows_with_depth_and_with_speed(law: Law, depth_mm: float, more_mm: float, rate_mm_s: float) -> None:
    assert law.force(depth_mm + more_mm, rate_mm_s) > law.force(depth_mm, rate_mm_s)
    assert law.force(depth_mm, rate_mm_s + 1) >= law.force(depth_mm, rate_mm_s)


@given(laws, depths_mm, rates_mm_s)
def test_depth_is_the_inverse_of_force(law: Law, depth_mm: float, rate_mm_s: float) -> None:
    assert float(law.depth(law.force(depth_mm, rate_mm_s), rate_mm_s)) == pytest.approx(depth_mm, rel=1e-6)


@given(laws, depths_mm)
def test_the_tangent_is_the_derivative(law: Law, depth_mm: float) -> None:
    h = 1e-4 * depth_mm
    slope = float(law.force(depth_mm + h) - law.force(depth_mm - h)) / (2 * h)
    assert float(law.tangent_stiffness(depth_mm)) == pytest.approx(slope, rel=1e-5)


@given(laws, depths_mm)
def test_the_secant_times_depth_is_the_force_at_rest(law: Law, depth_mm: float) -> None:
    assert float(law.secant_stiffness(depth_mm)) * depth_mm == pytest.approx(float(law.force(depth_mm)))


def test_a_force_that_contact_alone_exceeds_needs_no_depth() -> None:
    law = Index(a_N_mm=0.12, b_per_mm=0.22, damping_N_s_mm=0.01)
    assert law.depth([-1.0, 0.0, 0.2], 30.0) == pytest.approx([0, 0, 0])


def test_the_inverse_is_as_good_without_stiffening_as_with_very_little() -> None:
    for b in (0.0, 1e-13, 1e-10, 1e-7):
        law = Index(a_N_mm=0.5, b_per_mm=b, damping_N_s_mm=0.0)
        assert law.depth(law.force([0.0, 1.0, 9.0])) == pytest.approx([0.0, 1.0, 9.0], rel=1e-6)


def test_depths_and_rates_broadcast() -> None:
    law = Index(a_N_mm=0.12, b_per_mm=0.22, damping_N_s_mm=0.01)
    assert law.force(np.ones((4, 1)), np.ones(3)).shape == (4, 3)
    assert law.depth(np.ones((2, 5))).shape == (2, 5)
    assert law.force(1.0).shape == ()


def test_parameters_come_with_units_and_bounds_and_rebuild_the_law() -> None:
    law = Index(a_N_mm=0.12, b_per_mm=0.22, damping_N_s_mm=0.01)
    assert [(p.name, p.value, p.unit) for p in law.parameters] == [
        ("a_N_mm", 0.12, "N/mm"), ("b_per_mm", 0.22, "1/mm"), ("damping_N_s_mm", 0.01, "N s/mm")
    ]  # fmt: skip
    assert Index.from_values(law.values) == law
    assert all(p.lower <= p.value <= p.upper for p in law.parameters)


@pytest.mark.parametrize("value", [-0.1, 0.0, math.nan, math.inf])
def test_a_stiffness_no_tissue_has_is_refused_with_its_bounds(value: float) -> None:
    with pytest.raises(UsageError, match=r"constant law: k_N_mm = .* is outside 1e-06 to 10000 N/mm"):
        Constant(k_N_mm=value, damping_N_s_mm=0.0)


def test_negative_damping_is_refused() -> None:
    with pytest.raises(UsageError, match=r"damping_N_s_mm = -0.01 N s/mm is outside 0 to 10"):
        Index(a_N_mm=0.1, b_per_mm=0.1, damping_N_s_mm=-0.01)


@pytest.mark.parametrize("kind", [Constant, Index])
def test_the_guess_finds_noiseless_data_at_once(kind: type[Law]) -> None:
    truth = {
        "constant": Constant(k_N_mm=0.7, damping_N_s_mm=0.0),
        "index": Index(a_N_mm=0.2, b_per_mm=0.15, damping_N_s_mm=0.0),
    }
    law, depth = truth[kind.name], np.linspace(0.5, 8, 40)
    assert kind.guess(depth, law.force(depth)).values == pytest.approx(law.values, rel=1e-9, abs=1e-12)


def test_laws_are_found_by_name_and_a_wrong_name_lists_them() -> None:
    assert LAWS["index"] is law_named("index") is Index
    with pytest.raises(UsageError, match=r"unknown tissue law 'indx'; nearest .*: index; all: constant, index"):
        law_named("indx")


def test_each_extension_multiplies_the_index_law_as_its_formula_says() -> None:
    law = Extended(
        a_N_mm=0.2, b_per_mm=0.1, damping_N_s_mm=0.0, exponent=1.3, quadratic_per_mm=0.05, substrate_per_mm3=1e-3
    )
    for x in (0.5, 2.0, 7.0):
        expected = 0.2 * x * math.exp(0.1 * x) * (x / 5) ** 0.3 * (1 + 0.05 * x) * (1 + 1e-3 * x**3)
        assert float(law.force(x)) == pytest.approx(expected, rel=1e-12)
