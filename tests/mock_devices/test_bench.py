import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mock_devices.bench import Bench
from mock_devices.parameters import Axis, Camera, Parameters, Sensor, Surface, Tissue
from mock_devices.physics.chain import Chain
from mock_devices.physics.tissue import TissueLaw
from tests.mock_devices.playing import MS_NS, QUIET, SURFACE_MM, play, quiet_bench, settle, stroke


def index_law_N(depth_mm: float) -> float:
    """F = a x exp(b x) with the bench's default a = 0.12 N/mm and b = 0.22 1/mm."""
    return 0.12 * depth_mm * math.exp(0.22 * depth_mm)


def test_default_forearm_answers_eight_millimetres_with_about_five_and_a_half_newtons() -> None:
    assert index_law_N(8.0) == pytest.approx(5.58, abs=0.01)
    assert index_law_N(11.0) < 20


@pytest.mark.parametrize("depth_mm", [0.5, 2.0, 5.0, 8.0, 11.0])
def test_force_at_rest_is_the_index_law_in_closed_form(depth_mm: float) -> None:
    trace = settle(quiet_bench(), SURFACE_MM + depth_mm, 3.0)
    assert trace.axis_mm[-1] == pytest.approx(SURFACE_MM + depth_mm, abs=1e-4)
    assert trace.force_N[-1] == pytest.approx(index_law_N(depth_mm), abs=1e-3)


def test_force_in_motion_adds_the_viscous_term() -> None:
    trace = play(quiet_bench(), stroke(20.0, 8.0, start_mm=5.0), 1.05)
    depth_mm = trace.tip_mm[-1] - SURFACE_MM
    assert depth_mm > 5
    assert trace.force_N[-1] == pytest.approx(index_law_N(depth_mm) + 0.01 * trace.speed_mm_s[-1], abs=2e-3)


@given(st.floats(-50, 50), st.floats(-200, 200), st.floats(0, 10))
def test_tissue_never_pulls_and_is_not_felt_in_the_air(depth_mm: float, speed_mm_s: float, time_s: float) -> None:
    force_N = TissueLaw(Tissue()).force_N(Chain(), depth_mm, speed_mm_s, time_s)
    assert force_N >= 0
    assert depth_mm > 0 or force_N == 0


def test_drive_follows_a_sine_of_25_hz_with_more_than_half_its_power() -> None:
    def gain(frequency_Hz: float) -> float:
        trace = play(quiet_bench(), lambda t: 5 + 0.2 * math.sin(math.tau * frequency_Hz * t), 1.0)
        wave = np.exp(-1j * math.tau * frequency_Hz * trace.time_s[500:])
        return float(abs(np.mean((trace.axis_mm[500:] - 5) * wave)) / 0.1)

    assert gain(25.0) > math.sqrt(0.5)
    assert gain(100.0) < 0.5
    assert all(gain(frequency_Hz) < 1.05 for frequency_Hz in (2.0, 5.0, 10.0, 20.0))


def test_drive_does_not_overshoot_a_step_and_settles_on_it() -> None:
    trace = play(quiet_bench(), lambda _: 5.5, 1.0)
    assert trace.axis_mm.max() < 5.501
    assert trace.axis_mm[-1] == pytest.approx(5.5, abs=1e-5)
    assert trace.axis_mm[25] > 5.4


def test_drive_is_less_than_ten_milliseconds_behind_a_ramp() -> None:
    trace = play(quiet_bench(), lambda t: 5 + 30 * t, 0.4)
    lag_mm = 5 + 30 * 0.4 - trace.axis_mm[-1]
    assert 0 < lag_mm < 30 * 0.010
    assert trace.speed_mm_s[-1] == pytest.approx(30, abs=0.5)


