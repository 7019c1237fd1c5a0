"""Sessions of the servo axis against the mock drive in one process, on a clock that only waiting moves."""

import math
from collections.abc import Sequence

import pytest

from drivers.epos4.device import Epos4Axis
from mock_devices.testing.epos4 import DriveBench
from rig.channels import AxisSample
from rig.config.wiring import Limits
from rig.errors import DeviceError, SafetyStop
from tests.drivers.epos4.sessions import axis_on, tick


def test_the_drive_says_who_it_is(axis: Epos4Axis) -> None:
    identity = axis.identity
    assert (identity.product, identity.serial, identity.firmware) == ("maxon EPOS4 61500000", "62014711", "0170")
    assert axis.period_ns == 1_000_000
    assert axis.fileno() == 99


def test_after_start_the_drive_has_its_limits_and_no_torque(bench: DriveBench, axis: Epos4Axis) -> None:
    values = bench.mock.dictionary.values
    assert not bench.plant.powered
    assert (values[0x607D, 1], values[0x607D, 2]) == (-1000, 121_000)
    assert values[0x6065, 0] == 4000
    assert values[0x1016, 1] == 127 << 16 | 100
    assert bench.plant.current_limit_A == 5.0
    assert not axis.enabled
    assert axis.fault == ""


def test_limits_are_in_the_drive_before_the_first_controlword_that_gives_torque(bench: DriveBench) -> None:
    axis = axis_on(bench)
    axis.start()
    axis.home()
    requests = [frame.data for frame in bench.sent if frame.can_id == 0x601]
    enabling = [at for at, data in enumerate(requests) if data[:3] == b"\x2b\x40\x60" and data[4] & 0x0F == 0x0F]
    limits = [at for at, data in enumerate(requests) if data[:3] in (b"\x23\x7d\x60", b"\x23\x65\x60", b"\x23\x85\x60")]
    assert len(limits) == 4
    assert max(limits) < min(enabling)
    axis.close()


def test_a_drive_that_counts_other_increments_a_turn_is_refused_before_anything_is_written() -> None:
    """Object 3000:05, in increments a revolution: at 4096 it would turn 2.44 times as fast as at the 10,000 stated."""
    bench = DriveBench(increments_per_rev=4096.0)
    with pytest.raises(DeviceError, match=r"counts 4096 increments a turn \(object 3000:05\) .* says 10000: give"):
        axis_on(bench).start()
    assert not [frame for frame in bench.sent if frame.can_id == 0x601 and frame.data[0] & 0xE0 == 0x20]
    assert axis_on(bench).identify().serial == "62014711"


@pytest.mark.parametrize("missing", [[5], range(10)], ids=["sub-index", "object"])
def test_a_drive_whose_firmware_does_not_say_its_increments_goes_by_those_stated_and_says_so(
    missing: Sequence[int],
) -> None:
    bench = DriveBench()
    known = bench.mock.dictionary.objects
    bench.mock.dictionary.objects = {
        key: one for key, one in known.items() if key not in {(0x3000, k) for k in missing}
    }
    if len(missing) == 1:
        bench.mock.dictionary.objects[0x3000, 0] = known[0x1018, 0]
    axis = axis_on(bench)
    axis.start()
    assert "its firmware has no object 3000:05" in axis.identity.settings["scale"]
    axis.close()


def test_speeds_are_told_in_turns_of_the_encoder_that_both_know() -> None:
    bench = DriveBench(increments_per_rev=4096.0)
    axis = axis_on(bench, increments_per_rev=4096.0)
    axis.start()
    assert bench.mock.dictionary.values[0x6099, 1] == round(20.0 * 2000 * 60 / 4096)
    axis.close()


def test_homing_finds_the_switch_and_makes_it_zero(bench: DriveBench, axis: Epos4Axis) -> None:
    axis.home()
    assert abs(bench.plant.position_mm) < 0.05
    assert bench.mock.drive.position == pytest.approx(bench.plant.position_mm * 2000, abs=60)


@pytest.mark.parametrize("method", [1, 17, 33, 34, 37])
def test_homing_ends_at_zero_by_every_method_the_stage_allows(method: int) -> None:
    bench = DriveBench(position_mm=3.0)
    axis = axis_on(bench, homing_method=method)
    axis.start()
    axis.home()
    bench.run(0.1)
    assert bench.mock.drive.position == pytest.approx(0, abs=20)
    axis.close()


def test_homing_against_a_stop_ends_where_the_current_rises() -> None:
    bench = DriveBench(position_mm=3.0)
    bench.plant.stop_mm = -2.0
    axis = axis_on(bench, homing_method=-4)
    axis.start()
    axis.home()
    bench.run(0.1)
    assert bench.plant.position_mm == pytest.approx(-2.0, abs=0.02)
    assert bench.mock.drive.position == pytest.approx(0, abs=40)
    axis.close()


def test_homing_starts_by_leaving_the_switch_where_it_stands_on_it() -> None:
    bench = DriveBench(position_mm=-1.0)
    axis = axis_on(bench)
    axis.start()
    axis.home()
    assert abs(bench.plant.position_mm) < 0.05
    axis.close()


