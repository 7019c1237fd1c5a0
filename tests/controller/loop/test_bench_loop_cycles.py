"""Single cycles of the loop at rest: what it takes from each sample, what it hands to the checks, what it says.

Few cycles each, so that these are the tests that notice a change first.
"""

import math
from typing import Any, cast

import pytest

from controller.devices.health import STANDING_REPORTS
from controller.loop import bench_loop
from controller.loop.modes import PRESSING, Mode
from controller.loop.paired_samples import Touch
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from controller.loop.steps import Hold, Program, Retract
from controller.safety.inputs import SafetyInputs
from controller.safety.load import UNKNOWN, LoadMonitor
from controller.safety.oscillation import OscillationMonitor
from controller.safety.table import Action, Incident
from rig.channels import AxisSample, ForceSample
from rig.errors import DeviceError
from tests.controller.fake_bench import ZERO, FakeBench, wired
from tests.controller.fake_devices import ARM

MS = 1_000_000
HOLD = Hold(duration_s=30.0)
AWAY = Retract(clearance_mm=5.0, speed_mm_s=10.0)


class Asked:
    """In the place of a part of the loop: keeps what that is asked, and asks it."""

    def __init__(self, part: Any) -> None:
        self._part = part
        self.calls: list[tuple[str, tuple[Any, ...]]] = []

    def __getattr__(self, name: str) -> Any:
        def ask(*values: Any) -> Any:
            self.calls.append((name, values))
            return getattr(self._part, name)(*values)

        return ask

    def of(self, name: str) -> list[tuple[Any, ...]]:
        """Arguments of the calls of that name."""
        return [values for called, values in self.calls if called == name]


def asked(bench: FakeBench, part: str) -> Asked:
    spy = Asked(getattr(bench.loop, part))
    setattr(bench.loop, part, spy)
    return spy


def inputs(bench: FakeBench) -> SafetyInputs:
    return bench.loop.inputs


def events(bench: FakeBench) -> list[tuple[str, int, str]]:
    return [(event.code, event.level, event.text) for event in bench.ring.events if event.code != "device_state"]


def test_the_state_begins_with_what_the_wiring_says() -> None:
    bench = FakeBench(
        wired(loop={"rate_Hz": 500.0}, axis={"acceleration_mm_s2": 900.0}, limits={"position_min_mm": 3.0}), settled=0
    )
    state = bench.loop.state
    assert (state.dt_s, state.acceleration_mm_s2, state.position_min_mm) == (0.002, 900.0, 3.0)
    assert bench.loop.published == {"force": -1, "axis": -1, "tracker": -1}, "the first number of each stream is 0"


def test_the_checks_are_those_of_the_table_it_was_given() -> None:
    bench = FakeBench(table=())
    bench.say("estop")
    bench.cycles(3)
    assert (bench.latched, bench.axis.quick_stops) == ("", [])


def test_a_loop_that_begins_held_stands_as_after_an_immediate_stop() -> None:
    bench = FakeBench(settled=0, held="look first")
    assert bench.loop.machine.latched == Incident(Action.IMMEDIATE, "recovery", "look first")
    assert bench.mode is Mode.SAFE


def test_the_first_cycle_has_number_0_and_a_status_and_then_each_has_the_next() -> None:
    bench = FakeBench(settled=0)
    bench.cycles(51)
    rows = bench.ring.loop
    assert [row.seq for row in rows] == [row.cycle for row in rows] == list(range(51))
    assert [status["cycles"] for status in bench.link.statuses] == [1, 51]


def test_a_row_says_how_late_the_cycle_began_and_the_checks_hear_it_in_milliseconds() -> None:
    bench = FakeBench()
    bench.cycle(late_ns=3_400_000)
    assert bench.ring.loop[-1].wake_latency_ns == 3_400_000
    assert inputs(bench).late_ms == pytest.approx(3.4)
    assert bench.ring.asked_ns == bench.ring.loop[-1].capture_ns


def test_a_loop_that_was_held_up_inside_a_cycle_is_late_in_the_next_although_that_begins_on_its_grid() -> None:
    bench = FakeBench()
    bench.cycle(held_ns=5_000_000)
    bench.cycle()
    assert bench.ring.loop[-1].wake_latency_ns == 0
    assert inputs(bench).late_ms == pytest.approx(5.0)
    bench.cycle()
    assert inputs(bench).late_ms == 0.0


