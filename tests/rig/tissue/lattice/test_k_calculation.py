"""The study's search and the exact short cut give one answer; laws on phi fit and judge like any other."""

import numpy as np
import pytest

from rig.errors import DataError
from rig.tissue.k_calculation import check_points, exact_k, fit_index, search_k, study_loop
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.sweep import Sweep, sweep
from rig.tissue.laws_lattice import lattice_laws

A, B = 0.04, 0.25
DEPTH = np.array([0.6, 1.2, 1.8, 2.4])


@pytest.fixture(scope="module")
def curve() -> Sweep:
    return sweep(Block((11, 11, 10), tip_diameter_mm=4.0, quarter=True), Springs.for_mode("stabilised"), 3.0)


def test_the_short_cut_finds_the_k_that_made_the_curve(curve: Sweep) -> None:
    k = A * np.exp(B * DEPTH)
    points = exact_k(curve, k * curve.phi_mm(DEPTH), DEPTH)
    np.testing.assert_allclose([point.k_exact_N_mm for point in points], k, rtol=1e-12)
    fit = fit_index(points)
    assert (fit.a_N_mm, fit.b_per_mm, fit.r_squared) == pytest.approx((A, B, 1.0))
    assert fit.a_interval[0] <= fit.a_N_mm <= fit.a_interval[1]


def test_simulate_compare_adjust_ends_where_the_short_cut_is(curve: Sweep) -> None:
    points = exact_k(curve, np.array([0.3, 0.8, 1.5, 2.6]), DEPTH)
    for point in study_loop(points, curve):
        assert point.k_loop_N_mm == pytest.approx(point.k_exact_N_mm, rel=0.01)
        assert point.simulations > 1


def test_the_search_adjusts_until_the_depths_agree() -> None:
    k, count = search_k(lambda force, k, _near: (force / k) ** 0.6, 2.0, 1.5, guess_N_mm=0.1)
    assert (2.0 / k) ** 0.6 == pytest.approx(1.5, abs=0.005)
    assert count < 10


@pytest.mark.parametrize(
    ("force", "depth", "words"),
    [
        ([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], "at least 4"),
        ([1.0, 2.0, np.nan, 4.0], [1.0, 2.0, 3.0, 4.0], "force number 3 is not a number"),
        ([1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 2.0, 3.0], "depth number 1 is 0 mm"),
        ([1.0, 3.0, 2.0, 4.0], [1.0, 2.0, 3.0, 4.0], "force falls from 3 to 2 N"),
        ([-1.0, 3.0, 4.0, 5.0], [1.0, 2.0, 3.0, 4.0], "force number 1 is -1 N"),
    ],
)
def test_points_that_cannot_be_used_are_named(force: list[float], depth: list[float], words: str) -> None:
    with pytest.raises(DataError, match=words):
        check_points(np.array(force), np.array(depth))


def test_lattice_laws_have_the_tangent_of_their_force_and_undo_it(curve: Sweep) -> None:
    constant, index = lattice_laws(curve)
    for law in (constant.from_values([0.05, 0.01]), index.from_values([0.05, 0.2, 0.01])):
        x, h = np.array([0.4, 1.1, 2.3]), 1e-6
        slope = (law.force(x + h) - law.force(x - h)) / (2 * h)
        np.testing.assert_allclose(law.tangent_stiffness(x), slope, rtol=1e-6)
        np.testing.assert_allclose(law.depth(law.force(x)), x, rtol=1e-8)


def test_lattice_laws_guess_what_made_the_data(curve: Sweep) -> None:
    _, index = lattice_laws(curve)
    law = index.from_values([A, B, 0.0])
    guessed = index.guess(DEPTH, law.elastic(DEPTH))
    np.testing.assert_allclose(guessed.values, [A, B, 0.0], rtol=1e-6, atol=1e-12)
