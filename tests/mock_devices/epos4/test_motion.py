"""The drive mock's state machine, its reactions to errors, and how it moves in each mode."""

import math
from itertools import pairwise

import pytest

from mock_devices.testing.epos4 import DriveBench, LaggingPlant
from tests.mock_devices.epos4.wire import control, download, enabled, exchange, follow, status, upload


@pytest.fixture
def bench() -> DriveBench:
    return DriveBench()


# The state machine


def test_the_walk_up_and_down(bench: DriveBench) -> None:
    walk = [control(bench, word) & 0x6F for word in (0x06, 0x07, 0x0F)]
    assert walk == [0x21, 0x23, 0x27]
    control(bench, 0x07)
    bench.run(0.01)
    assert status(bench) & 0x6F == 0x23
    assert not bench.plant.powered
    assert [control(bench, word) & 0x6F for word in (0x06, 0x00)] == [0x21, 0x40]


def test_enable_operation_goes_through_switched_on_by_itself(bench: DriveBench) -> None:
    assert [control(bench, word) & 0x6F for word in (0x06, 0x0F)] == [0x21, 0x27]


@pytest.mark.parametrize("word", [0x07, 0x0F, 0x00, 0x02, 0x80])
def test_nothing_but_shutdown_leads_out_of_switch_on_disabled(bench: DriveBench, word: int) -> None:
    assert control(bench, word) & 0x4F == 0x40


def test_a_quick_stop_holds_and_enable_leads_back(bench: DriveBench) -> None:
    enabled(bench, 1)
    assert control(bench, 0x0B) & 0x6F == 0x07
    bench.run(0.05)
    assert status(bench) & 0x46F == 0x407
    assert bench.plant.powered
    assert control(bench, 0x0F) & 0x6F == 0x27
    assert control(bench, 0x0B, 0x00) & 0x4F == 0x40
    assert not bench.plant.powered


def test_a_fault_is_reset_by_the_edge_and_not_by_the_level(bench: DriveBench) -> None:
    bench.mock.inject_fault(0x2310)
    assert control(bench, 0x80) & 0x4F == 0x40
    bench.mock.inject_fault(0x2310)
    assert control(bench, 0x80) & 0x4F == 0x08
    assert control(bench, 0x00, 0x80) & 0x4F == 0x40


def test_errors_and_their_reset_are_sent_as_emergencies(bench: DriveBench) -> None:
    bench.heard()
    bench.mock.inject_fault(0x2310)
    assert bench.heard() == b"t08181023020000000000\r"
    assert b"t08180000000000000000\r" in exchange(bench, b"t60182B40600080000000\r")


@pytest.mark.parametrize(("code", "still_powered"), [(0x2310, False), (0x8A88, False), (0x8611, True), (0x8120, True)])
def test_an_error_cuts_the_torque_or_brakes_first(bench: DriveBench, code: int, still_powered: bool) -> None:
    enabled(bench, 1)
    bench.mock.inject_fault(code)
    assert status(bench) & 0x4F == (0x0F if still_powered else 0x08)
    assert bench.plant.powered is still_powered
    bench.run(0.05)
    assert status(bench) & 0x4F == 0x08


def test_option_codes_may_ask_for_no_ramp(bench: DriveBench) -> None:
    assert download(bench, 0x605E, 0, 2, 0) == 0
    assert download(bench, 0x6007, 0, 2, 2) == 0
    for code in (0x8611, 0x8130):
        enabled(bench, 1)
        bench.mock.inject_fault(code)
        assert status(bench) & 0x4F == 0x08
        control(bench, 0x00, 0x80)


# Motion


def test_a_profile_is_a_trapezoid_with_the_handshake_of_its_mode(bench: DriveBench) -> None:
    for index, value in ((0x6081, 240), (0x6083, 6000), (0x6084, 6000), (0x607A, 20_000)):
        download(bench, index, 0, 4, value)
    enabled(bench, 1)
    assert status(bench) & 0x1400 == 0
    assert control(bench, 0x1F) & 0x1400 == 0x1000
    assert control(bench, 0x0F) & 0x1400 == 0
    positions = follow(bench, 0.6)
    assert status(bench) & 0x1400 == 0x400
    assert positions[-1] == pytest.approx(18.0, abs=0.02)
    speeds = [(after - before) / 0.001 for before, after in pairwise(positions)]
    assert max(speeds) == pytest.approx(20.0, abs=0.1)
    assert speeds[:100] == sorted(speeds[:100])
    assert len([speed for speed in speeds if speed > 19.9]) == pytest.approx(460, abs=30)


def test_a_relative_set_point_and_one_that_waits(bench: DriveBench) -> None:
    download(bench, 0x6081, 0, 4, 600)
    enabled(bench, 1)
    download(bench, 0x607A, 0, 4, 2000)
    control(bench, 0x5F, 0x0F)
    download(bench, 0x607A, 0, 4, 1000)
    assert control(bench, 0x5F, 0x0F) & 0x1000
    follow(bench, 0.5)
    assert status(bench) & 0x1400 == 0x400
    assert bench.plant.position_mm == pytest.approx(8 + 1.5, abs=0.01)


def test_halt_brakes_and_its_end_goes_on(bench: DriveBench) -> None:
    download(bench, 0x607A, 0, 4, 40_000)
    enabled(bench, 1)
    control(bench, 0x1F, 0x0F)
    follow(bench, 0.1)
    control(bench, 0x10F)
    follow(bench, 0.2)
    held = follow(bench, 0.1)
    assert held[-1] == pytest.approx(held[0], abs=0.001)
    control(bench, 0x0F)
    follow(bench, 0.6)
    assert bench.plant.position_mm == pytest.approx(28, abs=0.02)


