"""Springs that stiffen each by itself: phi(d; b), the fit of a and b on it, and the whole block against its quarter."""

import numpy as np
import pytest

from mock_devices.testing.made.synthetic import Bench
from rig.errors import DataError
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.ramp import project, ramp
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded
from rig.tissue.lattice.sweep import Equilibrium, push
from rig.tissue.lattice.symmetry import shaken
from rig.tissue.laws_springs import springs_law
from rig.tissue.per_spring import PerSpring, per_spring
from rig.tissue.study import study_curves
from rig.trials.curves import loading_curve

BLOCK = Block((11, 11, 8), tip_diameter_mm=4.0, quarter=True)
DEPTH = np.array([0.2, 0.5, 0.8, 1.1, 1.4])
A, B = 0.03, 5.0


def curve_of(springs: Springs) -> np.ndarray:
    return np.array([point.reaction_N for point in push(Loaded(BLOCK, springs), DEPTH)])


def test_k_is_a_factor_of_least_squares() -> None:
    phi = np.array([1.0, 2.0, 4.0])
    k, left = project(0.3 * phi, phi)
    assert (k, left) == pytest.approx((0.3, 0.0))
    assert project(np.array([1.0, 0.0, 0.0]), phi) == pytest.approx((1.0 / 21.0, 20.0 / 21.0))


def test_a_and_b_that_made_a_curve_are_found_again() -> None:
    force = curve_of(Springs(A, B))
    law = springs_law(ramp(BLOCK, Springs(), DEPTH, force))
    found = law.guess(DEPTH, force)
    assert found.values[:2] == pytest.approx([A, B], rel=0.02)


def test_the_surface_is_the_lattice_and_has_its_slope() -> None:
    law = springs_law(ramp(BLOCK, Springs(), DEPTH, curve_of(Springs(A, B)))).from_values([A, 3.0, 0.0])
    np.testing.assert_allclose(law.elastic(DEPTH), curve_of(Springs(A, 3.0)), rtol=1e-3)
    x, h = np.array([0.1, 0.7, 1.3, 1.6]), 1e-6
    np.testing.assert_allclose(law.slope(x), (law.elastic(x + h) - law.elastic(x - h)) / (2 * h), rtol=1e-6)
    np.testing.assert_allclose(law.elastic_inverse(law.elastic(x)), x, rtol=1e-8)


def test_a_curve_no_exponent_follows_is_refused_with_the_bound() -> None:
    depth = DEPTH[:2] / 4.0
    with pytest.raises(DataError, match="exponent of 40"):
        ramp(BLOCK, Springs(), depth, np.array([1.0, 100.0]))


def quarter_and_whole(block: Block, springs: Springs, depths_mm: list[float]) -> list[tuple[Equilibrium, Equilibrium]]:
    quarter = push(Loaded(block.as_quarter(), springs), depths_mm)
    return list(zip(quarter, shaken(block, springs, depths_mm, np.random.default_rng(1)), strict=True))


def test_the_quarter_answers_as_the_shaken_whole_block() -> None:
    for quarter, whole in quarter_and_whole(BLOCK, Springs(1.0, 4.0), [0.5, 1.0, 1.5]):
        assert whole.reaction_N == pytest.approx(quarter.reaction_N, rel=1e-3)
        assert whole.inverted_cells == quarter.inverted_cells == 0


def test_a_quarter_hides_that_the_whole_block_leaves_symmetry_and_the_shaken_block_shows_it() -> None:
    (quarter, whole), _, (deep_quarter, deep_whole) = quarter_and_whole(
        Block((15, 15, 12)), Springs(1.0, 16.0), [1.0, 2.0, 3.0]
    )
    assert whole.reaction_N == pytest.approx(quarter.reaction_N, rel=1e-3)
    assert deep_whole.reaction_N < 0.98 * deep_quarter.reaction_N


@pytest.fixture(scope="module")
def fitted() -> PerSpring:
    # Deeper, this mesh leaves its mirror symmetry: the tip of 28 mm^2 holds five of its nodes wholly and ties four, and
    # `test_lattice_study` asks for the doubt that is then said.
    cycles = Bench(depth_mm=4.0).cycles(trials=2, speeds_mm_s=(5.0, 20.0))
    study = study_curves("made", [loading_curve(cycle) for cycle in cycles])
    return per_spring(study, Block((9, 9, 12), spacing_mm=2.0), "stabilised", 4.2, lambda _stage, _share: None)


def test_a_session_gets_a_b_and_damping_and_a_check_with_the_whole_block(fitted: PerSpring) -> None:
    a, b, damping = fitted.judged.law.values
    assert 0.0 < b < fitted.ramp.exponents[-1]
    assert a > 0.0
    assert damping == pytest.approx(0.01, abs=0.003)
    assert fitted.judged.trials_left_out is not None
    np.testing.assert_allclose(fitted.whole_mm, fitted.quarter_mm, rtol=0.01)
    assert fitted.doubt() is None
    assert fitted.agrees_to_mm == pytest.approx(4.2)


def test_a_whole_block_that_differs_is_said_with_the_depth(fitted: PerSpring) -> None:
    torn = PerSpring(
        fitted.ramp, fitted.judged, fitted.depth_mm, fitted.quarter_mm, fitted.quarter_mm[:4] * [1, 1, 1, 0.9]
    )
    assert torn.agrees_to_mm == fitted.depth_mm[2]
    assert f"agrees with its quarter to {fitted.depth_mm[2]:.3g} mm only" in str(torn.doubt())
