"""What the loop says: a row each cycle, rows of every sample, events, status, outcomes; and what it tells the drive."""

import math
from itertools import pairwise
from typing import Any

import pytest

from controller.loop.bench_loop import LATE_PERIODS, STATUS_EVERY_S, TEXT_BYTES
from controller.loop.executive import Cycle
from controller.loop.messages import Stopped
from controller.loop.modes import Mode
from controller.loop.steps import Hold, MoveTo, Retract
from controller.safety.table import Action
from rig.channels import LoopSample
from rig.errors import DeviceError
from tests.controller.fake_bench import APPROACH, HOLD, ZERO, FakeBench, pressing, wired
from tests.controller.fake_devices import ARM, DIRECTION, SURFACE_MM, TIP, ZERO_N

MS = 1_000_000
ALL_WELL = 0b111_111_111


def test_every_cycle_has_one_row_with_what_it_saw_and_decided() -> None:
    bench = pressing()
    bench.wait(0.02)
    bench.cycle(late_ns=3_400_000)
    bench.cycle(late_ns=20_000)
    rows = bench.ring.loop[-3:]
    assert [row.seq for row in bench.ring.loop] == list(range(rows[-1].seq - 21, rows[-1].seq + 1))
    assert [row.cycle for row in rows] == [bench.cycle_number - 6, bench.cycle_number - 5, bench.cycle_number - 1]
    assert [row.missed for row in rows] == [0, 0, 3]
    assert [row.wake_latency_ns for row in rows] == [0, 3_400_000, 20_000]
    state, last = bench.loop.state, rows[-1]
    assert math.isnan(last.reference_N) and math.isnan(last.tangent_N_mm)
    assert last.force_N == pytest.approx(bench.force.true_N, abs=0.01)
    assert last.position_mm == pytest.approx(bench.axis.position_mm, abs=1e-3)
    assert last._replace(reference_N=0.0, tangent_N_mm=0.0) == LoopSample(
        seq=last.seq, capture_ns=last.scheduled_ns + 20_000, arrival_ns=last.scheduled_ns + 20_000,
        cycle=bench.cycle_number - 1, missed=3, scheduled_ns=bench.start_ns + (bench.cycle_number - 1) * MS,
        wake_latency_ns=20_000, execution_ns=0,
        force_age_ns=last.capture_ns - bench.force.samples[-1].capture_ns,
        axis_age_ns=last.capture_ns - bench.ring.axis[-1].capture_ns,
        marker_age_ns=last.capture_ns - bench.tracker.samples[-1].capture_ns,
        health=ALL_WELL, mode=int(Mode.COMPRESS), step=3, force_N=state.force_N, reference_N=0.0,
        position_mm=bench.ring.axis[-1].position_mm, command_mm=state.setpoint.position_mm, surface_mm=state.surface_mm,
        depth_mm=last.position_mm - state.surface_mm, tangent_N_mm=0.0,
    )  # fmt: skip


def test_the_execution_time_in_a_row_is_from_waking_to_the_row() -> None:
    bench = FakeBench()
    poll = bench.force.poll

    def slow(now_ns: int) -> Any:
        bench.clock.now_ns += 123_000
        return poll(now_ns)

    bench.force.poll = slow  # type: ignore[method-assign]
    bench.cycle()
    assert bench.ring.loop[-1].execution_ns == 123_000
    assert bench.axis.commands[-1][0] == bench.ring.loop[-1].capture_ns + 123_000, "asked when it is asked"


def test_what_was_prepared_before_a_cycle_was_due_is_of_its_execution_too() -> None:
    bench = FakeBench()
    due_ns = bench.clock.now_ns
    bench.loop.run_cycle(Cycle(bench.cycle_number, due_ns, due_ns, 0, prepared_ns=7_000))
    assert bench.ring.loop[-1].execution_ns == 7_000


@pytest.mark.parametrize("sensor_Hz", [1000.0, 100.0])
def test_every_sample_of_every_device_becomes_a_row_once(sensor_Hz: float) -> None:
    bench = FakeBench(wired(sensor_Hz))
    bench.run(ZERO, APPROACH)
    assert [row[:10] for row in bench.ring.force] == [sample[:10] for sample in bench.force.samples]
    assert [row.seq for row in bench.ring.axis] == list(range(bench.axis.next_seq))
    assert [row.seq for row in bench.ring.marker] == [sample.seq for sample in bench.tracker.samples]
    assert bench.loop.published == {
        "force": bench.force.samples[-1].seq, "axis": bench.axis.next_seq - 1, "tracker": bench.tracker.samples[-1].seq
    }  # fmt: skip


