"""The state machine of one cycle, driven on an injected clock against a spring instead of a bench."""

import math

import pytest

from controller.law.inverse_model import GainRow
from controller.loop.modes import Mode
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from controller.loop.steps import Approach, Compress, Dither, Hold, MoveTo, Program, TrackForce, Zero
from controller.safety.table import Action, Incident
from mock_devices.testing.spring_bench import (
    APPROACH,
    LEAVE,
    PRESS,
    STIFFNESS_N_MM,
    SURFACE_MM,
    ZERO,
    ZERO_N,
    SpringBench,
)
from rig.config.wiring import Limits, Wiring


def gains() -> tuple[GainRow, ...]:
    return tuple(
        GainRow(
            force_N=force, depth_mm=force / STIFFNESS_N_MM, tangent_N_mm=STIFFNESS_N_MM,
            damping_N_s_mm=0.0015 * STIFFNESS_N_MM,
        )
        for force in (0.0, 9.0)
    )  # fmt: skip


def track(*points: tuple[float, float]) -> TrackForce:
    times_s, forces_N = zip(*points, strict=True)
    return TrackForce(times_s=times_s, forces_N=forces_N, gains=gains(), crossover_rad_s=30.0)


def test_a_trial_zeroes_finds_the_surface_presses_to_depth_and_leaves() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, Hold(duration_s=0.1), LEAVE)
    assert bench.ended == [("complete", None)]
    assert bench.state.zero_N == pytest.approx(ZERO_N)
    assert bench.state.surface_mm == pytest.approx(SURFACE_MM, abs=0.1)
    assert bench.state.peak_force_N == pytest.approx(5.0, abs=0.15)
    assert bench.position_mm == pytest.approx(bench.state.surface_mm - 5.0)
    order = list(dict.fromkeys(bench.modes))
    assert order == [Mode.FREE, Mode.APPROACH, Mode.COMPRESS, Mode.RETRACT, Mode.IDLE]


def test_the_force_limit_of_the_protocol_ends_the_compression_but_not_the_trial() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, Compress(depth_mm=5.0, speed_mm_s=20.0, force_limit_N=2.0), LEAVE)
    assert bench.ended == [("force limit", None)]
    assert bench.state.peak_force_N == pytest.approx(2.0, abs=0.1)
    assert bench.machine.mode is Mode.IDLE


def test_force_tracking_reaches_its_reference_without_leaving_contact() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, track((0.0, 0.05), (0.3, 3.0), (2.0, 3.0)), LEAVE)
    contact = [force for force, mode in zip(bench.forces_N, bench.modes, strict=True) if mode is Mode.CONTACT]
    assert bench.ended == [("complete", None)]
    assert contact[-1] == pytest.approx(3.0, abs=0.01)
    assert max(contact) < 3.2


def test_a_limb_that_goes_away_is_followed_slowly_not_chased() -> None:
    bench = SpringBench()
    reach = track((0.0, 0.05), (0.3, 3.0), (20.0, 3.0))
    bench.run(ZERO, APPROACH, reach, until=lambda: bench.state.force_N > 2.9)
    while bench.state.force_N > 0.01:
        bench.stiffness_N_mm *= 0.95
        bench.run_cycle()
    before_mm = bench.position_mm
    for _ in range(100):
        bench.run_cycle()
    assert 0.0 < bench.position_mm - before_mm <= 0.1 * reach.search_speed_mm_s + 1e-9
    assert bench.machine.latched is None


def test_while_the_force_is_late_the_tip_stands_still() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, track((0.0, 0.05), (3.0, 3.0)), until=lambda: bench.state.force_N > 1.0)
    bench.state.force_late, before_mm = True, bench.position_mm
    for _ in range(20):
        bench.run_cycle()
    assert bench.position_mm == pytest.approx(before_mm, abs=0.01)
    bench.state.force_late = False
    bench.run()
    assert bench.ended == [("complete", None)]


def test_a_guide_that_rubs_is_no_contact_and_the_surface_is_found_below_it() -> None:
    bench = SpringBench(friction_N=0.3)
    bench.run(ZERO, APPROACH)
    assert bench.ended == [("complete", None)]
    assert bench.state.surface_mm == pytest.approx(SURFACE_MM, abs=0.1)


def test_tissue_met_in_the_first_half_millimetre_is_found_within_half_a_newton() -> None:
    bench = SpringBench(position_mm=SURFACE_MM - 0.1, stiffness_N_mm=3.0)
    bench.run(ZERO, APPROACH)
    assert bench.state.peak_force_N < 0.5 + APPROACH.contact_force_N + 0.1


def test_a_sensor_too_slow_to_see_the_run_in_leaves_the_threshold_as_it_was_asked_for() -> None:
    state, run = SpringBench().state, APPROACH.begin()
    for place_mm, waits_for_N in ((10.0, 0.55), (10.2, 0.55), (10.8, 0.05)):
        state.position_mm, state.force_samples = place_mm, state.force_samples + 1
        assert not run.advance(state, 0.0)
        assert run.threshold_N(state) == pytest.approx(waits_for_N)


@pytest.mark.parametrize(
    ("noise_N", "waits_for_N"), [(0.0, 0.05), (0.005, 0.05), (0.02, 0.2), (0.05, 0.5), (0.2, 1.0), (0.5, 2.0)]
)
def test_contact_is_detected_at_ten_times_the_noise_but_no_more_than_noise_asks_for(
    noise_N: float, waits_for_N: float
) -> None:
    """What is pressed to tell the surface is 1 N at most; four times the noise is what noise alone does not reach."""
    state, run = SpringBench().state, APPROACH.begin()
    for place_mm in (10.0, 10.3, 10.8):
        state.position_mm, state.force_samples, state.force_N = place_mm, state.force_samples + 1, 0.0
        run.advance(state, 0.0)
    state.noise_N = noise_N
    assert run.threshold_N(state) == pytest.approx(waits_for_N)