def test_the_first_cycle_of_all_is_late_against_its_own_time() -> None:
    bench = FakeBench(settled=0)
    bench.cycle(late_ns=200_000)
    assert inputs(bench).late_ms == pytest.approx(0.2)


def test_the_axis_is_first_told_to_stand_where_it_says_it_is() -> None:
    bench = FakeBench(settled=0)
    bench.cycles(2)
    assert bench.loop.state.setpoint == Setpoint(10.0, 0.0)
    assert bench.axis.commands[0][1] == 10.0


@pytest.mark.parametrize("axis", ["fx", "fy", "fz"])
@pytest.mark.parametrize(("compression", "sign"), [("positive", 1.0), ("negative", -1.0)])
def test_every_sample_of_force_is_kept_counted_and_read_along_the_wired_channel(
    axis: str, compression: str, sign: float
) -> None:
    bench = FakeBench(wired(force={"axis": axis, "compression": compression}))
    bench.force.sideways_N = (1.0, 2.0, 3.0)
    bench.cycles(5)
    newest = bench.force.samples[-1]
    assert bench.loop.state.raw_N == pytest.approx(sign * getattr(newest, f"{axis}_N"))
    assert bench.loop.state.wrench == pytest.approx(newest[4:10])
    assert bench.loop.state.force_samples == len(bench.force.samples) == len(bench.ring.force)
    assert [row.seq for row in bench.ring.axis] == list(range(bench.axis.next_seq))
    assert [row.seq for row in bench.ring.marker] == [sample.seq for sample in bench.tracker.samples]


@pytest.mark.parametrize(("force", "axis", "paired"), [(True, True, 9), (False, True, 0), (True, False, 0)])
def test_force_is_paired_with_the_axis_where_both_vouch_for_their_samples(force: bool, axis: bool, paired: int) -> None:
    bench = FakeBench()
    bench.force.valid, bench.axis.valid = force, axis
    bench.loop.state.paired.collecting = True
    bench.cycles(10)
    # The newest waits for the axis' report of its time, which comes a cycle later.
    assert bench.loop.state.paired.samples == paired


@pytest.mark.parametrize("channel", range(6))
def test_a_sensor_of_which_one_channel_still_moves_is_not_frozen(channel: int) -> None:
    bench = FakeBench(wired(loop={"missed_periods": 2}))
    sample, name = bench.force.samples[-1], ForceSample._fields[4 + channel]
    for number in range(6):
        sample = sample._replace(temperature_C=20.0 + number, **cast(Any, {name: 0.001 * number}))
        bench.loop._take_force(sample)
        assert not bench.loop.health["force"].frozen
    for number in range(3):
        bench.loop._take_force(sample._replace(temperature_C=30.0 + number))
    assert bench.loop.health["force"].frozen, "whatever else of the sample changes"


def test_where_the_limb_should_stay_is_found_anew_for_each_program() -> None:
    bench = FakeBench()
    registration = asked(bench, "_registration")
    bench.loop.start(Program(name="test", steps=(ZERO,)), 1)
    assert len(registration.of("begin")) == 1


@pytest.mark.parametrize(
    ("change", "seen"),
    [({}, True), ({"x_mm": math.nan}, False), ({"y_mm": math.nan}, False), ({"z_mm": math.inf}, False),
     ({"valid": 0}, False)],
)  # fmt: skip
def test_a_marker_counts_where_it_is_valid_and_all_of_it_a_number(change: dict[str, Any], seen: bool) -> None:
    bench = FakeBench()
    registration = asked(bench, "_registration")
    arm, tip = bench.tracker.samples[-1], bench.tracker.samples[-2]
    for sample in (tip, arm):
        bench.loop._registration.moved_mm, bench.loop._registration.scale = math.nan, None  # type: ignore[misc]
        bench.loop._take_marker(sample._replace(**change))
    assert (len(registration.of("tip")), len(registration.of("arm"))) == (seen, seen)
    if seen:
        assert registration.of("tip") == [(tip.frame, tip.capture_ns, tuple(tip[5:8]))]
        assert registration.of("arm") == [(arm.frame, ARM)]