@pytest.mark.parametrize(
    ("role", "values", "lacking"),
    [
        ("force", {"silent": True}, 0b001),
        ("force", {"valid": False}, 0b010),
        ("force", {"period_ns": 2 * MS}, 0b100),
        ("axis", {"silent": True}, 0b001_000),
        ("axis", {"valid": False}, 0b010_000),
        ("tracker", {"silent": True}, 0b001_000_000),
        ("tracker", {"hidden": frozenset({0})}, 0b010_000_000),
        ("tracker", {"hidden": frozenset({1})}, 0),
        ("tracker", {"period_ns": 33_333_333}, 0b100_000_000),
    ],
)
def test_the_nine_bits_of_health_say_which_stream_lacks_what(role: str, values: dict[str, Any], lacking: int) -> None:
    bench = FakeBench()
    bench.wait(0.1)
    assert bench.ring.loop[-1].health == ALL_WELL
    for name, value in values.items():
        setattr(getattr(bench, role), name, value)
    bench.wait(1.0)
    assert bench.ring.loop[-1].health == ALL_WELL - lacking


def test_a_stream_counts_as_alive_as_long_as_its_own_limit_says() -> None:
    bench = FakeBench(wired(loop={"stale_axis_ms": 30.0, "stale_marker_ms": 70.0, "missed_periods": 2}))
    bench.wait(0.5)
    for device in (bench.force, bench.axis, bench.tracker):
        device.silent = True
    bench.wait(0.1)
    alive_ms = dict.fromkeys((0, 3, 6), 0.0)
    ages = {0: "force_age_ns", 3: "axis_age_ns", 6: "marker_age_ns"}
    for row in bench.ring.loop:
        for bit, name in ages.items():
            if row.health >> bit & 1:
                alive_ms[bit] = max(alive_ms[bit], getattr(row, name) * 1e-6)
    # Ages of cycles are whole milliseconds after the last sample, but for the tracker, whose frames fall between.
    assert alive_ms[0] == pytest.approx(3.0, abs=1e-6)
    assert alive_ms[3] == pytest.approx(29.0, abs=1e-6)
    assert 69.0 < alive_ms[6] < 70.0


def test_status_comes_twenty_times_a_second_and_says_what_people_see() -> None:
    bench = pressing()
    bench.wait(1.0)
    statuses, state = bench.link.statuses, bench.loop.state
    assert len(statuses) == 20
    assert bench.link.flushes > 900
    last = statuses[-1]
    row = next(row for row in bench.ring.loop if row.capture_ns == last["time_ns"])
    assert {name: last[name] for name in ("mode", "busy", "step", "health", "missed", "latched", "lost", "ready")} == {
        "mode": "compress", "busy": True, "step": 3, "health": ALL_WELL, "missed": 0, "latched": None, "lost": {},
        "ready": True,
    }  # fmt: skip
    assert last["cycles"] == row.seq + 1
    assert (last["force_N"], last["position_mm"]) == (round(row.force_N, 4), round(row.position_mm, 4))
    assert (last["reference_N"], last["depth_mm"]) == (None, round(row.position_mm - state.surface_mm, 4))
    assert last["rates_Hz"] == {"force": 1000.0, "axis": 1000.0, "marker": 60.0}
    assert {role: (state["state"], state["detail"]) for role, state in last["devices"].items()} == {
        "force": ("ok", ""), "axis": ("ok", ""), "tracker": ("ok", "")
    }  # fmt: skip
    assert set(last) == {
        "time_ns", "mode", "busy", "step", "health", "missed", "cycles", "force_N", "reference_N", "position_mm",
        "depth_mm", "rates_Hz", "lost", "devices", "ready", "latched", "peak_force_N",
    }  # fmt: skip


def test_status_is_every_twentieth_of_a_second_at_any_rate_and_every_cycle_of_a_slow_loop() -> None:
    assert STATUS_EVERY_S == 0.05
    bench = FakeBench(wired(loop={"rate_Hz": 100.0}))
    bench.wait(1.0)
    times = [status["time_ns"] for status in bench.link.statuses[-10:]]
    assert {later - earlier for earlier, later in pairwise(times)} == {50 * MS}


