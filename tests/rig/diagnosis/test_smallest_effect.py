"""What is too small to act on is never named, however sure it is."""

import pytest

from rig.diagnosis.effects.bench import POSITION_RIPPLE, SURFACE_MOTION
from rig.diagnosis.indentation import library
from rig.diagnosis.problem import Effect
from rig.diagnosis.search import is_sizeable


@pytest.mark.parametrize("effect", library("index"), ids=lambda effect: effect.key)
def test_every_cause_has_a_size_below_which_it_is_not_named(effect: Effect) -> None:
    first = effect.amplitudes[0]
    values = {par.name: par.null for par in effect.pars}
    assert first.least > 0
    assert not is_sizeable(effect, values | {first.name: first.null + 0.99 * first.least})
    assert is_sizeable(effect, values | {first.name: first.null + 1.01 * first.least})


def test_a_motion_of_the_surface_counts_from_ten_micrometres_whatever_its_phase() -> None:
    still = {par.name: par.null for par in SURFACE_MOTION.pars}
    assert not is_sizeable(SURFACE_MOTION, still | {"surface_motion_sin_mm": 0.006, "surface_motion_cos_mm": -0.006})
    assert is_sizeable(SURFACE_MOTION, still | {"surface_motion_sin_mm": 0.008, "surface_motion_cos_mm": -0.008})


def test_a_screw_is_measured_better_than_a_surface() -> None:
    straight = {par.name: par.null for par in POSITION_RIPPLE.pars}
    assert is_sizeable(POSITION_RIPPLE, straight | {"ripple_sin_mm": 0.004})
