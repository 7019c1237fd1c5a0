"""The study's own scheme, which the lattice's speed is compared with: stable or not, and the same rest state."""

import numpy as np
import pytest

from benchmarks import lattice_euler as euler
from rig.errors import UsageError
from rig.tissue.lattice import fire
from rig.tissue.lattice.block import Block
from rig.tissue.lattice.springs import Mode, Springs
from rig.tissue.lattice.state import Loaded

BLOCK = Block((11, 11, 8), tip_diameter_mm=4.0, quarter=True)


@pytest.mark.parametrize("mode", ["study", "stabilised"])
@pytest.mark.parametrize("b", [0.0, 4.0])
def test_the_study_s_scheme_and_fire_agree_to_four_digits(mode: Mode, b: float) -> None:
    by_fire, by_euler = (Loaded(BLOCK, Springs.for_mode(mode, 0.1, b)) for _ in range(2))
    for depth in np.linspace(0.0, 0.6, 4)[1:]:
        by_fire.press(depth)
        fire.relax(by_fire, 1e-8)
    by_euler.press(0.6)
    euler.run(by_euler, euler.EulerScheme())
    assert by_euler.reaction_N() == pytest.approx(by_fire.reaction_N(), rel=1e-4)


def test_only_one_reading_of_the_study_s_parameters_is_stable() -> None:
    growth = {name: scheme.growth_per_step(0.1) for name, scheme in euler.READINGS.items()}
    assert growth["raw numbers, new velocity"] < 1.0
    assert growth["raw numbers, old velocity"] == pytest.approx(1.056, abs=0.001)
    assert growth["strict SI, new velocity"] == pytest.approx(1.2e5, rel=0.01)
    assert growth["strict SI, old velocity"] == pytest.approx(346.4, abs=0.1)


@pytest.mark.parametrize("reading", ["raw numbers, old velocity", "strict SI, new velocity", "strict SI, old velocity"])
def test_an_unstable_reading_is_reported_with_the_largest_stable_step(reading: str) -> None:
    lattice = Loaded(BLOCK, Springs.for_mode("study", 0.1))
    lattice.press(0.3)
    scheme = euler.READINGS[reading]
    with pytest.raises(euler.Unstable, match=rf"must stay below {scheme.largest_step_s(0.1):.3g} s"):
        euler.run(lattice, scheme)


def test_the_stated_limit_of_the_time_step_is_the_limit() -> None:
    limit = euler.EulerScheme().largest_step_s(0.1)
    assert euler.EulerScheme(step_s=0.999 * limit).growth_per_step(0.1) < 1.0
    assert euler.EulerScheme(step_s=1.01 * limit).growth_per_step(0.1) > 1.0


def test_a_step_of_no_length_is_refused() -> None:
    with pytest.raises(UsageError, match=r"time step of the Euler scheme is 0\.0"):
        euler.EulerScheme(step_s=0.0)