@pytest.mark.parametrize(("role", "name"), [("force", "force"), ("axis", "axis"), ("tracker", "marker")])
def test_status_names_what_is_lost_and_why_and_what_stopped_motion(role: str, name: str) -> None:
    bench = pressing()
    getattr(bench, role).cut = "cable"
    bench.wait(0.06)
    status = bench.link.statuses[-1]
    assert status["lost"] == {name: "cable"}
    latched = bench.loop.machine.latched
    assert latched
    assert status["latched"] == {"code": latched.code, "text": latched.text, "action": latched.action.name}
    assert status["devices"][role]["state"] == "lost"
    assert status["ready"] is False


def test_a_bench_without_position_says_so_with_nothing_and_commands_nothing() -> None:
    bench = FakeBench(settled=0)
    bench.axis.silent = True
    bench.cycles(60)
    assert bench.link.statuses[-1]["position_mm"] is None
    assert bench.axis.commands == []
    assert len(bench.axis.requests) == 60
    bench.axis.silent = False
    bench.cycles(2)
    assert bench.axis.commands[0][1] == pytest.approx(bench.axis.position_mm), "and then where it is"


def test_events_are_numbered_and_cut_to_what_a_row_takes() -> None:
    bench = FakeBench()
    before = len(bench.ring.events)
    bench.loop.event(Action.WARNING, "c" * 30, "ä" * 100, 77)
    bench.loop.event(Action.NOTE, "b", "short", 78)
    first, second = bench.ring.events[before:]
    assert (first.seq, first.level, first.code, first.capture_ns, first.arrival_ns) == (before, 20, "c" * 20, 77, 77)
    assert first.text == "ä" * (TEXT_BYTES // 2) == "ä" * 80
    assert (second.seq, second.level, second.text) == (before + 1, 10, "short")
    bench.loop.event(Action.NOTE, "b", "x" + "ä" * 100, 79)  # the cut falls into a letter of two bytes
    assert bench.ring.events[-1].text == "x" + "ä" * 79


def test_a_program_leaves_its_events_and_its_outcome() -> None:
    bench = FakeBench()
    outcome = bench.run(ZERO, APPROACH, Hold(duration_s=0.01))
    codes = [(event.code, event.level) for event in bench.ring.events if event.code != "device_state"]
    assert codes == [("program_start", 10), ("contact", 10), ("program_end", 10)]
    texts = {event.code: event.text for event in bench.ring.events}
    assert (texts["program_start"], texts["program_end"]) == ("test", "complete")
    assert texts["contact"].startswith(f"surface {outcome['surface_mm']:.3f} mm")
    state = bench.loop.state
    assert outcome == {
        "outcome": "complete", "cause": "", "peak_force_N": state.peak_force_N, "surface_mm": state.surface_mm,
        "zero_N": pytest.approx(ZERO_N, abs=0.001), "touch": outcome["touch"],
        "wire_damage": {"force": 0.0, "axis": 0.0, "tracker": 0.0},
        "carried": {"zero": None, "reference_zero": None, "zero_N": None, "noise_N": 0.0, "noise_N_m": 0.0},
    }  # fmt: skip
    assert outcome["touch"]["surface_mm"] == outcome["surface_mm"]


def test_an_outcome_says_what_its_program_found_left_by_the_one_before() -> None:
    bench = FakeBench()
    before = bench.run(ZERO)
    assert bench.run(Hold(duration_s=0.01))["carried"]["zero_N"] == before["zero_N"]


def test_an_outcome_without_contact_or_zero_says_nothing_of_them() -> None:
    bench = FakeBench()
    outcome = bench.run(Retract(clearance_mm=2.0, speed_mm_s=10.0))
    assert (outcome["outcome"], outcome["surface_mm"], outcome["zero_N"], outcome["touch"]) == (
        "complete", None, None, None,
    )  # fmt: skip


def test_each_surface_found_is_one_note() -> None:
    bench = FakeBench()
    for _ in range(2):
        bench.run(ZERO, APPROACH, Retract(clearance_mm=5.0, speed_mm_s=20.0))
    assert [event.code for event in bench.ring.events].count("contact") == 2


def test_a_stop_is_told_with_code_sentence_and_what_is_done() -> None:
    bench = pressing()
    bench.say("pain")
    bench.cycle()
    (stopped,) = [message for message in bench.link.sent if isinstance(message, Stopped)]
    assert (stopped.code, stopped.action) == ("pain_stop", "SOFT")
    event = next(event for event in bench.ring.events if event.code == "pain_stop")
    assert (event.level, event.text) == (30, stopped.text)
    bench.until(lambda: not bench.loop.machine.busy)
    finished = bench.link.of("finished")[-1]
    assert (finished["outcome"], finished["cause"]) == ("pain_stop", stopped.text)


def test_an_emergency_stop_pulls_the_drive_and_only_a_reset_gives_it_back() -> None:
    bench = pressing()
    bench.say("estop")
    bench.cycles(2)
    commands, requests = len(bench.axis.commands), len(bench.axis.requests)
    assert bench.axis.quick_stops == [bench.ring.loop[-2].capture_ns]
    bench.wait(0.1)
    assert (len(bench.axis.commands), len(bench.axis.requests)) == (commands, requests + 100)
    assert (bench.mode, bench.latched) == (Mode.SAFE, "emergency_stop")
    at_mm = bench.axis.position_mm
    bench.say("reset")
    bench.cycles(50)
    assert (bench.mode, bench.latched) == (Mode.IDLE, "")
    assert [call for call in bench.axis.calls if call in ("reset_fault", "enable")] == ["reset_fault", "enable"]
    assert bench.axis.commands[-1][1] == pytest.approx(at_mm, abs=1e-3)
    assert bench.axis.position_mm == pytest.approx(at_mm, abs=1e-3), "nothing moves by a reset"


def test_a_drive_that_pulled_itself_is_asked_and_not_commanded_until_a_reset() -> None:
    bench = pressing()
    bench.axis.on, bench.axis.fault_text = False, "2310 overcurrent"
    bench.cycles(10)
    assert (len(bench.axis.commands), len(bench.axis.requests)) == (0, 10)
    bench.axis.unclearable = "2310 overcurrent is still there"
    bench.say("reset")
    bench.cycles(2)
    assert "still there" in bench.link.of("answer")[-1]["refused"]
    assert bench.latched == "drive_fault"
    bench.axis.unclearable = ""
    bench.say("reset")
    bench.cycles(5)
    assert bench.latched == ""
    assert bench.axis.commands


def test_after_a_soft_stop_the_drive_keeps_its_torque_and_a_reset_asks_nothing_of_it() -> None:
    bench = pressing()
    bench.say("stop")
    bench.cycles(1)
    bench.until(lambda: bench.mode is Mode.SAFE)
    bench.say("reset")
    bench.cycles(2)
    assert bench.mode is Mode.IDLE
    assert not {"reset_fault", "enable", "quick_stop"} & set(bench.axis.calls)


def test_a_quick_stop_that_fails_leaves_the_axis_lost_with_the_reason() -> None:
    bench = pressing()
    bench.axis.unstoppable = "the bus is off"
    bench.say("estop")
    bench.cycles(3)
    assert bench.loop.inputs.axis_lost == "the bus is off"
    assert bench.latched == "emergency_stop"


def test_an_axis_that_fails_while_it_is_commanded_is_lost_and_asked_nothing_more() -> None:
    bench = pressing()

    def fails(position_mm: float, now_ns: int) -> None:
        raise DeviceError("write failed")

    bench.axis.command = fails  # type: ignore[method-assign]
    bench.cycles(2)
    assert bench.loop.inputs.axis_lost == "write failed"
    assert bench.latched == "axis_lost"
    calls = len(bench.axis.calls)
    bench.cycles(10)
    assert len(bench.axis.calls) == calls
    assert bench.axis.quick_stops == []


@pytest.mark.parametrize("role", ["force", "tracker"])
def test_a_lost_sensor_is_asked_nothing_more(role: str) -> None:
    bench = pressing()
    getattr(bench, role).cut = "cable"
    bench.cycles(2)
    calls = len(getattr(bench, role).calls)
    bench.cycles(10)
    assert len(getattr(bench, role).calls) == calls


def test_force_counts_from_the_zero_of_its_channel_and_compression_is_positive() -> None:
    for words in ({"axis": "fx", "compression": "positive"}, {"axis": "fy", "compression": "negative"}):
        bench = FakeBench(wired(force=words))
        bench.run(ZERO, APPROACH)
        sign = 1.0 if words["compression"] == "positive" else -1.0
        newest = bench.force.samples[-1]
        assert bench.loop.state.raw_N == pytest.approx(sign * getattr(newest, f"{words['axis']}_N"))
        assert bench.loop.state.force_N == pytest.approx(bench.loop.state.raw_N - ZERO_N, abs=0.001)
        assert bench.loop.state.wrench == pytest.approx(newest[4:10])
        assert bench.loop.state.load.force_N == pytest.approx(bench.loop.state.force_N, abs=0.003)


def test_at_rest_a_set_point_behind_is_no_lag() -> None:
    bench = FakeBench()
    bench.axis.reads_mm = 15.0
    bench.wait(0.2)
    assert bench.loop.state.following_mm == 0.0
    assert bench.latched == ""


def test_lag_is_set_point_minus_position_of_the_newest_report() -> None:
    bench = FakeBench()
    bench.begin(ZERO, MoveTo(position_mm=30.0, speed_mm_s=20.0))
    bench.wait(0.6)
    # First-order lag of 4.7 ms at 20 mm/s, and the report is a cycle old while the set-point is of the cycle before.
    assert bench.loop.state.following_mm == pytest.approx(20.0 * 0.0047, abs=0.03)


def test_late_is_more_than_five_periods_of_the_sensor() -> None:
    assert LATE_PERIODS == 5
    slow = pressing(100.0, {"loop": {"missed_periods": 0, "stale_force_ms": 100.0}})
    slow.force.silent = True
    newest_ns, late = slow.force.samples[-1].capture_ns, []
    for _ in range(60):
        slow.cycle()
        if slow.loop.state.force_late:
            late.append((slow.ring.loop[-1].capture_ns - newest_ns) // MS)
    assert late[0] == 51


def test_the_limb_is_followed_in_the_robots_frame_once_the_axis_has_travelled() -> None:
    bench = FakeBench()
    assert math.isnan(bench.loop.state.patient_mm)
    bench.begin(ZERO, MoveTo(position_mm=19.5, speed_mm_s=10.0), HOLD)
    bench.wait(1.5)
    assert bench.loop.state.patient_mm == pytest.approx(0.0, abs=0.3)
    bench.tracker.limb_mm = (0.0, 3.0, 4.0)
    bench.wait(0.3)
    assert bench.loop.state.patient_mm == pytest.approx(5.0, abs=0.3)
    marker = bench.ring.marker[-1]
    assert (marker.tool, marker.x_mm, marker.y_mm, marker.z_mm) == (1, ARM[0], ARM[1] + 3.0, ARM[2] + 4.0)
    tip = bench.ring.marker[-2]
    assert tip.z_mm == pytest.approx(TIP[2] + DIRECTION[2] * bench.axis.position_mm, abs=0.2)


def test_a_new_program_forgets_where_the_limb_was_and_what_stood_still() -> None:
    bench = FakeBench()
    bench.run(ZERO, MoveTo(position_mm=19.5, speed_mm_s=10.0))
    bench.tracker.limb_mm = (0.0, 30.0, 40.0)
    bench.loop.state.standstill_mm = 9.0
    bench.begin(ZERO, MoveTo(position_mm=10.0, speed_mm_s=10.0), HOLD)
    bench.wait(2.0)
    assert bench.latched == ""
    assert bench.loop.state.patient_mm == pytest.approx(0.0, abs=0.3)


def test_what_a_device_said_before_it_was_lost_counts_no_more() -> None:
    bench = pressing()
    for stream, role in (("force", "force"), ("axis", "axis"), ("marker", "tracker")):
        age_ns = bench.loop.health[stream].age_ns(bench.clock.now_ns)
        assert age_ns < 50 * MS
        bench.loop.forget(stream)
        assert bench.loop.health[stream].age_ns(bench.clock.now_ns) > 1 << 61
        assert bench.loop.health[stream].period_ns == getattr(bench, role).period_ns


def test_the_loop_knows_the_number_of_the_last_sample_of_each_device() -> None:
    bench = pressing()
    bench.cycles(200)
    force, axis, marker = (rows[-1].seq for rows in (bench.ring.force, bench.ring.axis, bench.ring.marker))
    assert bench.loop.published == {"force": force, "axis": axis, "tracker": marker}


def test_a_loop_that_is_left_alone_says_so_to_its_checks() -> None:
    bench = FakeBench()
    bench.cycle()
    assert bench.loop.inputs.supervisor_lost is False
    bench.link.lost = True
    bench.cycle()
    assert bench.loop.inputs.supervisor_lost is True


def test_the_loop_leaves_its_devices_closed() -> None:
    bench = FakeBench()
    bench.loop.close()
    assert bench.axis.closed and bench.force.closed and bench.tracker.closed


def test_the_loop_ends_when_told_and_at_rest_and_when_left_alone() -> None:
    bench = pressing()
    bench.say("shutdown")
    bench.cycles(20)
    assert bench.going, "not while the tip is in the tissue"
    bench.say("stop")
    bench.until(lambda: not bench.going)
    assert bench.axis.position_mm < SURFACE_MM - 5.0
    alone = pressing()
    alone.link.lost = True
    alone.until(lambda: not alone.going)
    assert alone.latched == "supervisor_lost"
    assert alone.mode is Mode.SAFE
