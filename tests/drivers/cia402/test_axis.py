"""The axis on a drive that is known by its data sheet: set-up, units, identity, homing, cyclic positions."""

import re
from pathlib import Path
from typing import Any

import pytest

from drivers.canopen.nmt import RPDO_IDS
from drivers.cia402.device import open_axis
from drivers.epos4.device import Epos4Axis
from mock_devices.cia402.mock import table
from mock_devices.testing.epos4 import DriveBench
from rig.config.products.cia402 import Cia402Wiring
from rig.config.wiring import Limits
from rig.errors import DeviceError
from tests.drivers.epos4.sessions import tick

KIND: dict[str, Any] = {
    "increments_per_mm": 1000.0, "increments_per_rev": 5000.0, "speed_unit": 1.0, "table": table(5.0),
    "number": 0x00C1_A402,
}  # fmt: skip
IN_INCREMENTS = 0x00B5_0000  # object 60A8 of a drive that counts its encoder's (CiA 303-2)


def axis_on(bench: DriveBench, **config: Any) -> Epos4Axis:
    wiring = Cia402Wiring(port="memory", **({"increments_per_mm": 1000.0, "lead_mm": 5.0} | config))
    return open_axis(wiring, Limits(), bench.now, open_link=bench.open)


@pytest.fixture
def bench() -> DriveBench:
    return DriveBench(**KIND)


@pytest.fixture
def axis(bench: DriveBench) -> Epos4Axis:
    axis = axis_on(bench)
    axis.start()
    return axis


def value(bench: DriveBench, index: int, sub: int = 0) -> int:
    return bench.mock.dictionary.values[index, sub]


def test_it_says_who_it_is_and_holds_the_configured_limits_in_its_own_units(bench: DriveBench, axis: Epos4Axis) -> None:
    assert axis.identity.product == "Neutral drive 00000402"
    assert axis.identity.serial == "00C1A402"
    assert axis.identity.firmware == "0002"
    assert (value(bench, 0x607D, 1), value(bench, 0x607D, 2)) == (-500, 60_500)
    assert value(bench, 0x607F) == 60_000
    assert value(bench, 0x6085) == 2_000_000
    assert value(bench, 0x6099, 1) == 20_000
    assert value(bench, 0x6065) == 2000
    assert value(bench, 0x6007) == 3
    assert bench.plant.current_limit_A == pytest.approx(5.0, abs=0.003)
    assert value(bench, 0x60C2, 1) == 1


def test_it_homes_moves_and_follows_cyclic_positions(bench: DriveBench, axis: Epos4Axis) -> None:
    before = axis.referenced
    axis.home()
    assert (before, axis.referenced) == (False, True)
    assert abs(bench.plant.position_mm) < 0.1
    axis.move_to(12, 30)
    assert bench.plant.position_mm == pytest.approx(12, abs=0.1)
    axis.enable()
    position_mm, samples = 12.0, []
    for _ in range(400):
        position_mm += 0.01
        samples += tick(bench, axis, position_mm)
    assert samples[-1].position_mm == pytest.approx(16, abs=0.2)
    assert samples[-1].velocity_mm_s == pytest.approx(10, abs=0.5)
    assert axis.counters.device_lost == 0
    axis.close()
    assert not bench.plant.powered


def test_the_current_is_the_thousandths_of_the_rated_one(bench: DriveBench, axis: Epos4Axis) -> None:
    """The plant's current is 2 A for each mm of lag; 6078 has it in thousandths of 3 A."""
    axis.home()
    axis.enable()
    bench.plant.stop_mm = 2.0
    bench.plant.position_mm = 2.0
    samples = [sample for _ in range(30) for sample in tick(bench, axis, 1.5)]
    assert samples[-1].current_A == pytest.approx(-1.0, abs=0.01)
    assert bench.mock.dictionary.value(0x6078) == pytest.approx(-333, abs=4)


def test_without_a_bit_for_it_the_reference_is_this_sessions(bench: DriveBench, axis: Epos4Axis) -> None:
    axis.home()
    axis.close()
    again = axis_on(bench)
    again.start()
    assert not again.referenced
    with pytest.raises(DeviceError, match="has no reference, and moving needs one; home the axis first"):
        again.move_to(5, 10)


def test_a_wrong_homing_method_is_the_drives_own_refusal(bench: DriveBench) -> None:
    with pytest.raises(DeviceError, match=r"refused writing 35 to object 6098:00 .*: 06090030 value out of range"):
        axis_on(bench, homing_method=35).start()


