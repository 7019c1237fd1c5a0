"""phi(d): one curve serves every k; past collapse it is marked and refused."""

import numpy as np
import pytest

from rig.errors import UsageError
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Springs
from rig.tissue.lattice.state import Loaded
from rig.tissue.lattice.sweep import Sweep, push, sweep

BLOCK = Block((13, 13, 10), tip_diameter_mm=4.0, quarter=True)


@pytest.fixture(scope="module")
def stabilised() -> Sweep:
    return sweep(BLOCK, Springs.for_mode("stabilised"), 3.0)


@pytest.fixture(scope="module")
def study() -> Sweep:
    return sweep(BLOCK, Springs.for_mode("study"), 3.5, step_mm=0.25)


def test_a_sweep_with_another_k_is_the_same_curve_scaled(stabilised: Sweep) -> None:
    points = list(push(Loaded(BLOCK, Springs.for_mode("stabilised", 0.037)), stabilised.depth_mm[1:]))
    reactions = np.array([point.reaction_N for point in points])
    np.testing.assert_allclose(reactions / 0.037, stabilised.force_over_k_mm[1:], rtol=1e-4)


def test_the_stabilised_curve_rises_without_an_inverted_cell(stabilised: Sweep) -> None:
    assert stabilised.collapse() is None
    assert stabilised.deepest_mm == pytest.approx(3.0)
    assert np.all(np.diff(stabilised.force_over_k_mm) > 0)


def test_the_study_s_lattice_is_marked_from_the_first_sign_of_collapse_on(study: Sweep) -> None:
    assert study.collapse() is not None
    first = study.intact.index(False)
    assert not any(study.intact[first:])
    assert study.deepest_mm == study.depth_mm[first - 1]


def test_a_depth_past_collapse_is_refused_with_the_bound(study: Sweep) -> None:
    with pytest.raises(UsageError, match=rf"depth of 3.4 mm lies outside 0 ... {study.deepest_mm:.4g} mm.*stabilised"):
        study.phi_mm(3.4)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -0.1])
def test_depths_that_are_no_depths_are_refused(stabilised: Sweep, value: float) -> None:
    with pytest.raises(UsageError):
        stabilised.phi_mm(value)


@pytest.mark.parametrize("depth", [0.0, -1.0, float("nan"), 9.0])
def test_a_sweep_outside_the_block_is_refused(depth: float) -> None:
    with pytest.raises(UsageError, match="90 % of the block's height"):
        sweep(BLOCK, Springs(), depth)