def test_homing_again_is_not_fooled_by_the_first_one(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.move_to(20, 50)
    homed.home()
    assert abs(bench.plant.position_mm) < 0.05


def test_homing_without_a_switch_ends_at_its_deadline_and_the_axis_stops(bench: DriveBench, axis: Epos4Axis) -> None:
    bench.plant.has_switch = False
    with pytest.raises(DeviceError, match=r"homing by method 17 found no reference within 9\.5 s \(no fault\)"):
        axis.home()
    bench.run(0.2)
    before = bench.plant.position_mm
    bench.run(0.2)
    assert bench.plant.position_mm == pytest.approx(before, abs=1e-6)


def test_homing_by_a_switch_that_is_not_there_is_an_error_at_once(bench: DriveBench) -> None:
    axis = axis_on(bench, homing_method=7)
    axis.start()
    begun_ns = bench.now()
    with pytest.raises(DeviceError, match="homing by method 7 found no reference"):
        axis.home()
    assert bench.now() - begun_ns < 100_000_000
    axis.close()


def test_a_profile_move_ends_where_and_when_it_should(bench: DriveBench, homed: Epos4Axis) -> None:
    begun_ns = bench.now()
    homed.move_to(30, 30)
    bench.run(0.1)
    assert bench.plant.position_mm == pytest.approx(30, abs=0.01)
    assert (bench.now() - begun_ns) / 1e9 == pytest.approx(1.0 + 0.015 + 0.1, abs=0.05)
    assert not homed.enabled


def test_a_turned_axis_goes_into_the_tissue_all_the_same() -> None:
    bench = DriveBench(increments_per_mm=-2000.0)
    axis = axis_on(bench, direction=-1, homing_method=18)
    axis.start()
    axis.home()
    axis.move_to(10, 30)
    axis.enable()
    for _ in range(100):
        samples = tick(bench, axis, 10.0)
    assert bench.plant.position_mm == pytest.approx(10, abs=0.01)
    assert samples[-1].position_mm == pytest.approx(10, abs=0.01)
    for _ in range(20):
        samples = tick(bench, axis, 10.5)
    assert samples[-1].velocity_mm_s > 1
    assert samples[-1].current_A > 0
    axis.close()


def test_cyclic_positions_follow_a_sine_and_every_set_point_is_answered(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.move_to(10, 30)
    homed.enable()
    assert homed.enabled
    samples: list[AxisSample] = []
    for step in range(2000):
        samples += tick(bench, homed, 10 + 2 * math.sin(2 * math.pi * step / 1000))
    assert homed.enabled
    assert len(samples) == 1999
    assert [sample.seq for sample in samples] == list(range(1999))
    assert all(sample.arrival_ns - sample.capture_ns == 1_000_000 for sample in samples)
    assert all(sample.valid for sample in samples)
    positions = [sample.position_mm for sample in samples[1000:]]
    assert max(positions) == pytest.approx(12, abs=0.05)
    assert min(positions) == pytest.approx(8, abs=0.05)
    assert max(sample.velocity_mm_s for sample in samples) == pytest.approx(4 * math.pi, rel=0.05)
    assert homed.counters.device_lost == 0
    assert homed.counters.discarded_bytes == 0


def test_a_request_brings_a_sample_and_commands_nothing(bench: DriveBench, axis: Epos4Axis) -> None:
    before = len(bench.sent)
    axis.request(bench.now())
    bench.run(0.001)
    [sample] = axis.poll(bench.now())
    assert sample.position_mm == 0.0
    assert [frame.can_id for frame in bench.sent[before:]] == [0x080, 0x77F]


def test_enabling_does_not_move_the_axis(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.move_to(10, 30)
    for _ in range(10):
        bench.run(0.02)
        homed.poll(bench.now())
    before = bench.plant.position_mm
    homed.enable()
    bench.run(0.04)
    assert bench.plant.position_mm == pytest.approx(before, abs=0.001)


@pytest.mark.parametrize("position_mm", [-0.06, 60.06, 1000.0, math.nan, math.inf, -math.inf])
def test_a_position_beyond_the_limits_is_refused_and_nothing_is_sent(
    bench: DriveBench, homed: Epos4Axis, position_mm: float
) -> None:
    homed.enable()
    before = len(bench.sent)
    with pytest.raises(SafetyStop, match=r"refused to go to .* mm; .* are 0 and 60 mm"):
        homed.command(position_mm, bench.now())
    with pytest.raises(SafetyStop, match="refused"):
        homed.move_to(position_mm, 10)
    assert [frame for frame in bench.sent[before:] if frame.can_id == 0x201] == []


def test_a_hold_at_the_limit_may_ripple(bench: DriveBench, homed: Epos4Axis) -> None:
    homed.enable()
    homed.command(-0.03, bench.now())
    bench.run(0.05)
    assert homed.fault == ""
    assert bench.mock.dictionary.values[0x607A, 0] == 0


@pytest.mark.parametrize("speed_mm_s", [0, -5, 60.1, math.nan])
def test_a_speed_beyond_the_limit_is_refused(homed: Epos4Axis, speed_mm_s: float) -> None:
    with pytest.raises(SafetyStop, match=r"refused to move at .* limits.speed_mm_s is 60 mm/s"):
        homed.move_to(10, speed_mm_s)


def test_without_a_reference_there_is_no_torque(bench: DriveBench, axis: Epos4Axis) -> None:
    with pytest.raises(DeviceError, match="enabling needs one; home the axis first"):
        axis.enable()
    with pytest.raises(DeviceError, match="moving needs one; home the axis first"):
        axis.move_to(10, 10)
    assert not bench.plant.powered


def test_an_axis_outside_its_limits_is_not_enabled(bench: DriveBench) -> None:
    axis = axis_on(bench, Limits(position_min_mm=5, position_max_mm=60))
    axis.start()
    axis.home()
    with pytest.raises(SafetyStop, match="are 5 and 60 mm"):
        axis.enable()
    axis.close()
