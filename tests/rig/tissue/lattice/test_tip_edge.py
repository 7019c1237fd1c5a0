"""The edge of the tip: areas, ties, and a stiffness that goes with the mesh to that of the elastic layer."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from rig.tissue.hayes import punch_stiffness_N_mm
from rig.tissue.lattice import newton
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded
from rig.tissue.lattice.tip_edge import TIE, covered_shares, edge_nodes, tie_ratios

RADIUS_MM, LAYER_MM, HALF_MM = 3.0, 12.0, 24.0


def stiffness_N_mm(spacing_mm: float, bonded: bool = False, radius_mm: float = RADIUS_MM) -> float:
    """Of a wide layer of E = 0.25 MPa and nu = 1/4 (k = 0.4 E d), pressed a little."""
    across, deep = (round(size / spacing_mm) for size in (2 * HALF_MM, LAYER_MM))
    block = Block((across + 1, across + 1, deep + 1), spacing_mm, 2 * radius_mm, quarter=True, bonded=bonded)
    return newton.tangent_stiffness_N_mm(Loaded(block, Springs(0.1 * spacing_mm, 0.0, 0.0)))


@pytest.mark.parametrize("spacing_mm", [1.5, 1.0, 0.75, 0.6])
@pytest.mark.parametrize("radius_mm", [2.2, 3.0, 3.7])
def test_the_shares_add_up_to_the_disc(spacing_mm: float, radius_mm: float) -> None:
    at = spacing_mm * np.arange(-8, 9)
    x, y = (grid.ravel() for grid in np.meshgrid(at, at))
    shares = covered_shares(x, y, radius_mm, spacing_mm)
    assert shares.sum() * spacing_mm**2 == pytest.approx(math.pi * radius_mm**2, rel=1e-3)


def test_a_square_cut_by_a_wide_disc_has_the_share_of_a_straight_edge() -> None:
    # At a radius of 1000 the edge is straight to 0.125 thousandths of a cell.
    shares = covered_shares(np.array([999.6, 1000.0, 1000.25, 1001.0]), np.zeros(4), 1000.0, 1.0)
    np.testing.assert_allclose(shares, [0.9, 0.5, 0.25, 0.0], atol=0.01)


def test_a_tie_is_nothing_at_no_share_and_rigid_at_a_whole_one() -> None:
    np.testing.assert_allclose(tie_ratios(np.array([0.0, 0.5, 0.75])), [0.0, TIE, 3 * TIE])


def test_the_middle_node_is_held_however_small_the_tip() -> None:
    block = Block((5, 5, 3), tip_diameter_mm=1.0)
    assert list(block.rest()[:2, block.tip_nodes()[0]]) == [0.0, 0.0]
    assert len(block.tip_nodes()) == 1


def test_a_quarter_holds_a_quarter_of_the_ties() -> None:
    whole, quarter = Block((11, 11, 8), tip_diameter_mm=5.0), Block((11, 11, 8), tip_diameter_mm=5.0, quarter=True)
    assert 4.0 * edge_nodes(quarter)[1].sum() == pytest.approx(edge_nodes(whole)[1].sum())


@pytest.mark.parametrize("bonded", [True, False])
@pytest.mark.parametrize("b", [0.0, 5.0])
def test_a_tie_s_tangent_is_the_slope_of_its_pull(b: float, bonded: bool) -> None:
    lattice = Loaded(Block((11, 11, 8), tip_diameter_mm=5.0, bonded=bonded), Springs(0.2, b))
    random = np.random.default_rng(0)
    lattice.x += random.normal(0.0, 0.05, lattice.x.shape)
    lattice.press(0.3)
    edge, h = lattice.edge, 1e-6
    u = random.normal(size=edge.rest.shape)
    moved = [lattice.x.copy() for _ in range(2)]
    for x, sign in zip(moved, (1.0, -1.0), strict=True):
        x[:, edge.nodes] += sign * h * u
    above, below = (edge.pull_N(x, 0.3) for x in moved)
    np.testing.assert_allclose(edge.tangent_N(lattice.x, 0.3, u), (below - above) / (2 * h), rtol=1e-5, atol=1e-7)
    held = edge.tangent_N(lattice.x, 0.3, np.ones_like(u)) / np.ones_like(u)
    assert np.all(edge.bound_N_mm(lattice.x, 0.3) >= 0.0)
    assert bonded == bool(held[0].any())


def fitted_limit(spacings_mm: Sequence[float], found: Sequence[float]) -> tuple[float, float]:
    """Limit of a straight line through the stiffness over the spacing, and the largest distance from it."""
    slope, limit = np.polyfit(spacings_mm, found, 1)
    return float(limit), float(np.abs(np.polyval([slope, limit], spacings_mm) - found).max())


@pytest.mark.extra
def test_stiffness_goes_with_the_mesh_to_that_of_the_layer() -> None:
    spacings_mm = [1.0, 0.75, 0.6, 0.5, 0.4, 0.3]
    found = [stiffness_N_mm(spacing) for spacing in spacings_mm]
    limit, off = fitted_limit(spacings_mm, found)
    theory = punch_stiffness_N_mm(0.25, 0.25, RADIUS_MM, LAYER_MM)
    assert off < 0.006 * theory, "the error is of first order in the spacing"
    # The sides are held 2 thicknesses away, where a bonded layer hardly moves: little of the 1 % is theirs.
    assert limit == pytest.approx(theory, rel=0.01)


@pytest.mark.extra
def test_a_staircase_would_jump_from_mesh_to_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bug this is there against: a node under the tip is held, any other is free."""
    monkeypatch.setattr("rig.tissue.lattice.tip_edge.MOST_SHARE", 0.5)
    monkeypatch.setattr("rig.tissue.lattice.tip_edge.LEAST_SHARE", 0.5)
    spacings_mm = [1.0, 0.75, 0.6, 0.5, 0.4]
    assert fitted_limit(spacings_mm, [stiffness_N_mm(spacing) for spacing in spacings_mm])[1] > 0.01 * 2.01


def test_a_wider_tip_is_stiffer_by_every_tenth_of_a_millimetre() -> None:
    found = np.array([stiffness_N_mm(1.0, radius_mm=radius) for radius in np.arange(2.5, 3.55, 0.1)])
    assert np.all(np.diff(found) > 0.0)


def test_a_tip_that_sticks_is_stiffer_than_one_that_slides() -> None:
    """By (1 - nu) ln(3 - 4 nu)/(1 - 2 nu), 4 % at nu = 1/4, on a half-space (Mossakovskii 1954); a layer is near it."""
    ratio = stiffness_N_mm(0.75, bonded=True) / stiffness_N_mm(0.75)
    assert ratio == pytest.approx(0.75 * math.log(2.0) / 0.5, abs=0.02)