def test_motor_gives_its_current_limit_and_no_more() -> None:
    bench = quiet_bench()
    bench.axis.current_limit_A = 0.5
    trace = play(bench, lambda _: 25.0, 0.05)
    assert np.abs(trace.current_A).max() == pytest.approx(0.5)
    final_mm_s = (0.5 * 41.7 - 3.0) / 0.05
    assert trace.speed_mm_s[20] == pytest.approx(final_mm_s * -math.expm1(-50 / 8.0 * trace.time_s[20]), rel=0.01)


@pytest.mark.parametrize(("brake_N", "holds"), [(400.0, True), (0.0, False)])
def test_without_power_it_is_the_brake_that_holds_against_the_tissue(brake_N: float, holds: bool) -> None:
    bench = quiet_bench(axis={"brake_N": brake_N})
    settle(bench, SURFACE_MM + 11.0, 3.0)
    bench.axis.power(False)
    bench.advance(bench.now_ns + 1000 * MS_NS)
    assert bench.axis.current_A == 0
    pushed_back_mm = SURFACE_MM + 11.0 - bench.axis.position_mm
    assert (pushed_back_mm < 0.2) is holds
    held_mm = bench.axis.position_mm
    bench.advance(bench.now_ns + 1000 * MS_NS)
    assert bench.axis.position_mm == pytest.approx(held_mm, abs=1e-9) or not holds


def test_power_holds_where_the_carriage_is_until_a_set_point_comes() -> None:
    bench = quiet_bench()
    bench.axis.target(30.0)
    bench.axis.power(True)
    bench.advance(500 * MS_NS)
    assert bench.axis.position_mm == pytest.approx(5.0, abs=1e-6)


@pytest.mark.parametrize(("position_mm", "closed"), [(0.5, False), (-0.5, True)])
def test_reference_switch_closes_at_zero(position_mm: float, closed: bool) -> None:
    bench = quiet_bench()
    settle(bench, position_mm, 1.0)
    assert bench.axis.at_reference is closed


def test_carriage_ends_at_its_mechanical_stop() -> None:
    bench = quiet_bench()
    settle(bench, -9.0, 1.0)
    assert bench.axis.position_mm == -3.0
    assert bench.axis.velocity_mm_s == 0


def test_surface_moved_away_while_running_goes_there_at_a_limb_s_speed_and_takes_the_force_with_it() -> None:
    bench = quiet_bench()
    settle(bench, SURFACE_MM + 5)
    bench.limb.wanted_mm = SURFACE_MM + 3
    bench.advance(bench.now_ns + 20 * MS_NS)
    assert bench.limb.position_mm == pytest.approx(SURFACE_MM + 1)
    bench.advance(bench.now_ns + 1000 * MS_NS)
    assert bench.limb.position_mm == SURFACE_MM + 3
    assert bench.contact_N == pytest.approx(index_law_N(2.0), abs=1e-3)


def test_surface_coming_nearer_pushes_harder() -> None:
    bench = quiet_bench()
    settle(bench, SURFACE_MM + 5)
    bench.limb.wanted_mm = SURFACE_MM - 2
    bench.advance(bench.now_ns + 2000 * MS_NS)
    assert bench.contact_N == pytest.approx(index_law_N(7.0), abs=1e-3)


def test_tissue_stiffened_while_running_gives_twice_the_force() -> None:
    bench = quiet_bench()
    settle(bench, SURFACE_MM + 5)
    bench.tissue.stiffness_scale = 2.0
    bench.advance(bench.now_ns + 1000 * MS_NS)
    assert bench.contact_N == pytest.approx(2 * index_law_N(5.0), abs=1e-3)


def test_tissue_removed_while_running_leaves_no_force_and_comes_back() -> None:
    bench = quiet_bench()
    settle(bench, SURFACE_MM + 5)
    bench.tissue.present = False
    bench.advance(bench.now_ns + 500 * MS_NS)
    assert bench.contact_N == 0
    bench.tissue.present = True
    bench.advance(bench.now_ns + 500 * MS_NS)
    assert bench.contact_N == pytest.approx(index_law_N(5.0), abs=1e-3)


