"""What is no number, or infinite, stops motion, and is never commanded."""

import math

import pytest

from controller.loop.modes import Mode
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from controller.loop.steps import Hold
from tests.controller.fake_bench import APPROACH, PRESS, ZERO, FakeBench
from tests.controller.plant_bench import BOTA, PlantBench, linear

NOT_FINITE = pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])


def pressing() -> FakeBench:
    """The tip in contact, on its way down."""
    bench = FakeBench()
    bench.begin(ZERO, APPROACH, PRESS, Hold(duration_s=9.0))
    bench.until(lambda: bench.force.true_N > 2.0)
    return bench


@NOT_FINITE
def test_a_position_that_is_no_number_stops_at_once_and_is_not_commanded(value: float) -> None:
    bench = pressing()
    bench.axis.reads_mm = value
    bench.wait(0.05)
    assert bench.loop.machine.latched and bench.loop.machine.latched.action.name == "IMMEDIATE"
    assert bench.axis.quick_stops
    assert all(math.isfinite(mm) for _, mm in bench.axis.commands)


@NOT_FINITE
def test_a_speed_that_is_no_number_stops_at_once(value: float) -> None:
    bench = pressing()
    bench.axis.velocity_mm_s = value
    bench.wait(0.05)
    assert bench.latched == "overspeed"


@NOT_FINITE
@pytest.mark.parametrize("channel", range(3))
def test_a_force_that_is_no_number_in_any_channel_retracts(value: float, channel: int) -> None:
    bench = PlantBench(BOTA, linear(1.0))
    bench.begin(ZERO, APPROACH, PRESS, Hold(duration_s=9.0))
    bench.until(lambda: bench.force.true_N > 2.0)
    x_N, y_N, z_N = (value if at == channel else 0.0 for at in range(3))
    bench.force.extra_N = lambda _: 0.0
    bench.force.disturbed_N = (x_N, y_N, z_N)
    bench.until(lambda: bench.mode is Mode.SAFE)
    assert bench.latched in ("force_limit", "force_invalid")
    assert bench.force.true_N == 0.0
    assert all(math.isfinite(mm) for _, mm in bench.axis.commands)


@NOT_FINITE
def test_a_moment_that_is_no_number_retracts(value: float) -> None:
    bench = pressing()
    bench.force.moment_N_m = (0.0, value, 0.0)
    bench.until(lambda: bench.mode is Mode.SAFE)
    assert bench.latched in ("torque_limit", "force_invalid")


def test_a_marker_that_is_no_number_is_a_marker_that_is_lost() -> None:
    bench = pressing()
    bench.tracker.limb_mm = (math.nan, 0.0, 0.0)
    bench.until(lambda: bench.mode is Mode.SAFE)
    assert bench.latched == "tracker_lost"


@NOT_FINITE
def test_a_step_that_leads_nowhere_is_stopped_and_nothing_is_commanded_of_it(value: float) -> None:
    class Astray:
        """A step gone wrong."""

        def advance(self, state: LoopState, elapsed_s: float) -> bool:
            """Asks for a place that is none."""
            state.setpoint = Setpoint(value, 0.0)
            return elapsed_s < 0.0

    bench = pressing()
    bench.loop.machine._run = Astray()  # type: ignore[assignment]
    bench.until(lambda: bench.mode is Mode.SAFE)
    assert bench.latched == "workspace"
    assert all(math.isfinite(mm) for _, mm in bench.axis.commands)
    assert bench.force.true_N == 0.0
