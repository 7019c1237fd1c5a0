"""Rivals of the index model keep the contract of every law."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.tissue.laws import Law
from rig.tissue.laws_rivals import RIVALS, Fung, Power, Quadratic

LAWS: list[Law] = [
    Quadratic(a_N_mm=0.2, c_N_mm2=0.05, B_N_s_mm=0.01),
    Power(a_N_mmn=0.1, n=1.9, B_N_s_mm=0.0),
    Fung(A_N=0.3, b_per_mm=0.35, B_N_s_mm=0.02),
]


@pytest.mark.parametrize("law", LAWS)
@given(depth=st.floats(0.01, 12.0))
def test_tangent_is_the_slope_and_depth_undoes_force(law: Law, depth: float) -> None:
    h = 1e-6
    slope = (law.force(depth + h) - law.force(depth - h)) / (2 * h)
    assert law.tangent_stiffness(depth) == pytest.approx(slope, rel=1e-5)
    assert law.depth(law.force(depth)) == pytest.approx(depth, rel=1e-9)
    assert law.force(-depth) == 0.0


@pytest.mark.parametrize("law", LAWS)
def test_guess_is_near_the_law_that_made_the_data(law: Law) -> None:
    depth = np.linspace(0.2, 8.0, 60)
    guessed = type(law).guess(depth, law.elastic(depth))
    np.testing.assert_allclose(guessed.elastic(depth), law.elastic(depth), rtol=0.1)


def test_rivals_have_as_many_parameters_as_the_index_model() -> None:
    assert {len(kind.bounds) for kind in RIVALS} == {3}
