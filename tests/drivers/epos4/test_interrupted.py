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


def axis_on(stage: DriveBench, interrupted: Callable[[], bool]) -> Epos4Axis:
    axis = Epos4Axis(Epos4Wiring(port="memory"), Limits(), stage.now, open_link=stage.open, interrupted=interrupted)
    axis.start()
    return axis


@pytest.mark.parametrize("after_ms", [0, 20, 60, 100, 200, 300])
def test_a_stop_at_any_moment_of_homing_brakes_the_axis(after_ms: int) -> None:
    stage = DriveBench(position_mm=8.0)
    begun_ns = stage.now()
    axis = axis_on(stage, lambda: stage.now() >= begun_ns + after_ms * MS)
    begun_ns = stage.now()
    with pytest.raises(SafetyStop, match="stopped on request while it was moved"):
        axis.home()
    assert stage.now() - begun_ns < (after_ms + 10) * MS
    stage.run(RAMP_MS * 1e-3 + 0.03)
    stood_mm = stage.plant.position_mm
    stage.run(0.5)
    assert stage.plant.position_mm == pytest.approx(stood_mm, abs=1e-3)
    axis.close()
    assert not stage.plant.powered


def test_a_stop_during_a_profile_move_and_while_it_is_enabled_brakes_too() -> None:
    stage = DriveBench(position_mm=8.0)
    pressed: list[bool] = []
    axis = axis_on(stage, lambda: bool(pressed) and stage.now() >= at_ns)
    at_ns = 0
    axis.home()
    pressed.append(True)
    at_ns = stage.now() + 200 * MS
    with pytest.raises(SafetyStop, match="stopped on request"):
        axis.move_to(50, 30)
    stage.run(0.1)
    assert stage.plant.position_mm < 10
    with pytest.raises(SafetyStop, match="stopped on request"):
        axis.enable()
    assert not axis.enabled


def test_closing_is_not_interrupted() -> None:
    stage = DriveBench(position_mm=8.0)
    axis = axis_on(stage, lambda: True)
    with pytest.raises(SafetyStop):
        axis.home()
    axis.close()
    assert not stage.plant.powered
    assert stage.closed