def test_unloaded_sensor_reads_its_zero_with_five_millinewtons_of_noise() -> None:
    bench = Bench(Parameters(), seed=1)
    readings = np.array([bench.force.wrench() for _ in range(20_000)])
    assert readings.mean(axis=0) == pytest.approx([0.21, -0.14, 0.8, 0.004, -0.011, 0.002], abs=2e-4)
    assert readings[:, :3].std(axis=0) == pytest.approx([0.005] * 3, rel=0.03)
    assert np.allclose(readings[:, :3] * 1000, np.round(readings[:, :3] * 1000), atol=1e-6)


def test_compression_is_negative_on_fz_with_a_little_cross_talk_and_the_lever_s_moment() -> None:
    bench = quiet_bench()
    settle(bench, SURFACE_MM + 8, 3.0)
    wrench = np.array(bench.force.wrench()) - np.array(bench.force.zero)
    force_N = index_law_N(8.0)
    expected = [-0.004 * force_N, -0.004 * force_N, -force_N, -0.0015 * force_N, 0, 0]
    assert wrench == pytest.approx(expected, abs=1e-3)


def test_other_axis_and_sign_are_one_line_of_the_file() -> None:
    sensor = QUIET.model_copy(update={"axis": "fx", "compression": "positive"})
    bench = quiet_bench(force=sensor)
    settle(bench, SURFACE_MM + 8, 3.0)
    assert bench.force.wrench()[0] - bench.force.zero[0] == pytest.approx(index_law_N(8.0), abs=1e-3)


def test_sensor_at_its_end_says_so_and_reads_no_further() -> None:
    bench = quiet_bench(force=QUIET.model_copy(update={"range_N": 3.0}))
    assert not bench.force.overrange()
    settle(bench, SURFACE_MM + 8, 3.0)
    assert bench.force.overrange()
    assert bench.force.wrench()[2] == -3.0


def test_every_product_see_the_same_force_each_with_its_own_zero() -> None:
    bench = quiet_bench(force_modbus=QUIET.model_copy(update={"zero_N": (0.0, 0.0, -2.0)}))
    settle(bench, SURFACE_MM + 8, 3.0)
    assert bench.force.wrench()[2] - 0.8 == pytest.approx(bench.force_modbus.wrench()[2] + 2.0, abs=1e-6)


def test_sensor_warms_up_after_power_on() -> None:
    bench = quiet_bench(force=QUIET.model_copy(update={"warm_up_s": 2.0, "warm_up_K": 4.0}))
    bench.advance(2000 * MS_NS)
    bench.force.wrench()
    assert bench.force.temperature_C == pytest.approx(25 + 4 * (1 - math.exp(-1)), abs=1e-3)


def test_marker_on_the_tip_rides_along_the_camera_s_direction_one_latency_late() -> None:
    camera = Camera(noise_mm=0, noise_deg=0, direction=(0.0, 3.0, -4.0), latency_s=0.02)
    bench = quiet_bench(tracker=camera)
    trace = play(bench, lambda t: 5 + 20 * t, 0.5)
    tip, arm = bench.tracker.markers(bench.now_ns)
    assert tip and arm
    late_mm = float(trace.tip_mm[-1 - 20])
    assert (tip.x_mm, tip.y_mm, tip.z_mm) == pytest.approx((35, -60 + 0.6 * late_mm, -1400 - 0.8 * late_mm), abs=1e-6)
    assert (arm.y_mm, arm.z_mm) == pytest.approx((-40 + 0.6 * 20, -1405 - 0.8 * 20))
    assert tip[3:7] == (1, 0, 0, 0)


def test_marker_on_the_arm_follows_the_surface_not_the_tip() -> None:
    bench = quiet_bench(tracker={"noise_mm": 0})
    before = bench.tracker.markers(0)[1]
    bench.limb.wanted_mm = SURFACE_MM + 2
    bench.advance(500 * MS_NS)
    after = bench.tracker.markers(500 * MS_NS)[1]
    assert before and after
    assert math.dist(before[:3], after[:3]) == pytest.approx(2.0)


