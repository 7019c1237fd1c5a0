"""Force is the slope of the energy that a second, slow program gives, and the product the slope of the force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mock_devices.testing.made.lattice_reference import energy, moduli, untied
from rig.tissue.lattice import kernels
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.numba_types import Matrix
from rig.tissue.lattice.rows import FRONT
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded

SIGNALLING_NAN = 0x7FF0000000000001
LAWS = [Springs(0.1, 0.0, 0.0), Springs(0.1, 6.0, 0.0), Springs(0.1, 0.0, 1.0), Springs(0.3, 3.0, 2.0)]


def shaken(block: Block, springs: Springs, seed: int = 1, amount: float = 0.08) -> Loaded:
    lattice = untied(Loaded(block, springs))
    inner = block.inner(lattice.x)
    inner += np.random.default_rng(seed).normal(0.0, amount * block.spacing_mm, inner.shape)
    return lattice


def direction(block: Block, seed: int = 2) -> Matrix:
    u = block.allocate()
    block.inner(u)[:] = np.random.default_rng(seed).normal(size=block.inner(u).shape)
    return u


@pytest.mark.parametrize("springs", LAWS)
@pytest.mark.parametrize("nodes", [(5, 5, 3), (7, 5, 9)])
def test_force_is_minus_the_slope_of_a_slow_second_program_s_energy(
    springs: Springs, nodes: tuple[int, int, int]
) -> None:
    block = Block(nodes, spacing_mm=0.7, tip_diameter_mm=1.5)
    lattice, u, h = shaken(block, springs), direction(block), 1e-5
    slope = -float(np.vdot(lattice.force(), u))
    above, below = (energy(block.inner(lattice.x + step * u), springs, block) for step in (h, -h))
    assert (above - below) / (2 * h) == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("springs", LAWS)
def test_product_is_minus_the_slope_of_the_force(block: Block, springs: Springs) -> None:
    lattice, u = shaken(block, springs), direction(block)
    product = lattice.product(u, block.allocate())
    start, h = lattice.x.copy(), 1e-5
    lattice.x[:] = start + h * u
    above = lattice.force().copy()
    lattice.x[:] = start - h * u
    slope = (lattice.force() - above) / (2 * h)
    np.testing.assert_allclose(block.inner(product), block.inner(slope), atol=2e-6 * np.abs(product).max())


@pytest.mark.parametrize("springs", LAWS)
def test_diagonal_bounds_the_hessian_s_own(block: Block, springs: Springs) -> None:
    lattice = shaken(block, springs, amount=0.03)
    bound = block.inner(lattice.diagonal(block.allocate()))
    for node in [(0, 0, 0), (5, 5, 7), (3, 6, 4)]:
        for w in range(3):
            unit = block.allocate()
            block.inner(unit)[(w, *node)] = 1.0
            own = block.inner(lattice.product(unit, block.allocate()))[(w, *node)]
            assert 0.0 < own <= bound[(w, *node)] * (1.0 + 1e-9)


@pytest.mark.parametrize("quarter", [False, True])
@pytest.mark.parametrize("springs", LAWS)
@pytest.mark.parametrize("what", [kernels.FORCE, kernels.PRODUCT, kernels.DIAGONAL])
def test_a_thread_touches_its_own_planes_only(block: Block, what: kernels.Sum, springs: Springs, quarter: bool) -> None:
    """Adding even a zero to another thread's plane would lose what that thread adds meanwhile; a signalling NaN keeps
    its bits only where nothing is added.
    """
    lattice = shaken(block.as_quarter() if quarter else block, springs)
    shape, plane = lattice.shape, lattice.shape.ny * lattice.shape.stride
    for first, stop in [(0, 3), (2, shape.nx), (3, 5), (shape.nx - 1, shape.nx)]:
        bits = lattice.f.view(np.int64)
        bits[:] = SIGNALLING_NAN
        kernels._slab(what, lattice.x, lattice.x, lattice.f, shape, lattice.law, first, stop)
        touched = np.flatnonzero((bits != SIGNALLING_NAN).any(axis=0))
        assert (touched[0], touched[-1] + 1) == (FRONT + first * plane, FRONT + stop * plane)


@pytest.mark.parametrize("slabs", [1, 2, 3, 11])
def test_answers_do_not_depend_on_the_number_of_threads(block: Block, slabs: int) -> None:
    lattice = shaken(block, LAWS[3])
    one = lattice.force().copy()
    lattice.slabs = slabs
    np.testing.assert_allclose(lattice.force(), one, atol=1e-15)


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.sampled_from(LAWS))
def test_a_rigid_motion_pulls_nowhere(seed: int, springs: Springs) -> None:
    block = Block((5, 5, 4), tip_diameter_mm=2.0)
    lattice = untied(Loaded(block, springs))
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    lattice.x[:] = turn @ lattice.x + 3.0
    assert np.abs(block.inner(lattice.force())).max() < 1e-12


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.sampled_from(LAWS))
def test_inner_forces_add_up_to_no_force_and_no_torque(seed: int, springs: Springs) -> None:
    block = Block((5, 7, 4), tip_diameter_mm=2.0)
    lattice = shaken(block, springs, seed)
    force, place = block.inner(lattice.force()).reshape(3, -1), block.inner(lattice.x).reshape(3, -1)
    assert np.abs(force.sum(axis=1)).max() < 1e-11
    assert np.abs(np.cross(place, force, axis=0).sum(axis=1)).max() < 1e-10


@pytest.mark.parametrize("springs", [LAWS[0], LAWS[2]])
def test_patch_a_uniform_strain_leaves_inner_nodes_at_rest_with_the_stress_of_the_moduli(springs: Springs) -> None:
    block = Block((7, 7, 7), tip_diameter_mm=2.0)
    lattice = Loaded(block, springs)
    strain = 1e-6
    lattice.x[2] *= 1.0 + strain
    force = block.inner(lattice.force())
    assert np.abs(force[:, 1:-1, 1:-1, 1:-1]).max() < 1e-15
    young_MPa, nu = moduli(springs)
    uniaxial = young_MPa * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    # Inner nodes of the top face carry the stress of one cell face each.
    assert -force[2, 3, 3, -1] == pytest.approx(uniaxial * strain, rel=1e-5)


def test_two_nodes_in_one_place_give_a_finite_force() -> None:
    block = Block((5, 5, 3), tip_diameter_mm=2.0)
    lattice = Loaded(block, LAWS[1])
    inner = block.inner(lattice.x)
    inner[:, 2, 2, 2] = inner[:, 2, 2, 1]
    assert np.all(np.isfinite(block.inner(lattice.force())))