def test_no_contact_within_the_search_retracts_and_says_so() -> None:
    bench = SpringBench(stiffness_N_mm=0.0)
    bench.run(ZERO, Approach(speed_mm_s=20.0, contact_force_N=0.05, search_to_mm=30.0))
    outcome, cause = bench.ended[0]
    assert outcome == "protocol"
    assert cause is not None and "no contact down to 30 mm" in cause.text
    assert bench.machine.mode is Mode.SAFE
    assert bench.position_mm == pytest.approx(20.0, abs=0.5)


def test_a_zero_far_from_the_first_one_is_refused() -> None:
    bench = SpringBench()
    bench.run(ZERO)
    bench.position_mm = SURFACE_MM + 2.0
    bench.sense()
    bench.run(ZERO)
    assert "since the first zero" in bench.machine.latched.text if bench.machine.latched else False


def test_limits_that_contradict_each_other_are_refused_with_both_numbers() -> None:
    with pytest.raises(ValueError, match="position_min_mm 10 is not below position_max_mm 5"):
        Limits(position_min_mm=10.0, position_max_mm=5.0)
    with pytest.raises(ValueError, match="retract_speed_mm_s 80 is above speed_mm_s 60"):
        Limits(retract_speed_mm_s=80.0)


def test_dither_starts_and_ends_where_it_began() -> None:
    bench = SpringBench()
    wobble = Dither(amplitude_mm=0.5, frequency_Hz=5.0, duration_s=0.5)
    bench.run(ZERO, APPROACH, PRESS, wobble, until=lambda: bench.machine.step_index == 3)
    centre_mm = bench.position_mm
    positions = []
    while bench.machine.busy:
        bench.run_cycle()
        positions.append(bench.position_mm)
    assert positions[-1] == pytest.approx(centre_mm, abs=1e-6)
    assert max(positions) - centre_mm == pytest.approx(0.5, abs=0.01)
    assert not math.isnan(bench.state.surface_mm)


def test_a_program_may_start_a_count_beyond_the_end_of_the_workspace() -> None:
    bench = SpringBench(position_mm=-0.0005)
    bench.run(ZERO, MoveTo(position_mm=5.0, speed_mm_s=20.0))
    assert bench.ended == [("complete", None)]


def test_a_step_that_leads_out_of_the_workspace_is_stopped_before_the_drive_is_asked() -> None:
    bench = SpringBench(wiring=Wiring(limits=Limits(position_max_mm=22.0)))
    bench.run(ZERO, APPROACH, PRESS)
    assert bench.ended[0][0] == "workspace"
    assert bench.machine.mode is Mode.SAFE


@pytest.mark.parametrize(("every", "noise_N"), [(1, 0.005), (10, 0.05), (10, 0.2)])
def test_a_slow_and_noisy_sensor_finds_the_surface_and_not_its_own_noise(every: int, noise_N: float) -> None:
    bench = SpringBench(position_mm=5.0, every=every, noise_N=noise_N)
    bench.run(Zero(duration_s=1.0), APPROACH, LEAVE)
    assert bench.ended == [("complete", None)]
    assert bench.state.surface_mm == pytest.approx(SURFACE_MM, abs=0.01 + noise_N)


def test_at_rest_no_peak_is_noted_and_on_the_way_it_is() -> None:
    bench = SpringBench()
    bench.state.force_N = 5.0
    bench.machine.update(bench.inputs)
    assert bench.state.peak_force_N == 0.0
    bench.machine.start(Program(name="test", steps=(ZERO,)))
    bench.state.force_N = 4.0
    bench.machine.update(bench.inputs)
    assert bench.state.peak_force_N == 4.0


@pytest.mark.parametrize(("position_mm", "retreats"), [(5.2, False), (5.6, True)])
def test_in_the_last_half_millimetre_of_the_way_a_limb_that_pushes_can_be_given_no_more(
    position_mm: float, retreats: bool
) -> None:
    bench = SpringBench(wiring=Wiring(limits=Limits(position_min_mm=5.0)), position_mm=position_mm)
    bench.machine.hold(Incident(Action.SOFT, "operator_stop", "stopped"))
    bench.machine.update(bench.inputs)
    bench.state.load = bench.state.load._replace(force_N=200.0, predicted_N=200.0)
    assert (bench.machine.update(bench.inputs) is not None) is retreats


@pytest.mark.parametrize(("wanted_mm", "told_mm"), [(math.nan, 15.0), (99.0, 40.0), (-99.0, 5.0)])
def test_a_step_that_leads_out_ends_at_the_end_of_the_way_and_one_to_no_place_where_the_axis_is(
    wanted_mm: float, told_mm: float
) -> None:
    class Leads(Hold):
        def advance(self, state: LoopState, elapsed_s: float) -> bool:
            state.setpoint = Setpoint(wanted_mm, 0.0)
            return False

    bench = SpringBench(wiring=Wiring(limits=Limits(position_min_mm=5.0, position_max_mm=40.0)))
    bench.machine.start(Program(name="test", steps=(Hold(duration_s=1.0),)))
    bench.machine._run = Leads(duration_s=1.0)
    bench.run_cycle()
    assert bench.state.setpoint == Setpoint(told_mm, 0.0)
    assert bench.machine.latched and bench.machine.latched.code == "workspace"