def test_only_a_limb_that_was_seen_can_be_missed() -> None:
    bench = FakeBench(settled=0)
    bench.tracker.hidden = frozenset({1})
    bench.cycles(40)
    assert inputs(bench).limb_age_ms == 0.0
    bench.tracker.hidden = frozenset()
    bench.cycles(40)
    newest_ns = bench.tracker.samples[-1].capture_ns
    bench.tracker.hidden = frozenset({1})
    bench.cycles(20)
    assert inputs(bench).limb_age_ms == pytest.approx((bench.ring.loop[-1].capture_ns - newest_ns) * 1e-6)


@pytest.mark.parametrize(("hidden", "vouched_for"), [(0, False), (1, True)])
def test_the_markers_health_is_the_tips(hidden: int, vouched_for: bool) -> None:
    bench = FakeBench(settled=0)
    bench.tracker.hidden = frozenset({hidden})
    bench.cycles(40)
    assert bool(bench.ring.loop[-1].health & 0b010_000_000) is vouched_for


@pytest.mark.parametrize("mode", [Mode.APPROACH, Mode.COMPRESS, Mode.CONTACT])
def test_a_first_touch_on_another_channel_is_found_in_whatever_mode_it_comes(mode: Mode) -> None:
    bench = FakeBench()
    bench.run(ZERO)
    bench.loop.machine.mode = mode
    bench.force.sideways_N = (3.0, 0.0, 0.0)
    bench.cycles(3)
    assert bench.latched == "first_touch"


def test_only_a_person_who_was_heard_can_have_fallen_silent() -> None:
    bench = FakeBench(settled=0)
    bench.keep_lease = False
    bench.cycles(5)
    assert inputs(bench).operator_silent_s == 0.0
    bench.say("lease")
    bench.cycles(1)
    heard_ns = bench.ring.loop[-2].capture_ns  # the loop reads its clock after it has listened
    bench.cycles(5)
    assert inputs(bench).operator_silent_s == pytest.approx((bench.ring.loop[-1].capture_ns - heard_ns) * 1e-9)


def test_force_older_than_five_periods_is_late() -> None:
    bench = FakeBench()
    bench.force.silent = True
    newest_ns, late = bench.force.samples[-1].capture_ns, []
    for _ in range(8):
        bench.cycle()
        late.append(bench.loop.state.force_late)
    assert [row.force_age_ns for row in bench.ring.loop[-8:]] == [age_ms * MS for age_ms in range(1, 9)]
    assert bench.ring.loop[-1].capture_ns - newest_ns == 8 * MS
    assert late == [False] * 5 + [True] * 3


def test_the_way_ahead_is_the_set_points_while_it_moves_and_none_at_rest() -> None:
    resting = FakeBench()
    monitor = asked(resting, "_load_monitor")
    resting.loop.state.setpoint = Setpoint(17.0, 40.0)
    resting.cycle()
    assert monitor.of("load")[-1][3] == Setpoint(resting.loop.state.position_mm, 0.0)
    assert resting.loop.state.following_mm == 0.0
    bench = FakeBench()
    monitor = asked(bench, "_load_monitor")
    bench.begin(AWAY)
    bench.cycles(20)
    before = bench.loop.state.setpoint
    bench.cycle()
    assert monitor.of("load")[-1][3] == before
    assert bench.loop.state.following_mm == pytest.approx(before.position_mm - bench.ring.axis[-1].position_mm)


def test_a_first_touch_is_looked_for_only_where_there_may_be_one() -> None:
    bench = FakeBench()
    touch = asked(bench, "_first_touch")
    bench.cycles(3)
    bench.begin(AWAY)
    bench.cycles(3)
    assert touch.of("begin") == [()]
    assert touch.of("update") == []
    bench.loop.machine.mode = Mode.COMPRESS
    bench.cycle()
    assert len(touch.of("update")) == 1


