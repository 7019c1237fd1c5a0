"""A stop while the drive moves by itself: it is braked within a few milliseconds, wherever the driver waits."""

from collections.abc import Callable

import pytest

from drivers.epos4.device import Epos4Axis
from mock_devices.testing.epos4 import MS, DriveBench
from rig.config.products.maxon_epos4 import Epos4Wiring
from rig.config.wiring import Limits
from rig.errors import SafetyStop

RAMP_MS = 15
"""20 mm/s at 2000 mm/s2 is 10 ms; the plant lags by its time constant."""


def axis_on(bench: DriveBench, interrupted: Callable[[], bool]) -> Epos4Axis:
    axis = Epos4Axis(Epos4Wiring(port="memory"), Limits(), bench.now, open_link=bench.open, interrupted=interrupted)
    axis.start()
    return axis


@pytest.mark.parametrize("after_ms", [0, 20, 60, 100, 200, 300])
def test_a_stop_at_any_moment_of_homing_brakes_the_axis(after_ms: int) -> None:
    bench = DriveBench(position_mm=8.0)
    begun_ns = bench.now()
    axis = axis_on(bench, lambda: bench.now() >= begun_ns + after_ms * MS)
    begun_ns = bench.now()
    with pytest.raises(SafetyStop, match="stopped on request while it was moved"):
        axis.home()
    assert bench.now() - begun_ns < (after_ms + 10) * MS
    bench.run(RAMP_MS * 1e-3 + 0.03)
    stood_mm = bench.plant.position_mm
    bench.run(0.5)
    assert bench.plant.position_mm == pytest.approx(stood_mm, abs=1e-3)
    axis.close()
    assert not bench.plant.powered


def test_a_stop_during_a_profile_move_and_while_it_is_enabled_brakes_too() -> None:
    bench = DriveBench(position_mm=8.0)
    pressed: list[bool] = []
    axis = axis_on(bench, lambda: bool(pressed) and bench.now() >= at_ns)
    at_ns = 0
    axis.home()
    pressed.append(True)
    at_ns = bench.now() + 200 * MS
    with pytest.raises(SafetyStop, match="stopped on request"):
        axis.move_to(50, 30)
    bench.run(0.1)
    assert bench.plant.position_mm < 10
    with pytest.raises(SafetyStop, match="stopped on request"):
        axis.enable()
    assert not axis.enabled


def test_closing_is_not_interrupted() -> None:
    bench = DriveBench(position_mm=8.0)
    axis = axis_on(bench, lambda: True)
    with pytest.raises(SafetyStop):
        axis.home()
    axis.close()
    assert not bench.plant.powered
    assert bench.closed
