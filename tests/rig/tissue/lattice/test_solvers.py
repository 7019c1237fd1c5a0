"""Two solvers, one answer; reactions, mirror symmetry, and what is said when a solver cannot."""

import numpy as np
import pytest

from mock_devices.testing.made.lattice_reference import energy, moduli, tie_energy
from rig.errors import RigError, UsageError
from rig.tissue.hayes import punch_stiffness_N_mm
from rig.tissue.lattice import fire, newton
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.health import inverted_cells
from rig.tissue.lattice.springs import Mode, Springs
from rig.tissue.lattice.state import Loaded

TOLERANCE_N = 1e-8


def pressed(block: Block, springs: Springs, depth_mm: float) -> Loaded:
    lattice = Loaded(block, springs)
    for depth in np.linspace(0.0, depth_mm, 4)[1:]:
        lattice.press(depth)
        fire.relax(lattice, TOLERANCE_N)
    return lattice


@pytest.mark.parametrize("mode", ["study", "stabilised"])
@pytest.mark.parametrize("b", [0.0, 4.0])
def test_fire_and_newton_s_method_agree_to_four_digits(block: Block, mode: Mode, b: float) -> None:
    springs = Springs.for_mode(mode, 0.1, b)
    by_fire = pressed(block.as_quarter(), springs, 0.6).reaction_N()
    lattice = Loaded(block.as_quarter(), springs)
    for depth in np.linspace(0.0, 0.6, 7)[1:]:
        lattice.press(depth)
        for _ in range(8):
            lattice.x += newton.solve(lattice, lattice.force().copy(), 1e-6)
    assert np.abs(lattice.force() * lattice.free).max() < TOLERANCE_N
    assert lattice.reaction_N() == pytest.approx(by_fire, rel=2e-5)


def test_a_quarter_gives_the_answer_of_the_whole() -> None:
    whole = Block((11, 13, 8), tip_diameter_mm=4.0)
    one, four = pressed(whole, Springs(0.1), 0.8), pressed(whole.as_quarter(), Springs(0.1), 0.8)
    assert four.reaction_N() == pytest.approx(one.reaction_N(), rel=1e-6)
    np.testing.assert_allclose(four.block.inner(four.x), one.block.inner(one.x)[:, 5:, 6:], atol=1e-5)


def test_a_whole_block_stays_symmetric(block: Block) -> None:
    inner = block.inner(pressed(block, Springs(0.1), 1.0).x)
    np.testing.assert_allclose(inner[2], inner[2, ::-1], atol=1e-6)
    np.testing.assert_allclose(inner[2], inner[2].transpose(1, 0, 2), atol=1e-6)


def test_the_reaction_is_the_slope_of_the_energy_over_depth(block: Block) -> None:
    springs, h = Springs(0.1, 2.0), 0.01
    low, middle, high = (pressed(block, springs, d) for d in (0.7 - h, 0.7, 0.7 + h))
    stored = [energy(block.inner(lattice.x), springs, block) + tie_energy(lattice) for lattice in (low, high)]
    slope = (stored[1] - stored[0]) / (2 * h)
    assert middle.reaction_N() == pytest.approx(slope, rel=1e-4)
    tangent = (high.reaction_N() - low.reaction_N()) / (2 * h)
    assert newton.tangent_stiffness_N_mm(middle) == pytest.approx(tangent, rel=1e-3)


def test_tip_bone_and_sides_carry_the_same_force(block: Block) -> None:
    lattice = pressed(block, Springs(0.1), 0.8)
    held = block.inner(lattice.f * (1.0 - lattice.free))[2]
    assert -held[:, :, :-1].sum() - held[[0, -1], :, -1].sum() - held[1:-1, [0, -1], -1].sum() == pytest.approx(
        lattice.reaction_N(), rel=1e-5
    )


@pytest.mark.parametrize("mode", ["study", "stabilised"])
def test_small_depth_stiffness_is_that_of_the_flat_punch_on_a_layer(mode: Mode) -> None:
    springs = Springs.for_mode(mode, 0.1)
    block = Block((41, 41, 20), quarter=True)
    stiffness = newton.tangent_stiffness_N_mm(Loaded(block, springs))
    theory = punch_stiffness_N_mm(*moduli(springs), 3.0, block.height_mm)
    # The tip is six cells wide, so its edge is known to half a cell.
    assert stiffness == pytest.approx(theory, rel=0.1)


def test_a_solver_out_of_steps_says_where_it_stood(block: Block) -> None:
    lattice = Loaded(block, Springs(0.1))
    lattice.press(0.5)
    with pytest.raises(fire.NotConverged, match=r"stopped after 10 steps with .* N left"):
        fire.relax(lattice, TOLERANCE_N, most_steps=10)


def test_the_study_s_lattice_collapses_and_says_so_where_the_stabilised_one_does_not() -> None:
    block = Block((15, 15, 12), quarter=True)
    collapsed, kept = (pressed_far(block, mode) for mode in ("study", "stabilised"))
    assert inverted_cells(collapsed) > 0
    assert inverted_cells(kept) == 0
    with pytest.raises(newton.NegativeCurvature, match="past a limit point"):
        newton.tangent_stiffness_N_mm(at_limit(block))


def test_cells_that_are_turned_count_as_often_as_the_whole_block_has_them(block: Block) -> None:
    for stored, expected in ((block, 4), (block.as_quarter(), 16)):
        lattice = Loaded(stored, Springs())
        inner = stored.inner(lattice.x)
        inner[2, 2, 2, -1] = inner[2, 2, 2, -2] - 0.1
        assert inverted_cells(lattice) == expected, "a node of the top face is a corner of four cells"


def pressed_far(block: Block, mode: Mode) -> Loaded:
    lattice = Loaded(block, Springs.for_mode(mode, 1.0))
    for depth in np.arange(0.5, 4.1, 0.5):
        lattice.press(depth)
        fire.relax(lattice, 1e-5)
    return lattice


def at_limit(block: Block) -> Loaded:
    """A state squeezed evenly to half its height, which no springs-only lattice keeps."""
    lattice = Loaded(block, Springs.for_mode("study", 1.0))
    lattice.x[2] *= 0.5
    return lattice


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Block((10, 11, 8)), "odd number"),
        (lambda: Block((11, 11, 8), spacing_mm=float("nan")), "above 0 mm"),
        (lambda: Block((11, 11, 8), tip_diameter_mm=12.0), "block 10.0 mm wide"),
        (lambda: Block((11, 11, 400)), "limit is 336"),
        (lambda: Block((501, 501, 100)), "limit of 4000000"),
        (lambda: Springs(0.0), "above 0 N/mm"),
        (lambda: Springs(-1.0), "k = -1.0 N/mm"),
        (lambda: Springs(0.1, float("nan")), "b = nan"),
        (lambda: Springs(0.1, 0.0, -1.0), "must lie between 0"),
    ],
)
def test_bad_input_is_one_sentence_with_the_bound(make: "object", words: str) -> None:
    assert callable(make)
    with pytest.raises(UsageError, match=words):
        make()


def test_every_failure_of_a_solver_is_a_rig_error() -> None:
    assert all(issubclass(kind, RigError) for kind in (fire.NotConverged, newton.NegativeCurvature))