def test_a_lost_contact_is_looked_for_only_while_the_tip_presses() -> None:
    bench = FakeBench(table=())
    lost = asked(bench, "_lost_contact")
    bench.begin(AWAY)
    bench.cycles(3)
    assert lost.of("begin") == [()]
    assert lost.of("update") == []
    assert inputs(bench).contact_lost == ""
    bench.loop.state.surface_mm = bench.loop.state.position_mm - 3.5
    for mode in PRESSING:
        bench.loop.machine.mode = mode
        bench.cycle()
        assert inputs(bench).contact_lost == lost.update(bench.loop.state)
        assert inputs(bench).contact_lost.startswith("nothing is felt 3.5 mm beyond where the limb was felt last")
    assert len(lost.of("update")) == 4


def test_each_surface_that_is_found_is_told_once() -> None:
    bench = FakeBench()
    first, second = (Touch(mm, mm - 0.1, mm + 0.1, mm, 0.1, 9, 0) for mm in (20.0, 21.0))
    for touch in (None, first, None, second, second, second):
        bench.loop.state.touch = touch
        bench.cycle()
    assert events(bench) == [("contact", 10, touch.sentence) for touch in (first, second)]


def test_a_program_that_is_over_is_told_with_its_outcome() -> None:
    bench = FakeBench()
    bench.begin(Hold(duration_s=0.005))
    bench.cycles(10)
    assert events(bench) == [("program_start", 10, "test"), ("program_end", 10, "complete")]


@pytest.mark.parametrize("stream", ["force", "axis", "marker"])
def test_forgetting_one_stream_forgets_nothing_of_the_others(stream: str) -> None:
    bench = FakeBench(table=())
    bench.axis.reads_mm = 12.0
    bench.cycles(20)
    loop, now_ns = bench.loop, bench.clock.now_ns
    registration, monitor = asked(bench, "_registration"), loop._load_monitor

    def stood_mm(setpoint_mm: float) -> float:
        loop._standstill.sent(now_ns, setpoint_mm)
        return loop._standstill.update(now_ns, 12.0)

    for _ in range(STANDING_REPORTS):
        stood_mm(30.0)
    loop.forget(stream)
    ages_ns = {name: health.age_ns(now_ns) for name, health in loop.health.items()}
    assert [name for name, age_ns in ages_ns.items() if age_ns > 1 << 61] == [stream]
    assert loop.health[stream].period_ns == {"force": MS, "axis": MS, "marker": 16_666_667}[stream]
    assert registration.of("begin") == ([()] if stream == "marker" else [])
    assert loop._limb_seen_ns == (0 if stream == "marker" else bench.tracker.samples[-1].capture_ns)
    zero = (0.0,) * 6
    forgotten = loop._load_monitor.load(now_ns, zero, 0.0, Setpoint(12.0, 0.0), 2000.0) is UNKNOWN
    assert (forgotten, loop._load_monitor is monitor) == (stream == "force", stream != "force")
    # The axis has named one place for ten reports of a set-point elsewhere; from anew that takes ten more.
    assert stood_mm(40.0) == (0.0 if stream == "axis" else 30.0)
    assert isinstance(loop._load_monitor, LoadMonitor)


def test_a_new_program_forgets_what_stood_still() -> None:
    bench = FakeBench(table=())
    bench.axis.reads_mm = 12.0  # while its set-point stays at 10 mm
    bench.cycles(20)
    bench.begin(HOLD)
    bench.cycles(STANDING_REPORTS + 2)
    assert bench.loop.state.setpoint.position_mm == 12.0
    assert bench.loop.state.standstill_mm == 0.0


@pytest.fixture
def ways(monkeypatch: pytest.MonkeyPatch) -> list[Mode]:
    """Modes in which the drive was told to give way."""
    given: list[Mode] = []

    def give_way(axis: Any, limits: Any) -> bool:
        given.append(Mode.RETRACT)
        return True

    monkeypatch.setattr(bench_loop, "give_way", give_way)
    return given


