"""Devices that are lost and come back, in the whole loop on a clock of its own."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from controller.devices import takeover
from controller.devices.states import DeviceState, DeviceStatus
from controller.loop.modes import Mode
from controller.safety.table import Action, Incident
from tests.controller.fake_bench import APPROACH, HOLD, LEAVE, ZERO, FakeBench, wired
from tests.controller.fake_devices import FakeAxis, FakeForce, FakeTracker


def states(bench: FakeBench) -> dict[str, str]:
    """Role to state, as the newest status says."""
    return {role: device["state"] for role, device in bench.link.statuses[-1]["devices"].items()}


def settled() -> FakeBench:
    """A bench whose devices have all spoken."""
    bench = FakeBench()
    bench.wait(0.2)
    assert states(bench) == {"force": "ok", "axis": "ok", "tracker": "ok"}
    assert bench.link.statuses[-1]["ready"]
    return bench


def refusals(bench: FakeBench) -> list[str]:
    """What the loop would not do."""
    return [answer["refused"] for answer in bench.link.of("answer") if answer["refused"]]


def spare_force(bench: FakeBench) -> FakeForce:
    return FakeForce(bench.clock, bench.force.period_ns, axis=bench.axis, wiring=bench.wiring)


def spare_axis(bench: FakeBench, referenced: bool = True) -> FakeAxis:
    return FakeAxis(bench.clock, bench.period_ns, position_mm=bench.axis.position_mm, on=False, referenced=referenced)


def replaced_axis(bench: FakeBench, spare: FakeAxis) -> None:
    """The spare is where the lost axis was, for the sensors and the clock too."""
    bench.axis.cut, bench.spares["axis"] = "", spare
    bench.axis = bench.force.axis = bench.tracker.axis = spare


@pytest.mark.parametrize("role", ["force", "axis", "tracker"])
def test_a_cut_cable_is_a_loss_that_is_named_and_refuses_a_start_with_the_next_step(role: str) -> None:
    bench = settled()
    getattr(bench, role).cut = "the line is gone"
    bench.wait(0.2)
    assert states(bench)[role] == "lost"
    assert not bench.link.statuses[-1]["ready"]
    bench.begin(ZERO, HOLD)
    bench.cycle()
    text = refusals(bench)[-1]
    assert bench.mode in (Mode.IDLE, Mode.SAFE)
    assert "the line is gone" in text
    assert "check its power and cable" in text or "reset" in text


def test_it_is_idle_only_while_every_device_is_ok() -> None:
    bench = settled()
    assert bench.link.statuses[-1]["mode"] == "idle"
    bench.tracker.cut = "the line is gone"
    bench.wait(0.2)
    assert bench.link.statuses[-1]["mode"] == "not ready: tracker lost"


def test_a_sensor_that_fell_silent_is_lost_and_is_opened_again() -> None:
    bench = settled()
    bench.force.silent = True
    bench.until(lambda: states(bench)["force"] == "lost", within_s=1.2)
    bench.spares["force"] = spare_force(bench)
    bench.until(lambda: states(bench)["force"] == "ok", within_s=5.0)
    assert bench.force.closed
    assert bench.link.statuses[-1]["ready"]


@pytest.mark.parametrize("role", ["force", "tracker"])
def test_the_numbers_of_a_stream_go_on_past_a_reconnection(role: str) -> None:
    bench = settled()
    spare = (
        spare_force(bench) if role == "force" else FakeTracker(bench.clock, bench.tracker.period_ns, axis=bench.axis)
    )
    getattr(bench, role).cut = "the line is gone"
    bench.wait(0.3)
    bench.spares[role] = spare
    bench.until(lambda: bench.link.statuses[-1]["ready"], within_s=5.0)
    bench.wait(0.1)
    rows = bench.ring.force if role == "force" else bench.ring.marker
    assert [row.seq for row in rows] == list(range(len(rows)))
    assert rows[-1].capture_ns > bench.clock.now_ns - 50_000_000


def test_a_lost_device_is_asked_again_less_and_less_often_and_not_before_the_drive_stands() -> None:
    bench = settled()
    bench.tracker.cut = "the line is gone"
    times_s: list[float] = []
    began_s = bench.time_s
    while len(times_s) < 5:
        seen = len(bench.attempts)
        bench.until(lambda seen=seen: len(bench.attempts) > seen)  # type: ignore[misc]
        times_s.append(bench.time_s - began_s)
    waits_s = [after - before for before, after in zip([0.0, *times_s], times_s, strict=False)]
    # 1 s before the first, doubled up to 4 s, each met at the next look 50 ms later at most.
    assert waits_s == pytest.approx([1, 2, 4, 4, 4], abs=0.11)
    assert states(bench)["tracker"] == "reconnecting"


def test_nothing_is_reopened_while_anything_moves() -> None:
    bench = settled()
    bench.press()
    bench.spares["tracker"] = FakeTracker(bench.clock, bench.tracker.period_ns, axis=bench.axis)
    bench.tracker.cut = "the line is gone"
    bench.until(lambda: bench.mode is Mode.RETRACT)
    while bench.mode is Mode.RETRACT:
        assert not bench.attempts
        bench.cycle()
    assert bench.mode is Mode.SAFE
    bench.until(lambda: states(bench)["tracker"] == "ok", within_s=3.0)
    assert bench.latched == "tracker_lost"


def test_another_device_in_the_place_of_the_lost_one_is_a_fault_and_is_not_used() -> None:
    bench = settled()
    stranger = spare_force(bench)
    stranger.serial = "2"
    bench.spares["force"], bench.force.cut = stranger, "the line is gone"
    bench.until(lambda: states(bench)["force"] == "fault", within_s=3.0)
    detail = bench.link.statuses[-1]["devices"]["force"]["detail"]
    assert "another device answers: FakeForce serial 2 instead of FakeForce serial 1" in detail
    assert stranger.closed
    assert not stranger.samples
    bench.spares["force"] = spare_force(bench)
    bench.until(lambda: bench.link.statuses[-1]["ready"], within_s=10.0)


def test_an_axis_that_comes_back_has_no_torque_and_nothing_moves_before_a_reset() -> None:
    bench = settled()
    bench.axis.cut = "the line is gone"
    bench.wait(0.2)
    replaced_axis(bench, spare_axis(bench))
    bench.until(lambda: states(bench)["axis"] == "degraded", within_s=3.0)
    bench.wait(1.0)
    assert bench.mode is Mode.SAFE
    assert not bench.axis.commands
    assert "enable" not in bench.axis.calls
    bench.begin(ZERO, HOLD)
    assert refusals(bench)
    bench.say("reset")
    bench.until(lambda: bench.link.statuses[-1]["ready"], within_s=1.0)
    assert not bench.latched
    rows = bench.ring.axis
    assert [row.seq for row in rows] == list(range(len(rows)))


def test_an_axis_that_restarted_is_in_fault_until_it_is_homed() -> None:
    bench = settled()
    bench.axis.cut = "the line is gone"
    bench.wait(0.2)
    replaced_axis(bench, spare_axis(bench, referenced=False))
    bench.until(lambda: states(bench)["axis"] == "fault", within_s=3.0)
    assert "it has no reference" in bench.link.statuses[-1]["devices"]["axis"]["detail"]
    bench.wait(1.0)
    assert not bench.axis.commands


def test_an_axis_that_counts_otherwise_than_before_is_a_fault_and_is_not_used() -> None:
    bench = settled()
    spare = spare_axis(bench)
    spare.settings = {"increments_per_mm": "2000.0"}
    bench.axis.cut = "the line is gone"
    bench.wait(0.2)
    replaced_axis(bench, spare)
    bench.until(lambda: states(bench)["axis"] == "fault", within_s=3.0)
    detail = bench.link.statuses[-1]["devices"]["axis"]["detail"]
    assert "FakeAxis serial 1 counts 2000.0 increments a mm and counted None: end the bench and start it" in detail
    assert spare.closed
    assert not spare.commands


def test_leaving_the_tissue_takes_the_axis_alone() -> None:
    bench = settled()
    bench.force.cut = "the line is gone"
    bench.wait(0.2)
    if bench.latched:
        bench.say("reset")
        bench.cycle()
    bench.begin(LEAVE)
    bench.wait(0.5)
    assert not any("force" in text for text in refusals(bench))


def test_a_slow_sensor_degrades_and_refuses() -> None:
    bench = settled()
    # Every second sample is missing: 500 Hz where 1000 Hz were asked for.
    bench.force.period_ns *= 2
    bench.until(lambda: states(bench)["force"] == "degraded", within_s=2.0)
    bench.begin(ZERO, APPROACH)
    bench.cycle()
    assert "force is degraded: 500 Hz came instead of 1000 Hz" in refusals(bench)[-1]


def test_each_change_of_state_is_an_event() -> None:
    bench = settled()
    bench.tracker.cut = "the line is gone"
    bench.wait(0.2)
    texts = [event.text for event in bench.ring.events if event.code == "device_state"]
    assert sorted(texts[:3]) == ["axis ok", "force ok", "tracker ok"]
    assert texts[3:] == ["tracker lost: the line is gone"]


def test_a_spare_is_closed_where_the_loop_ends_during_its_start() -> None:
    bench = settled()
    bench.tracker.cut = "the line is gone"
    works: list[Callable[[], None]] = []
    way = bench.loop.connections._ways_back["tracker"]
    way._spawn = works.append
    bench.until(lambda: bool(works), within_s=3.0)
    spare = FakeTracker(bench.clock, bench.tracker.period_ns, axis=bench.axis)
    bench.spares["tracker"] = spare
    bench.loop.close()
    works[0]()
    assert spare.closed


def test_at_the_end_the_devices_that_took_over_are_closed() -> None:
    bench = settled()
    spare = bench.spares["force"] = spare_force(bench)
    bench.force.cut = "the line is gone"
    bench.until(lambda: bench.loop.devices.force is spare, within_s=3.0)
    bench.loop.close()
    assert spare.closed
    assert bench.axis.closed


def test_devices_are_replaced_one_by_one() -> None:
    bench = settled()
    before = bench.loop.devices
    bench.spares["force"], bench.force.cut = spare_force(bench), "the line is gone"
    bench.until(lambda: bench.loop.devices.force is not before.force, within_s=3.0)
    assert bench.loop.devices == replace(before, force=bench.loop.devices.force)


@pytest.mark.parametrize(("missed_periods", "identical"), [(2, 2), (7, 7), (0, 100)])
def test_a_frozen_sensor_is_told_after_as_many_samples_as_may_be_missed(missed_periods: int, identical: int) -> None:
    loop = {"missed_periods": missed_periods} | ({} if missed_periods else {"stale_force_ms": 40.0})
    bench = FakeBench(wired(loop=loop), settled=0)
    assert bench.loop.health["force"].identical_limit == identical


@pytest.mark.parametrize(
    ("state", "level"),
    [(DeviceState.OK, 10), (DeviceState.CONNECTING, 10), (DeviceState.DEGRADED, 20), (DeviceState.LOST, 20),
     (DeviceState.RECONNECTING, 20), (DeviceState.FAULT, 20)],
)  # fmt: skip
def test_a_state_that_needs_somebody_is_a_warning_and_any_other_a_note(state: DeviceState, level: int) -> None:
    bench = FakeBench(settled=0)
    for detail in ("NO POWER: X", ""):
        takeover.record_state_change(bench.loop, "force", DeviceStatus(state, detail, 0))
    told = [(event.code, event.level, event.text) for event in bench.ring.events]
    assert told == [("device_state", level, f"force {state}: NO POWER: X"), ("device_state", level, f"force {state}")]


def test_a_status_shows_state_detail_and_since_when_by_role() -> None:
    assert takeover.as_status([("axis", DeviceStatus(DeviceState.LOST, "cable", 7))]) == {
        "axis": {"state": "lost", "detail": "cable", "since_ns": 7}
    }


def test_without_checks_that_stop_an_axis_that_comes_back_is_held_all_the_same() -> None:
    bench = FakeBench(table=())
    bench.axis.cut = "the line is gone"
    bench.cycles(40)
    spare = spare_axis(bench)
    replaced_axis(bench, spare)
    bench.until(lambda: bench.loop.devices.axis is spare, within_s=3.0)
    text = "the axis was lost and is back, without torque"
    assert bench.loop.machine.latched == Incident(Action.IMMEDIATE, "axis_returned", text)
    assert bench.mode is Mode.SAFE


def test_a_sensor_that_comes_back_is_heard_anew_and_holds_nothing() -> None:
    bench = FakeBench(table=())
    bench.force.cut = "the line is gone"
    bench.cycles(40)
    spare = spare_force(bench)
    spare.period_ns = 2_000_000
    bench.spares["force"] = spare
    bench.until(lambda: bench.loop.devices.force is spare, within_s=3.0)
    assert bench.loop.health["force"].period_ns == 2_000_000
    assert bench.loop.inputs.force_lost == ""
    assert (bench.latched, bench.mode) == ("", Mode.IDLE)


def test_a_silent_driver_is_asked_nothing_once_its_successor_is_being_opened() -> None:
    bench = FakeBench(table=())
    works: list[Callable[[], None]] = []
    bench.loop.connections._ways_back["force"]._spawn = works.append
    bench.force.silent = True
    bench.until(lambda: bool(works), within_s=5.0)
    assert bench.loop.inputs.force_lost == "no sample for more than 1 s"
    bench.force.calls.clear()
    bench.cycles(5)
    assert bench.force.calls == []


def test_only_a_program_of_nothing_but_leaving_needs_the_axis_alone() -> None:
    bench = FakeBench(table=())
    bench.force.cut = "the line is gone"
    bench.cycles(2)
    bench.begin(LEAVE, HOLD)
    assert "force is lost: the line is gone" in refusals(bench)[-1]
    bench.begin(LEAVE)
    assert bench.loop.machine.busy