def test_tracker_noise_has_the_size_asked_for_and_tools_can_leave_the_view() -> None:
    bench = quiet_bench()
    tips = [tip for tip, _ in (bench.tracker.markers(0) for _ in range(5000)) if tip]
    assert np.array([tip[:3] for tip in tips]).std(axis=0) == pytest.approx([0.06] * 3, rel=0.05)
    assert math.hypot(*tips[0][3:7]) == pytest.approx(1.0)
    bench.tracker.tip_in_view = False
    tip, arm = bench.tracker.markers(0)
    assert tip is None
    assert arm is not None


def test_between_two_steps_position_and_force_are_those_of_the_moment_asked_for() -> None:
    bench = quiet_bench()
    play(bench, stroke(20.0, 8.0, start_mm=5.0), 1.0)
    at_step = (bench.axis.position_mm, bench.force.wrench()[2])
    speed_mm_s = bench.axis.velocity_mm_s
    bench.advance(bench.now_ns + 100_000)
    between = (bench.axis.position_mm, bench.force.wrench()[2])
    depth_mm = at_step[0] - SURFACE_MM
    slope_N_mm = 0.12 * (1 + 0.22 * depth_mm) * math.exp(0.22 * depth_mm)
    moved_mm = speed_mm_s * 1e-4
    assert between[0] - at_step[0] == pytest.approx(moved_mm)
    assert between[1] - at_step[1] == pytest.approx(-slope_N_mm * moved_mm, rel=0.1)


def everything_seen(seed: int, step_ns: int) -> list[object]:
    bench = Bench(Parameters(), seed)
    bench.axis.power(True)
    bench.axis.target(26.0)
    seen: list[object] = []
    for now_ns in range(step_ns, 600 * MS_NS, step_ns):
        bench.advance(now_ns)
        seen += [bench.force.wrench(), bench.axis.position_mm, tuple(bench.tracker.markers(now_ns))]
    return seen


def test_same_seed_gives_the_same_bench_and_another_seed_another_noise() -> None:
    assert everything_seen(3, MS_NS) == everything_seen(3, MS_NS)
    assert everything_seen(3, MS_NS) != everything_seen(4, MS_NS)


def test_how_often_it_is_asked_does_not_change_the_physics() -> None:
    rare, often = quiet_bench(), quiet_bench()
    for bench in (rare, often):
        bench.axis.power(True)
        bench.axis.target(28.0)
    rare.advance(900 * MS_NS)
    for now_ns in range(0, 900 * MS_NS + 1, 90_000):
        often.advance(now_ns)
    assert rare.axis.position_mm == often.axis.position_mm
    assert rare.contact_N == often.contact_N > 0


def test_a_skipped_gap_passes_without_physics() -> None:
    bench = quiet_bench()
    play(bench, lambda t: 5 + 20 * t, 1.0)
    position_mm = bench.axis.position_mm
    bench.skip(5000 * MS_NS)
    assert bench.now_ns == 6000 * MS_NS
    assert bench.time_s == pytest.approx(1.0)
    bench.advance(3000 * MS_NS)
    assert bench.axis.position_mm == position_mm


def test_parameters_shape_the_bench() -> None:
    stiff = quiet_bench(tissue=Tissue(a_N_mm=0.5, b_per_mm=0.0, damping_N_s_mm=0.0), surface=Surface(position_mm=12.0))
    settle(stiff, 14.0, 3.0)
    assert stiff.contact_N == pytest.approx(1.0, abs=1e-3)
    slow = quiet_bench(axis=Axis(smoothing_s=0.02))
    assert play(slow, lambda _: 6.0, 0.05).axis_mm[-1] < play(quiet_bench(), lambda _: 6.0, 0.05).axis_mm[-1]
    filtered = quiet_bench(force=Sensor(**QUIET.model_dump() | {"filter_s": 0.05}))
    trace = play(filtered, stroke(20.0, 8.0), 0.6)
    assert trace.force_N[-1] < trace.contact_N[-1] - 0.1
