"""The cyclic modes beside position, and the bits of profile velocity, against closed forms of the plant behind them."""

import pytest

from mock_devices.testing.epos4 import ACCELERATION_PER_CURRENT, DriveBench
from tests.mock_devices.epos4.wire import control, download, enabled, follow, sdo, status, upload

# 128 mN m rated and 36.9 mN m/A: a thousandth of the rated torque is 3.469 mA.
CURRENT_PER_MILLE_A = 0.128 / 36.9


@pytest.fixture
def bench() -> DriveBench:
    return DriveBench()


def torque(bench: DriveBench, per_mille: int) -> None:
    assert download(bench, 0x6071, 0, 2, per_mille) == 0


def test_cyclic_torque_accelerates_the_carriage_by_the_current_that_belongs_to_it(bench: DriveBench) -> None:
    enabled(bench, 10)
    assert status(bench) & 0x1000
    torque(bench, 20)
    bench.run(0.01)
    speed_mm_s = bench.plant.velocity_mm_s
    follow(bench, 0.1)
    gained_mm_s = bench.plant.velocity_mm_s - speed_mm_s
    assert gained_mm_s == pytest.approx(0.1 * 20 * CURRENT_PER_MILLE_A * ACCELERATION_PER_CURRENT, rel=0.01)
    assert upload(bench, 0x6077, kind="h") == 20
    assert upload(bench, 0x30D1, 1) == pytest.approx(69, abs=1)
    torque(bench, -20)
    follow(bench, 0.3)
    assert bench.plant.velocity_mm_s < 0
    assert status(bench) & 0x6F == 0x27


def test_the_torque_offset_adds_and_the_largest_speed_bounds(bench: DriveBench) -> None:
    enabled(bench, 10)
    assert download(bench, 0x60B2, 0, 2, 30) == 0
    assert download(bench, 0x6080, 0, 4, 30) == 0  # 30 rpm are 2.5 mm/s
    torque(bench, -10)
    follow(bench, 0.5)
    assert bench.plant.velocity_mm_s == pytest.approx(2.5, abs=0.05)


def test_leaving_torque_for_position_holds_where_the_carriage_is(bench: DriveBench) -> None:
    enabled(bench, 10)
    torque(bench, 20)
    follow(bench, 0.2)
    assert download(bench, 0x6060, 0, 1, 1) == 0
    follow(bench, 0.5)
    held_mm = bench.plant.position_mm
    follow(bench, 0.2)
    assert bench.plant.position_mm == pytest.approx(held_mm, abs=1e-3)
    assert status(bench) & 0x6F == 0x27


def test_a_quick_stop_ends_a_push(bench: DriveBench) -> None:
    enabled(bench, 10)
    torque(bench, 20)
    follow(bench, 0.2)
    control(bench, 0x0B)
    follow(bench, 0.3)
    assert abs(bench.plant.velocity_mm_s) < 1e-3
    assert status(bench) & 0x6F == 0x07


def test_cyclic_velocity_goes_at_target_and_offset(bench: DriveBench) -> None:
    enabled(bench, 9)
    assert download(bench, 0x60FF, 0, 4, 60) == 0  # 60 rpm of 10,000 increments are 5 mm/s
    assert download(bench, 0x60B1, 0, 4, 12) == 0
    follow(bench, 0.3)
    assert bench.plant.velocity_mm_s == pytest.approx(6.0, rel=0.01)
    assert status(bench) & 0x1000


def test_profile_velocity_says_by_bit_12_whether_it_stands(bench: DriveBench) -> None:
    enabled(bench, 3)
    assert status(bench) & 0x1000
    assert download(bench, 0x60FF, 0, 4, 120) == 0
    follow(bench, 0.2)
    assert status(bench) & 0x1400 == 0x0400
    assert download(bench, 0x60FF, 0, 4, 0) == 0
    follow(bench, 0.3)
    assert status(bench) & 0x1400 == 0x1400


def test_each_mode_that_is_advertised_can_be_taken_and_no_other(bench: DriveBench) -> None:
    advertised = upload(bench, 0x6502, kind="I")
    for mode in range(1, 12):
        refused = download(bench, 0x6060, 0, 1, mode)
        assert refused == (0 if advertised >> (mode - 1) & 1 else 0x06090030)


def test_digital_inputs_and_other_objects_that_clients_ask_for_are_there(bench: DriveBench) -> None:
    assert [upload(bench, 0x3142, sub, "B") for sub in range(9)] == [8, 0, 1, 2, 19, 255, 255, 255, 255]
    assert upload(bench, 0x2005, kind="H") == 500
    assert sdo(bench, "40 50 1F 01 00 00 00 00") == "80501F0101000106"  # program data can only be written