def test_a_data_sheet_of_another_drive_is_refused_before_anything_is_written(bench: DriveBench, tmp_path: Path) -> None:
    bench.mock.wrong_identity = True
    with pytest.raises(DeviceError, match=r"vendor 0x24a, product 0x00010002, the data sheet's 0xffff, 0x0"):
        axis_on(bench).start()
    assert value(bench, 0x607F) == 400_000


def test_the_scale_is_held_against_the_drives_own_feed_constant(bench: DriveBench) -> None:
    with pytest.raises(DeviceError, match=r"5000 units are one turn, .*lead_mm 5 that is 1000 a mm, where .* 2000"):
        axis_on(bench, increments_per_mm=2000.0).start()
    axis_on(bench, increments_per_mm=2000.0, lead_mm=0.0).start()
    bench.mock.dictionary.values[0x60A8, 0] = IN_INCREMENTS
    axis_on(bench, increments_per_mm=2000.0, lead_mm=2.5).start()


@pytest.mark.parametrize(
    ("unit", "lead_mm", "said"),
    [
        (0xFA01_0000, 0.0, r"1000 units a mm by its unit of position \(object 60A8\)"),
        (IN_INCREMENTS, 5.0, r"1000 units a mm by its own factors .* 5000 units are one turn, and axis.lead_mm 5"),
    ],
)
def test_a_scale_that_is_not_stated_is_taken_from_the_drive(
    bench: DriveBench, unit: int, lead_mm: float, said: str
) -> None:
    bench.mock.dictionary.values[0x60A8, 0] = unit
    axis = axis_on(bench, increments_per_mm=0.0, lead_mm=lead_mm)
    axis.start()
    assert re.match(said, axis.identity.settings["scale"])
    assert float(axis.identity.settings["increments_per_mm"]) == 1000.0
    assert (value(bench, 0x607D, 1), value(bench, 0x607D, 2)) == (-500, 60_500)
    axis.home()
    axis.move_to(12, 30)
    assert bench.plant.position_mm == pytest.approx(12, abs=0.1)


def test_a_drive_that_nobody_set_up_is_neither_told_nor_moved(bench: DriveBench) -> None:
    bench.mock.dictionary.values[0x6092, 1] = 1
    axis = axis_on(bench, increments_per_mm=0.0)
    with pytest.raises(DeviceError, match=r"nothing says how many .*: give axis.increments_per_mm, or axis.lead_mm"):
        axis.start()
    for act in (axis.home, axis.enable, lambda: axis.move_to(1.0, 1.0), lambda: axis.command(1.0, bench.now())):
        with pytest.raises(DeviceError, match="is not started"):
            act()
    assert value(bench, 0x607F) == 400_000
    assert not bench.plant.powered


def test_factors_that_cannot_be_divided_are_told(bench: DriveBench) -> None:
    bench.mock.dictionary.values[0x6092, 2] = 0
    with pytest.raises(DeviceError, match=r"object 6092:02 .* is 0, and nothing can be divided by it"):
        axis_on(bench).start()


def test_a_drive_without_cyclic_positions_is_told_by_its_modes(bench: DriveBench) -> None:
    bench.mock.dictionary.values[0x6502, 0] = 0x21
    with pytest.raises(DeviceError, match=r"lacks modes 8 \(cyclic synchronous position\) \(object 6502 is 0x21\)"):
        axis_on(bench).start()


def test_the_speed_unit_can_be_rpm(bench: DriveBench) -> None:
    axis = axis_on(bench, speed_unit="rpm", increments_per_rev=6000.0)
    axis.start()
    assert value(bench, 0x607F) == 600  # 60 mm/s are 60,000 units/s, and one rpm 100 of them


def test_a_restart_loses_limits_and_is_told(bench: DriveBench, axis: Epos4Axis) -> None:
    axis.home()
    bench.mock.restart()
    bench.run(0.1)
    with pytest.raises(DeviceError, match="restarted by itself and lost its limits"):
        axis.poll(bench.now())


def test_its_host_that_falls_silent_stops_it(bench: DriveBench, axis: Epos4Axis) -> None:
    axis.home()
    axis.enable()
    for step in range(100):
        tick(bench, axis, step * 0.05)
    bench.run(0.5)
    assert not bench.plant.powered
    assert bench.mock.dictionary.value(0x603F) == 0x8130


def test_set_points_go_by_the_first_pdo_only(bench: DriveBench, axis: Epos4Axis) -> None:
    axis.home()
    axis.enable()
    bench.sent.clear()
    axis.command(0.0, bench.now())
    assert [frame.can_id for frame in bench.sent] == [RPDO_IDS[0] + 1, 0x080]