def test_at_rest_a_limb_that_pushes_is_given_way_to_and_what_stood_still_is_forgotten(ways: list[Mode]) -> None:
    bench = FakeBench(wired(axis={"following_error_mm": 30.0}))
    bench.axis.reads_mm = 12.0
    bench.cycles(20)
    bench.force.extra_N = lambda _: 20.0
    bench.cycles(2)
    assert (bench.mode, len(ways)) == (Mode.RETRACT, 1)
    bench.cycles(STANDING_REPORTS)
    # From 12 mm outwards for a dozen cycles, not from the 10 mm of the set-point before.
    assert bench.loop.state.standstill_mm < 0.1
    assert "axis_frozen" not in {code for code, _, _ in events(bench)}


def test_a_retreat_from_a_program_and_a_stop_at_rest_ask_no_drive_to_give_way(ways: list[Mode]) -> None:
    bench = FakeBench()
    bench.begin(AWAY)
    bench.say("pain")
    bench.cycles(2)
    assert (bench.mode, ways) == (Mode.RETRACT, [])
    resting = FakeBench()
    resting.say("estop")
    resting.cycles(2)
    assert (resting.mode, ways) == (Mode.SAFE, [])


def test_the_warning_that_a_drive_cannot_give_way_has_the_time_of_its_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(axis: Any, limits: Any) -> bool:
        raise DeviceError("the bus is off")

    monkeypatch.setattr(bench_loop, "give_way", refuse)
    bench = FakeBench()
    bench.force.extra_N = lambda _: 20.0
    bench.cycles(2)
    told = {event.code: event.capture_ns for event in bench.ring.events}
    assert told["no_way"] == told[bench.latched]


def test_a_drive_that_cannot_give_way_is_left_braked_with_a_warning() -> None:
    bench = FakeBench(table=())
    bench.axis.on, bench.axis.cut = False, "the bus is off"
    bench.loop._give_way(77)
    assert events(bench) == [("no_way", 20, "the bus is off")]
    assert (bench.loop.braked, bench.mode) == (True, Mode.SAFE)


def test_an_axis_that_fails_once_is_lost_with_the_reason() -> None:
    bench = FakeBench()

    def fails(now_ns: int) -> list[AxisSample]:
        bench.axis.calls.append("poll")
        raise DeviceError("no answer")

    bench.axis.poll = fails  # type: ignore[method-assign]
    bench.axis.calls.clear()
    bench.cycles(3)
    assert inputs(bench).axis_lost == "no answer"
    assert bench.axis.calls == ["poll"], "and asked nothing more, a command included"


def test_status_rounds_a_rate_to_tenths() -> None:
    bench = FakeBench()
    bench.loop.health["axis"]._mean_period_ns = 1e9 / 123.456
    assert bench.loop._status(bench.ring.loop[-1])["rates_Hz"]["axis"] == 123.5


def test_the_loop_asks_the_clock_it_was_given() -> None:
    bench = FakeBench()
    bench.clock.now_ns += 1
    assert bench.loop.now() == bench.clock.now_ns


def test_the_grid_follows_the_force_sensors_newest_sample() -> None:
    bench = FakeBench()
    newest, phase = bench.force.samples[-1], bench.loop.phase
    # Ten periods after the newest sample the sensor counts as silent, and not a moment before.
    silent_ns = newest.capture_ns + phase._least_ns + 10 * phase._sensor_ns
    assert (phase._follows(silent_ns - 1), phase._follows(silent_ns)) == (True, False)


class Swinging(OscillationMonitor):
    """Always has something to say."""

    def update(self, state: LoopState) -> str:
        return f"swings in {state.force_N:.0f} N"


@pytest.mark.parametrize("mode", Mode)
def test_an_oscillation_is_heard_in_force_control_alone(mode: Mode) -> None:
    bench = FakeBench()
    bench.loop._oscillation = Swinging()
    bench.loop.machine.mode = mode
    bench.cycle()
    heard = f"swings in {bench.loop.state.force_N:.0f} N"
    assert inputs(bench).oscillation == (heard if mode is Mode.CONTACT else "")
    assert (bench.latched == "oscillation") is (mode is Mode.CONTACT)


def test_a_loop_that_nobody_holds_back_may_start_at_once() -> None:
    bench = FakeBench()
    parts: Any = (bench.wiring, bench.devices, bench.ring, bench.link, bench.loop._commands, bench.clock)
    assert bench_loop.BenchLoop(*parts).machine.latched is None
