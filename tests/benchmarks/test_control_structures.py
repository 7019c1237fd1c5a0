"""Other structures of feedback: where they must be the law itself, and that what keeps no margin is not taken."""

import numpy as np
import pytest

from benchmarks.control import structures
from benchmarks.control.plants import PLANT, model_of, wiring_of
from benchmarks.control.structures import Candidate, best, kept, left, observer, predictor
from controller.experiments import tracking
from controller.law.loop_response import Constants, grid
from controller.law.stability import ForceLoop
from controller.law.synthesis import as_modelled


@pytest.fixture(scope="module")
def loop() -> ForceLoop:
    return tracking.loop_for(model_of("average"), wiring_of(PLANT))


def test_an_observer_that_sees_nothing_and_a_predictor_without_delay_are_the_law(loop: ForceLoop) -> None:
    omega = grid(loop.rates, 200)
    law = Constants(60.0, 0.004, 0.0)
    expected = loop._replace(law=law).response(1.0, omega)
    blind = observer(loop, loop.axis, Candidate(60.0, 0.004, 1e9), as_modelled(loop.span), omega)
    assert blind == pytest.approx(expected, rel=1e-4)
    prompt = loop._replace(axis=loop.axis._replace(delay_s=0.0), law=law._replace(drift_rad_s=18.0))
    found = predictor(prompt, prompt.axis, Candidate(60.0, 0.004, 0.3), as_modelled(loop.span), omega)
    assert found == pytest.approx(prompt.response(1.0, omega), rel=1e-9)


def test_an_observer_is_a_second_integral_where_motion_is_slow(loop: ForceLoop) -> None:
    """1 - Q G is s (filter + delay + lags) there, so that L is one over s^2 times crossover over all of that."""
    omega, by = np.array([0.05]), Candidate(60.0, 0.004, 0.02)
    axis = loop.axis
    late_s = by.third + axis.delay_s + axis.lag1_s + axis.lag2_s
    found = observer(loop, axis, by, as_modelled(loop.span), omega)[-1, 0]
    assert found == pytest.approx(-by.crossover_rad_s / (late_s * 0.05**2), rel=0.05)


def test_what_is_found_keeps_the_margins_and_twice_the_gain_does_not(loop: ForceLoop) -> None:
    found = best(loop, predictor, (0.3,))
    assert found
    assert kept(loop, predictor, found)
    assert not kept(loop, predictor, found._replace(crossover_rad_s=2 * found.crossover_rad_s))
    assert not kept(loop, observer, Candidate(1e4, 0.0, 0.02))
    assert left(loop, predictor, found)[-1] < 0.1
    assert len(structures.SHOWN_HZ) == 3
