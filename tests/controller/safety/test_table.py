"""The safety table: what stops motion, how, and the sentence it gives."""

import math

import pytest

from controller.devices.health import StreamHealth
from controller.loop.modes import Mode
from controller.loop.steps import Hold, MoveTo
from controller.safety.table import TABLE, Action
from mock_devices.testing.spring_bench import APPROACH, PRESS, SURFACE_MM, ZERO, ZERO_N, SpringBench
from rig.config.wiring import Wiring
from tests.controller.devices.test_health import Reports


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
        ({"late_ms": 500.0}, "loop_overrun"),
        ({"recorder_fill": 0.9}, "recorder_stalled"),
        ({"recorder_silent_s": 10.0}, "recorder_stalled"),
        ({"stop_silent_s": 1.5}, "stop_lost"),
        ({"input_lost": "input pedal is lost: gone"}, "input_lost"),
        ({"supervisor_lost": True}, "supervisor_lost"),
        ({"operator_silent_s": 4.0}, "operator_silent"),
        ({"requests": frozenset({"unattended"})}, "operator_silent"),
    ],
)
def test_each_soft_cause_retracts_from_contact_and_latches(change: dict[str, object], code: str) -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, Hold(duration_s=9.0), until=lambda: bench.state.force_N > 4.0)
    for name, value in change.items():
        setattr(bench.inputs, name, value)
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
    bench.run(ZERO, APPROACH, PRESS, until=lambda: bench.state.force_N > 2.0)
    before_mm = bench.position_mm
    for name, value in change.items():
        setattr(bench.inputs, name, value)
    incident = bench.run_cycle()
    assert incident and (incident.code, incident.action) == (code, Action.IMMEDIATE)
    assert bench.machine.mode is Mode.SAFE
    for _ in range(100):
        bench.run_cycle()
    assert bench.position_mm == before_mm


def test_a_limb_that_moved_against_the_robot_retracts() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, Hold(duration_s=9.0), until=lambda: bench.state.force_N > 4.0)
    bench.state.patient_mm = 10.4
    bench.run(until=lambda: bench.machine.mode is Mode.SAFE)
    assert bench.ended[0][0] == "patient_moved"
    assert bench.machine.latched and "10.4 mm against the robot (limit 10 mm)" in bench.machine.latched.text


def test_an_axis_faster_than_its_limit_is_stopped_at_once() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, until=lambda: bench.state.force_N > 2.0)
    bench.state.velocity_mm_s = -80.0
    incident = bench.run_cycle()
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
    bench.run(ZERO, APPROACH, PRESS, until=lambda: bench.state.force_N > 2.0)
    bench.inputs.force_age_ms = 4.1
    incident = bench.run_cycle()
    assert incident and incident.code == "force_lost"
    assert "4 ms old (limit 4 ms)" in incident.text


def test_a_converter_that_repeats_itself_for_more_than_two_periods_is_frozen() -> None:
    health = StreamHealth(1_000_000, 4_000_000, 2)
    frozen = []
    for number, value in enumerate([1.0, 1.0, 1.0, 1.1, 1.1, 1.1, 1.1]):
        health.update(number * 1_000_000, True, value)
        frozen.append(health.frozen)
    assert frozen == [False] * 6 + [True]


def test_an_axis_that_names_one_place_while_its_set_point_goes_on_stands() -> None:
    axis = Reports()
    gone_mm = [axis.update(7.0, 7.0 + 0.1 * cycle) for cycle in range(12)]
    assert gone_mm == pytest.approx([0.0] * 10 + [1.0, 1.1])
    assert axis.update(7.0005, 8.2) == 0.0, "it moves again"


def test_what_an_axis_named_before_a_program_is_not_held_against_it() -> None:
    axis = Reports()
    for _ in range(1000):
        axis.update(7.0, 9.0)
    axis.standstill.begin()
    assert [axis.update(7.0, 7.0) for _ in range(20)] == [0.0] * 20


def test_a_frozen_axis_is_stopped_at_once() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, until=lambda: bench.state.force_N > 2.0)
    bench.state.standstill_mm = 0.31
    incident = bench.run_cycle()
    assert incident and (incident.code, incident.action) == ("axis_frozen", Action.IMMEDIATE)
    assert "set-point went 0.31 mm further (limit 0.3 mm)" in incident.text


def test_the_force_limit_counts_from_the_first_zero_so_a_wrong_tare_hides_nothing() -> None:
    bench = SpringBench()
    bench.run(ZERO)
    bench.state.zero_N = ZERO_N + 50.0
    bench.run(MoveTo(position_mm=35.0, speed_mm_s=20.0))
    assert bench.ended[-1][0] == "force_limit"
    assert "pain threshold, 10 N" in (bench.machine.latched.text if bench.machine.latched else "")
    assert max(force for force in bench.forces_N if not math.isnan(force)) + 50.0 < 10.5


def test_an_immediate_cause_during_a_retraction_still_stops_at_once() -> None:
    bench = SpringBench()
    bench.run(ZERO, APPROACH, PRESS, until=lambda: bench.state.force_N > 4.0)
    bench.inputs.requests = frozenset({"stop"})
    bench.run_cycle()
    bench.inputs.drive_fault = "2310 overcurrent"
    bench.run_cycle()
    assert bench.modes[-2:] == [Mode.RETRACT, Mode.SAFE]
    assert bench.machine.latched and bench.machine.latched.code == "drive_fault"


def test_safe_is_left_only_by_acknowledging() -> None:
    bench = SpringBench()
    bench.inputs.requests = frozenset({"estop"})
    bench.run_cycle()
    assert bench.machine.mode is Mode.SAFE
    bench.machine.acknowledge()
    assert (bench.machine.mode, bench.machine.latched) == (Mode.IDLE, None)
    bench.run(ZERO)
    assert bench.ended[-1] == ("complete", None)


def test_the_table_puts_every_immediate_cause_before_every_soft_one() -> None:
    actions = [line.action for line in TABLE]
    assert actions == sorted(actions, reverse=True)


def test_a_code_stands_once_in_the_table_and_fits_into_a_row_of_the_event_stream() -> None:
    assert all(line.evaluate.__name__ == line.code for line in TABLE), "a check has one name"
    codes = [line.code for line in TABLE]
    assert len(set(codes)) == len(codes)
    assert max(map(len, codes)) <= 20


def test_every_check_says_how_late_it_may_be_and_none_is_slower_than_the_operators_lease() -> None:
    assert all(0.0 < line.bound_s <= 3.2 for line in TABLE)


def test_a_table_without_a_check_does_not_stop_for_it() -> None:
    without = tuple(line for line in TABLE if line.code != "overspeed")
    bench = SpringBench(table=without)
    bench.run(ZERO, APPROACH, PRESS, until=lambda: bench.state.force_N > 2.0)
    bench.state.velocity_mm_s = -80.0
    assert bench.run_cycle() is None
