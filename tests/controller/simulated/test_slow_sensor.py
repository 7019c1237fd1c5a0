"""A force sensor of 100 Hz (FT 300): feedback once a sample settles, and what its noise leaves is what was derived."""

from functools import cache

import numpy as np
import pytest

from controller.experiments import tracking
from controller.law.stability import ForceLoop
from controller.loop.steps import TrackForce
from controller.simulated.bench import SENSING, SimulatedBench, follow, limb_of
from mock_devices.testing.made.subjects import NAMES, SLOW_RESPONSE, subject
from rig.config.wiring import Wiring

FT300 = Wiring.model_validate({"force": {"product": "robotiq-ft300"}})
SLOW = SENSING._replace(filter_s=0.003, noise_N=0.05, quantum_N=0.01, delay_cycles=4, every_cycles=10)
QUIET = SLOW._replace(noise_N=0.0)


@cache
def law(name: str) -> TrackForce:
    return tracking.force_law(subject(name), FT300, SLOW_RESPONSE)


def loop(name: str) -> ForceLoop:
    return tracking.loop_for(subject(name), FT300, SLOW_RESPONSE)


@pytest.mark.parametrize(("stiffness", "settled_s"), [(0.5, 0.35), (1.0, 0.1), (2.0, 0.35)])
def test_jumps_of_1_N_settle_within_a_twentieth_also_where_the_model_is_wrong(
    stiffness: float, settled_s: float
) -> None:
    levels_N = np.arange(1.0, 11.0)
    for name in NAMES:
        limb = limb_of(subject(name), stiffness)
        trace = follow(law(name), np.repeat(levels_N, 1500), SimulatedBench(limb, sensing=QUIET))
        error_N = (trace.force_N - trace.reference_N).reshape(10, 1500)[1:]
        assert np.max(np.abs(error_N[:, round(1000 * settled_s) :])) < 0.05, name


@pytest.mark.parametrize("force_N", [0.5, 2.0])
def test_the_noise_in_the_tissues_force_is_the_share_that_the_loop_states(force_N: float) -> None:
    """Where tissue is soft, dry friction (some micrometres) adds next to nothing to it."""
    trace = follow(law("soft"), np.full(40_000, force_N), SimulatedBench(limb_of(subject("soft")), sensing=SLOW))
    stated_N = loop("soft").noise_share() * SLOW.noise_N
    assert np.std(trace.force_N[5000:]) == pytest.approx(stated_N, rel=0.25)
    assert stated_N <= 0.025


def test_the_motion_that_is_left_is_the_share_that_the_loop_states() -> None:
    """A surface moving by 0.2 mm at 1 Hz against the same without feedback."""
    name, force_N = "average", 2.0
    limb = limb_of(subject(name), breathing_mm=0.2, breathing_Hz=1.0)
    stays = law(name).model_copy(update={"crossover_rad_s": 1e-9, "drift_rad_s": 0.0})
    swings = []
    for step in (law(name), stays):
        trace = follow(step, np.full(9000, force_N), SimulatedBench(limb, sensing=QUIET))
        turn = np.exp(-2j * np.pi * trace.time_s[-4000:])
        swings.append(abs(np.mean(trace.force_N[-4000:] * turn)))
    row = min(law(name).gains, key=lambda row: abs(row.force_N - force_N))
    stated = loop(name).at(row, 0.01).left_of_motion(1.0)
    assert swings[0] / swings[1] == pytest.approx(stated, rel=0.1)


def test_breathing_is_followed_too() -> None:
    for name in NAMES:
        limb = limb_of(subject(name), breathing_mm=1.5, breathing_Hz=0.25)
        trace = follow(law(name), np.full(10_000, 0.5), SimulatedBench(limb, sensing=QUIET))
        assert np.sqrt(np.mean((trace.force_N[3000:] - 0.5) ** 2)) < 0.025


def test_a_law_that_acts_on_each_sample_ten_times_is_caught() -> None:
    """Told of a new sample each cycle where there is one in ten: its leads see steps and not slopes."""
    step = law("average")
    every_cycle = follow(step, np.full(8000, 5.0), SimulatedBench(limb_of(subject("average")), sensing=SLOW))
    fast = tracking.force_law(subject("average"), Wiring(), SLOW_RESPONSE)
    wrong = follow(fast, np.full(8000, 5.0), SimulatedBench(limb_of(subject("average")), sensing=SLOW))
    assert np.std(wrong.force_N[4000:]) > 1.5 * np.std(every_cycle.force_N[4000:])
