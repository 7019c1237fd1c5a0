"""The state machine of one tick, driven on an injected clock against a spring instead of a bench."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from controller.checks import refuse_beyond_limits
from controller.force_position import GainRow
from controller.gains import pi_gains
from controller.health import Standstill, StreamHealth
from controller.machine import Machine
from controller.modes import Mode
from controller.safety import TABLE, Action, Incident, Watch
from controller.steps import Approach, Compress, Dither, Hold, MoveTo, Program, Retract, Step, TrackForce, Zero
from controller.world import World
from rig.config.wiring import Limits, Subject, Wiring
from rig.errors import UsageError
from tests.controller.test_force_position import DESIGN

SURFACE_MM = 20.0
STIFFNESS_N_MM = 1.0
ZERO_N = 0.8
WIRING = Wiring(subject=Subject(pain_threshold_N=10.0))

ZERO = Zero(duration_s=0.05)
APPROACH = Approach(speed_mm_s=5.0, contact_force_N=0.05, search_to_mm=40.0)
PRESS = Compress(depth_mm=5.0, speed_mm_s=20.0, force_limit_N=9.0)
LEAVE = Retract(clearance_mm=5.0, speed_mm_s=10.0)


@dataclass
class SpringBench:
    """A perfect axis over a linear spring; ``stiffness`` and ``watch`` may be changed while it runs."""

    wiring: Wiring = WIRING
    stiffness_N_mm: float = STIFFNESS_N_MM
    position_mm: float = 15.0
    watch: Watch = field(default_factory=Watch)
    ended: list[tuple[str, Incident | None]] = field(default_factory=list)
    modes: list[Mode] = field(default_factory=list)
    forces_N: list[float] = field(default_factory=list)
    every: int = 1
    noise_N: float = 0.0
    rubbing_N: float = 0.0
    noise: random.Random = field(default_factory=lambda: random.Random(1))
    count: int = -1

    def __post_init__(self) -> None:
        self.world = World(position_mm=self.position_mm)
        self.machine = Machine(self.wiring, self.world, lambda outcome, cause: self.ended.append((outcome, cause)))
        self._sense()

    def _sense(self) -> None:
        force_N = self.stiffness_N_mm * max(0.0, self.position_mm - SURFACE_MM)
        if self.position_mm > self.world.position_mm:
            force_N += self.rubbing_N
        self.world.position_mm = self.position_mm
        self.count += 1
        if self.count % self.every == 0:
            self.world.force_samples += 1
            self.world.raw_N = force_N + ZERO_N + self.noise.gauss(0.0, self.noise_N)
        self.world.force_N = self.world.raw_N - self.world.zero_N

    def tick(self) -> Incident | None:
        self._sense()
        incident = self.machine.update(self.watch)
        self.watch.requests = frozenset()
        if not (incident and incident.action is Action.IMMEDIATE) and self.machine.mode is not Mode.SAFE:
            self.position_mm = self.world.setpoint.position_mm
        self.world.now_ns += 1_000_000
        self.modes.append(self.machine.mode)
        self.forces_N.append(self.world.force_N)
        return incident

    def run(self, *steps: Step, until: Callable[[], bool] | None = None, ticks: int = 30_000) -> None:
        if steps:
            self.machine.start(Program(name="test", steps=steps))
        for _ in range(ticks):
            self.tick()
            if until() if until else not self.machine.busy:
                return
        raise AssertionError(f"still {self.machine.mode.name} after {ticks} ticks")


def gains() -> tuple[GainRow, ...]:
    proportional, integral = pi_gains(STIFFNESS_N_MM, 0.0, DESIGN)
    return tuple(
        GainRow(
            force_N=force,
            depth_mm=force / STIFFNESS_N_MM,
            tangent_N_mm=STIFFNESS_N_MM,
            proportional_mm_N=proportional,
            integral_mm_N_s=integral,
        )
        for force in (0.0, 9.0)
    )


def track(*points: tuple[float, float]) -> TrackForce:
    return TrackForce(times_s=tuple(t for t, _ in points), forces_N=tuple(f for _, f in points), gains=gains())


def test_a_trial_zeroes_finds_the_surface_presses_to_depth_and_leaves() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, Hold(duration_s=0.1), LEAVE)
    assert bench.ended == [("complete", None)]
    assert bench.world.zero_N == pytest.approx(ZERO_N)
    assert bench.world.surface_mm == pytest.approx(SURFACE_MM, abs=0.1)
    assert bench.world.peak_force_N == pytest.approx(5.0, abs=0.15)
    assert bench.position_mm == pytest.approx(bench.world.surface_mm - 5.0)
    order = list(dict.fromkeys(bench.modes))
    assert order == [Mode.FREE, Mode.APPROACH, Mode.COMPRESS, Mode.RETRACT, Mode.IDLE]


def test_the_force_limit_of_the_protocol_ends_the_compression_but_not_the_trial() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, Compress(depth_mm=5.0, speed_mm_s=20.0, force_limit_N=2.0), LEAVE)
    assert bench.ended == [("force limit", None)]
    assert bench.world.peak_force_N == pytest.approx(2.0, abs=0.1)
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
    bench.run(ZERO, APPROACH, reach, until=lambda: bench.world.force_N > 2.9)
    bench.stiffness_N_mm = 0.0
    before_mm = bench.position_mm
    for _ in range(100):
        bench.tick()
    assert 0.0 < bench.position_mm - before_mm <= 0.1 * reach.search_speed_mm_s + 1e-9


def test_while_the_force_is_late_the_tip_stands_still() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, track((0.0, 0.05), (3.0, 3.0)), until=lambda: bench.world.force_N > 1.0)
    bench.world.force_late, before_mm = True, bench.position_mm
    for _ in range(20):
        bench.tick()
    assert bench.position_mm == pytest.approx(before_mm, abs=0.01)
    bench.world.force_late = False
    bench.run()
    assert bench.ended == [("complete", None)]


def test_a_guide_that_rubs_is_no_contact_and_the_surface_is_found_below_it() -> None:
    bench = SpringBench(rubbing_N=0.3)
    bench.run(ZERO, APPROACH)
    assert bench.ended == [("complete", None)]
    assert bench.world.surface_mm == pytest.approx(SURFACE_MM, abs=0.1)


def test_tissue_met_in_the_first_half_millimetre_is_found_within_half_a_newton() -> None:
    bench = SpringBench(position_mm=SURFACE_MM - 0.1, stiffness_N_mm=3.0)
    bench.run(ZERO, APPROACH)
    assert bench.world.peak_force_N < 0.5 + APPROACH.contact_force_N + 0.1


def test_a_sensor_too_slow_to_see_the_run_in_leaves_the_threshold_as_it_was_asked_for() -> None:
    world, run = SpringBench().world, APPROACH.begin()
    for place_mm, waits_for_N in ((10.0, 0.55), (10.2, 0.55), (10.8, 0.05)):
        world.position_mm, world.force_samples = place_mm, world.force_samples + 1
        assert not run.advance(world, 0.0)
        assert run.threshold_N(world) == pytest.approx(waits_for_N)


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
    bench._sense()
    bench.run(ZERO)
    assert "since the first zero" in bench.machine.latched.text if bench.machine.latched else False


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"requests": frozenset({"stop"})}, "operator_stop"),
        ({"requests": frozenset({"pain"})}, "pain_stop"),
        ({"force_lost": "cable"}, "force_lost"),
        ({"force_age_ms": 100.0}, "force_lost"),
        ({"force_valid": False}, "force_invalid"),
        ({"force_frozen": True}, "force_invalid"),
        ({"marker_lost": "cable"}, "tracker_lost"),
        ({"marker_age_ms": 1000.0}, "tracker_lost"),
        ({"limb_age_ms": 1000.0}, "tracker_lost"),
        ({"wake_latency_ms": 500.0}, "loop_overrun"),
        ({"recorder_fill": 0.9}, "recorder_stalled"),
        ({"recorder_silent_s": 10.0}, "recorder_stalled"),
        ({"supervisor_lost": True}, "supervisor_lost"),
        ({"operator_silent_s": 4.0}, "operator_silent"),
        ({"requests": frozenset({"unattended"})}, "operator_silent"),
    ],
)
def test_each_soft_cause_retracts_from_contact_and_latches(change: dict[str, object], code: str) -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, Hold(duration_s=9.0), until=lambda: bench.world.force_N > 4.0)
    for name, value in change.items():
        setattr(bench.watch, name, value)
    bench.run(until=lambda: bench.machine.mode is Mode.SAFE)
    assert bench.ended[0][0] == code
    assert bench.machine.latched and bench.machine.latched.action is Action.SOFT
    assert bench.position_mm <= SURFACE_MM - 9.0


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"requests": frozenset({"estop"})}, "emergency_stop"),
        ({"drive_fault": "8611 following error"}, "drive_fault"),
        ({"axis_lost": "cable"}, "axis_lost"),
        ({"axis_age_ms": 100.0}, "axis_lost"),
    ],
)
def test_each_immediate_cause_stops_where_it_is_and_latches(change: dict[str, object], code: str) -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, until=lambda: bench.world.force_N > 2.0)
    before_mm = bench.position_mm
    for name, value in change.items():
        setattr(bench.watch, name, value)
    incident = bench.tick()
    assert incident and (incident.code, incident.action) == (code, Action.IMMEDIATE)
    assert bench.machine.mode is Mode.SAFE
    for _ in range(100):
        bench.tick()
    assert bench.position_mm == before_mm


def test_a_limb_that_moved_against_the_robot_retracts() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, Hold(duration_s=9.0), until=lambda: bench.world.force_N > 4.0)
    bench.world.patient_mm = 10.4
    bench.run(until=lambda: bench.machine.mode is Mode.SAFE)
    assert bench.ended[0][0] == "patient_moved"
    assert bench.machine.latched and "10.4 mm against the robot (limit 10 mm)" in bench.machine.latched.text


def test_an_axis_faster_than_its_limit_is_stopped_at_once() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, until=lambda: bench.world.force_N > 2.0)
    bench.world.velocity_mm_s = -80.0
    incident = bench.tick()
    assert incident and (incident.code, incident.action) == ("overspeed", Action.IMMEDIATE)
    assert "80 mm/s (limit 72 mm/s)" in incident.text


@pytest.mark.parametrize(
    ("force", "missed", "limit_ms"),
    [({}, 2, 4.0), ({}, 0, 50.0), ({"rate_Hz": 500}, 2, 8.0), ({"product": "robotiq-ft300"}, 2, 40.0)],
)
def test_force_counts_as_lost_after_missed_periods_of_the_rate_the_sensor_really_has(
    force: dict[str, object], missed: int, limit_ms: float
) -> None:
    wiring = Wiring.model_validate({"force": force, "loop": {"missed_periods": missed}})
    assert wiring.stale_force_ms == limit_ms


def test_a_force_sample_older_than_two_missed_periods_retracts() -> None:
    two = Wiring()
    bench = SpringBench(wiring=two)
    bench.run(ZERO, APPROACH, PRESS, until=lambda: bench.world.force_N > 2.0)
    bench.watch.force_age_ms = 4.1
    incident = bench.tick()
    assert incident and incident.code == "force_lost"
    assert "4 ms old (limit 4 ms)" in incident.text


def test_a_converter_that_repeats_itself_for_more_than_two_periods_is_frozen() -> None:
    health = StreamHealth(1_000_000, 4_000_000, 2)
    frozen = []
    for number, value in enumerate([1.0, 1.0, 1.0, 1.1, 1.1, 1.1, 1.1]):
        health.update(number * 1_000_000, number * 1_000_000, True, value)
        frozen.append(health.frozen)
    assert frozen == [False] * 6 + [True]


def test_an_axis_that_names_one_place_while_its_set_point_goes_on_stands() -> None:
    standstill = Standstill()
    gone_mm = [standstill.update(7.0, 7.0 + 0.1 * tick) for tick in range(12)]
    assert gone_mm == pytest.approx([0.0] * 10 + [1.0, 1.1])
    assert standstill.update(7.0005, 8.2) == 0.0, "it moves again"


def test_what_an_axis_named_before_a_program_is_not_held_against_it() -> None:
    standstill = Standstill()
    for _ in range(1000):
        standstill.update(7.0, 9.0)
    standstill.begin()
    assert [standstill.update(7.0, 7.0) for _ in range(20)] == [0.0] * 20


def test_a_frozen_axis_is_stopped_at_once() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, until=lambda: bench.world.force_N > 2.0)
    bench.world.standstill_mm = 0.31
    incident = bench.tick()
    assert incident and (incident.code, incident.action) == ("axis_frozen", Action.IMMEDIATE)
    assert "set-point went 0.31 mm further (limit 0.3 mm)" in incident.text


def test_the_force_limit_counts_from_the_first_zero_so_a_wrong_tare_hides_nothing() -> None:
    bench = SpringBench()
    bench.run(ZERO)
    bench.world.zero_N = ZERO_N + 50.0
    bench.run(MoveTo(position_mm=35.0, speed_mm_s=20.0))
    assert bench.ended[-1][0] == "force_limit"
    assert "pain threshold, 10 N" in (bench.machine.latched.text if bench.machine.latched else "")
    assert max(force for force in bench.forces_N if not math.isnan(force)) + 50.0 < 10.5


def test_an_immediate_cause_during_a_retraction_still_stops_at_once() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, until=lambda: bench.world.force_N > 4.0)
    bench.watch.requests = frozenset({"stop"})
    bench.tick()
    bench.watch.drive_fault = "2310 overcurrent"
    bench.tick()
    assert bench.modes[-2:] == [Mode.RETRACT, Mode.SAFE]
    assert bench.machine.latched and bench.machine.latched.code == "drive_fault"


def test_safe_is_left_only_by_acknowledging() -> None:
    bench = SpringBench()
    bench.watch.requests = frozenset({"estop"})
    bench.tick()
    assert bench.machine.mode is Mode.SAFE
    bench.machine.acknowledge()
    assert (bench.machine.mode, bench.machine.latched) == (Mode.IDLE, None)
    bench.run(ZERO)
    assert bench.ended[-1] == ("complete", None)


def test_the_table_puts_every_immediate_cause_before_every_soft_one() -> None:
    actions = [action for _, action, _ in TABLE]
    assert actions == sorted(actions, reverse=True)


@pytest.mark.parametrize(
    ("steps", "reason"),
    [
        ((ZERO, APPROACH, Compress(depth_mm=16.0, speed_mm_s=5.0, force_limit_N=5.0)), "depth 16 mm is above"),
        ((ZERO, APPROACH, Compress(depth_mm=5.0, speed_mm_s=99.0, force_limit_N=5.0)), "speed 99 mm/s is above"),
        ((ZERO, APPROACH, Compress(depth_mm=5.0, speed_mm_s=5.0, force_limit_N=12.0)), "force_limit_N 12 N is above"),
        ((ZERO, APPROACH, track((0.0, 0.0), (1.0, 9.5))), "the largest force of the model, 9 N"),
        ((ZERO, APPROACH, track((1.0, 1.0), (0.0, 1.0))), "times go backwards"),
        ((ZERO, MoveTo(position_mm=70.0, speed_mm_s=5.0)), "position 70 mm is outside 0 to 60 mm"),
        ((ZERO, Retract(clearance_mm=1.0, speed_mm_s=30.0)), "retract speed 30 mm/s is above"),
        ((ZERO, APPROACH, Dither(amplitude_mm=1.0, frequency_Hz=20.0, duration_s=1.0)), "speed of the dither"),
        ((APPROACH, PRESS), "the first step must be a zero"),
        ((ZERO, PRESS), "no approach comes before it"),
    ],
)
def test_a_program_beyond_the_limits_is_refused_with_the_number_and_its_bound(
    steps: tuple[Step, ...], reason: str
) -> None:
    with pytest.raises(UsageError, match=reason.replace("(", r"\(")):
        refuse_beyond_limits(Program(name="test", steps=steps), WIRING)


def test_a_program_within_the_limits_is_accepted() -> None:
    refuse_beyond_limits(Program(name="test", steps=(ZERO, APPROACH, PRESS, LEAVE)), WIRING)


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
        bench.tick()
        positions.append(bench.position_mm)
    assert positions[-1] == pytest.approx(centre_mm, abs=1e-6)
    assert max(positions) - centre_mm == pytest.approx(0.5, abs=0.01)
    assert not math.isnan(bench.world.surface_mm)


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
    assert SURFACE_MM < bench.world.surface_mm < SURFACE_MM + 4.5 * noise_N + 0.3
