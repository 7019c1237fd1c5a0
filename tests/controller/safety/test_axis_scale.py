"""An axis that goes another way than it says is stopped by the tracker, in the air where there is way enough."""

import pytest

from controller.loop.modes import Mode
from controller.loop.registration import Interval
from controller.loop.state import LoopState
from controller.loop.steps import MoveTo
from controller.safety.inputs import SafetyInputs
from controller.safety.table import TABLE, evaluate
from rig.config.wiring import Wiring
from tests.controller.fake_bench import APPROACH, LEAVE, PRESS, ZERO, FakeBench


@pytest.mark.parametrize("scale", [0.5, 2.0, 1.2])
def test_a_wrong_scale_is_found_within_three_millimetres_and_before_contact(scale: float) -> None:
    bench = FakeBench(position_mm=10.0)
    bench.tracker.scale = scale
    bench.begin(ZERO, APPROACH, PRESS, LEAVE)
    bench.until(lambda: bench.mode is Mode.RETRACT)
    assert bench.latched == "axis_scale"
    assert bench.axis.position_mm < (13.0 if abs(scale - 1) > 0.3 else 18.5)
    assert bench.true_peak_N == 0.0
    cause = bench.loop.machine.latched
    assert cause and "mm for each mm of the axis" in cause.text and "axis.increments_per_mm" in cause.text


def test_a_right_scale_stops_nothing() -> None:
    bench = FakeBench()
    assert bench.run(ZERO, MoveTo(position_mm=18.0, speed_mm_s=20.0))["cause"] == ""
    scale = bench.loop.state.axis_scale
    assert scale is not None and scale.low == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(
    ("interval", "stops"),
    [((0.94, 0.96), False), ((0.90, 0.949), True), ((1.04, 1.2), False), ((1.051, 1.2), True), ((0.5, 1.5), False)],
)
def test_it_stops_where_the_whole_interval_is_beyond_the_tolerance(interval: tuple[float, float], stops: bool) -> None:
    state = LoopState(axis_scale=Interval(*interval))
    (line,) = (line for line in TABLE if line.code == "axis_scale")
    assert bool(line.evaluate(state, SafetyInputs(), Wiring())) is stops
    assert (evaluate(state, SafetyInputs(), Wiring(), (line,)) is not None) is stops