def test_a_set_point_beyond_the_software_limit_is_an_error(bench: DriveBench) -> None:
    download(bench, 0x607D, 2, 4, 10_000)
    download(bench, 0x607A, 0, 4, 10_001)
    enabled(bench, 1)
    control(bench, 0x1F)
    assert upload(bench, 0x603F, kind="H") == 0x8A82


def run_past_software_limit(bench: DriveBench) -> None:
    download(bench, 0x607D, 2, 4, 4000)
    download(bench, 0x60FF, 0, 4, 240)
    enabled(bench, 3)
    follow(bench, 0.5)


def test_running_out_of_the_software_limit_is_an_error(bench: DriveBench) -> None:
    run_past_software_limit(bench)
    assert upload(bench, 0x603F, kind="H") == 0x8A82
    assert bench.plant.position_mm == pytest.approx(8 + 2.0, abs=0.6)


def test_an_unguarded_drive_runs_out_of_its_software_limit(bench: DriveBench) -> None:
    bench.mock.unguarded = True
    run_past_software_limit(bench)
    assert upload(bench, 0x603F, kind="H") == 0


def test_a_velocity_is_reached_with_the_profile_acceleration(bench: DriveBench) -> None:
    download(bench, 0x60FF, 0, 4, -120)
    enabled(bench, 3)
    positions = follow(bench, 0.5)
    assert (positions[-1] - positions[-101]) / 0.1 == pytest.approx(-10, abs=0.05)
    assert status(bench) & 0x400
    assert upload(bench, 0x606C) == pytest.approx(-120, abs=1)


def test_cyclic_positions_are_followed_at_once(bench: DriveBench) -> None:
    enabled(bench, 8)
    assert status(bench) & 0x1000
    for step in range(500):
        download(bench, 0x607A, 0, 4, round(1000 * math.sin(step / 50)))
        bench.run(0.001)
    assert bench.plant.position_mm == pytest.approx(8 + 0.5 * math.sin(9.9), abs=0.1)
    assert upload(bench, 0x603F, kind="H") == 0


def test_set_points_led_astray_take_the_carriage_with_them_until_the_drive_stops_by_itself(bench: DriveBench) -> None:
    enabled(bench, 8)
    bench.mock.unguarded = True
    set_point = b"t40160F0000000000\r"
    exchange(bench, b"t00020101\r")
    bench.mock.lead_astray(-4.0)
    for _ in range(500):
        exchange(bench, set_point)
        bench.run(0.001)
    assert bench.plant.position_mm == pytest.approx(8 - 4.0 * 0.5, abs=0.1)
    control(bench, 0x0B)
    stopped = follow(bench, 0.3)
    assert stopped[-1] == pytest.approx(stopped[-100], abs=0.001)


def test_a_carriage_that_is_held_is_a_following_error_even_without_sync(bench: DriveBench) -> None:
    enabled(bench, 8)
    bench.plant.position_mm += 1.5
    bench.plant.stop_mm = bench.plant.position_mm
    bench.run(0.02)
    assert upload(bench, 0x603F, kind="H") == 0x8611
    assert status(bench) & 0x2000


def test_homing_drives_onto_the_switch_and_leaves_it_slowly(bench: DriveBench) -> None:
    for index, sub, size, value in ((0x6098, 0, 1, 17), (0x6099, 1, 4, 240), (0x6099, 2, 4, 12), (0x609A, 0, 4, 24000)):
        download(bench, index, sub, size, value)
    enabled(bench, 6)
    control(bench, 0x1F)
    positions = follow(bench, 1.0)
    assert min(positions) < -0.05
    assert status(bench) & 0xB400 == 0x9400
    assert abs(bench.plant.position_mm) < 0.01
    assert abs(upload(bench, 0x6064)) < 20


def test_home_may_lie_away_from_the_switch(bench: DriveBench) -> None:
    for index, sub, size, value in ((0x6098, 0, 1, 17), (0x6099, 1, 4, 240), (0x6099, 2, 4, 60), (0x609A, 0, 4, 24000)):
        download(bench, index, sub, size, value)
    download(bench, 0x30B1, 0, 4, 4000)
    download(bench, 0x30B0, 0, 4, 100)
    enabled(bench, 6)
    control(bench, 0x1F)
    follow(bench, 1.5)
    assert bench.plant.position_mm == pytest.approx(2.0, abs=0.02)
    assert upload(bench, 0x6064) == pytest.approx(100, abs=4)


def test_a_missing_host_really_stops_the_carriage(bench: DriveBench) -> None:
    exchange(bench, b"t00020101\r")
    download(bench, 0x1016, 1, 4, 127 << 16 | 40)
    download(bench, 0x607A, 0, 4, 100_000)
    download(bench, 0x6085, 0, 4, 24_000)
    enabled(bench, 1)
    control(bench, 0x1F, 0x0F)
    exchange(bench, b"t77F105\r")
    positions = follow(bench, 0.3)
    assert positions[38] > positions[37] > positions[36]
    assert positions[-1] == pytest.approx(positions[150], abs=1e-9)
    assert status(bench) & 0x4F == 0x08
    assert not bench.plant.powered


def test_the_plant_of_these_tests_follows_with_its_time_constant() -> None:
    plant = LaggingPlant(0.0)
    plant.power(True)
    plant.target(1.0)
    for _ in range(100):
        plant.advance(1 / (2 * math.pi * 25) / 100)
    assert plant.position_mm == pytest.approx(1 - 1 / math.e, abs=1e-6)
