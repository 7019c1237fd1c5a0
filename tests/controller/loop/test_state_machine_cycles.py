"""The state machine cycle by cycle on a state that is written down: where a stop leads, what rests, what is let go."""

import math
from typing import Any

import pytest

from controller.loop.modes import AT_REST, Mode
from controller.loop.setpoint import Setpoint
from controller.loop.state import LoopState
from controller.loop.state_machine import MotionStateMachine
from controller.loop.steps import Hold, MoveTo, Program, Retract, Zero
from controller.safety.inputs import SafetyInputs
from controller.safety.load import TipLoad
from controller.safety.table import Action, Check, Incident
from rig.config.wiring import Limits, Wiring

QUIET = TipLoad(force_N=0.0, torque_N_m=0.0, rate_N_s=0.0, stiffness_N_mm=0.0, predicted_N=0.0, vanished_N=0.0)
STEPS = (Hold(duration_s=0.010), MoveTo(position_mm=30.0, speed_mm_s=20.0))


class Cycled:
    """A machine whose axis is where it is told to be, with a table of one line that says ``alarm`` when told to."""

    def __init__(
        self, position_mm: float = 20.0, action: Action = Action.SOFT, code: str = "alarm", **limits: Any
    ) -> None:
        self.alarm = ""
        table = (Check(code, action, lambda *_: self.alarm, 0.1, at_rest=True),)
        self.ended: list[tuple[str, Incident | None]] = []
        self.wiring = Wiring(limits=Limits(**limits))
        self.state = LoopState(position_mm=position_mm, setpoint=Setpoint(position_mm, 0.0), load=QUIET, force_N=0.0,
                           raw_N=0.0, wrench=(0.0,) * 6)  # fmt: skip
        self.machine = MotionStateMachine(self.wiring, self.state, lambda *end: self.ended.append(end), table)
        self.inputs = SafetyInputs()

    def start(self, *steps: Any) -> None:
        self.machine.start(Program(name="p", steps=steps or STEPS))

    def cycle(self, alarm: str = "") -> Incident | None:
        self.alarm = alarm
        incident = self.machine.update(self.inputs)
        self.state.position_mm = self.state.setpoint.position_mm
        self.state.now_ns += 1_000_000
        return incident

    def cycles_until(self, mode: Mode) -> int:
        for count in range(20_000):
            if self.machine.mode is mode:
                return count
            self.cycle()
        raise AssertionError(f"still {self.machine.mode.name}")


def test_a_machine_begins_at_rest_with_nothing_to_do() -> None:
    bench = Cycled()
    machine = bench.machine
    assert (machine.mode, machine.latched, machine.step_index, machine.step, machine.run, machine.busy) == (
        Mode.IDLE, None, -1, None, None, False,
    )  # fmt: skip
    assert bench.cycle() is None
    assert bench.ended == []
    assert AT_REST == (Mode.IDLE, Mode.SAFE)


def test_a_start_forgets_what_the_program_before_it_found() -> None:
    bench = Cycled()
    state = bench.state
    state.surface_mm, state.reference_N, state.tangent_N_mm, state.peak_force_N = 1.0, 2.0, 3.0, 4.0
    state.outcome, state.setpoint = "force limit", Setpoint(1.0, 5.0)
    bench.start()
    assert all(math.isnan(value) for value in (state.surface_mm, state.reference_N, state.tangent_N_mm))
    assert (state.peak_force_N, state.outcome, state.memory, state.touch) == (0.0, "", None, None)
    assert state.setpoint == Setpoint(20.0, 0.0)


@pytest.mark.parametrize(("position_mm", "begins_mm"), [(-0.01, 0.0), (60.01, 60.0), (0.0, 0.0), (60.0, 60.0)])
def test_a_count_beyond_the_end_of_the_workspace_is_its_end(position_mm: float, begins_mm: float) -> None:
    bench = Cycled(position_mm)
    bench.start()
    assert bench.state.setpoint.position_mm == begins_mm


def test_steps_follow_each_other_each_with_its_own_time_and_the_last_ends_the_program() -> None:
    bench = Cycled()
    bench.state.now_ns = 5_000_000_000
    bench.start(Hold(duration_s=0.010), Zero(duration_s=0.020), Hold(duration_s=0.005))
    bench.state.force_samples = 1
    seen = []
    while bench.machine.busy:
        seen.append((bench.machine.step_index, bench.machine.mode, bench.machine.step_start_ns - 5_000_000_000))
        assert bench.machine.step is not None and bench.machine.run is not None
        bench.cycle()
    assert seen == [
        *[(0, Mode.COMPRESS, 0)] * 11, *[(1, Mode.FREE, 10_000_000)] * 20, *[(2, Mode.COMPRESS, 30_000_000)] * 5
    ]  # fmt: skip
    assert bench.ended == [("complete", None)]
    assert (bench.machine.mode, bench.machine.step_index, bench.machine.step, bench.machine.run) == (
        Mode.IDLE, -1, None, None,
    )  # fmt: skip


def test_the_outcome_is_what_a_step_left_and_the_peak_the_largest_force_of_a_program() -> None:
    bench = Cycled()
    bench.start(Hold(duration_s=0.003))
    bench.state.outcome = "force limit"
    for force_N in (1.0, 3.0, 2.0, 0.0):
        bench.state.force_N = force_N
        bench.cycle()
    assert bench.ended == [("force limit", None)]
    assert bench.state.peak_force_N == 3.0


@pytest.mark.parametrize(
    ("surface_mm", "from_mm", "limits", "to_mm"),
    [
        (math.nan, 20.0, {}, 10.0),  # ten millimetres from where it is
        (18.0, 20.0, {}, 8.0),  # or from the surface, where that is nearer
        (25.0, 20.0, {}, 10.0),  # but never first into the tissue
        (6.0, 20.0, {}, 0.0),  # and not out of the workspace
        (6.0, 20.0, {"position_min_mm": 1.0}, 1.0),
    ],
)
def test_a_soft_stop_retracts_ten_millimetres_clear_at_its_speed_and_stays(
    surface_mm: float, from_mm: float, limits: dict[str, Any], to_mm: float
) -> None:
    bench = Cycled(from_mm, **limits)
    bench.start(Hold(duration_s=1.0))
    bench.state.surface_mm, bench.state.reference_N, bench.state.tangent_N_mm = surface_mm, 1.0, 2.0
    bench.cycle()
    incident = bench.cycle("too much")
    assert incident == Incident(Action.SOFT, "alarm", "too much") == bench.machine.latched
    assert bench.ended == [("alarm", incident)]
    assert (bench.machine.mode, bench.machine.busy) == (Mode.RETRACT, True)
    cycles = bench.cycles_until(Mode.SAFE)
    assert bench.state.setpoint == Setpoint(to_mm, 0.0)
    # 20 mm/s, and a ramp of 10 ms at either end costs half of that.
    assert cycles * 1e-3 == pytest.approx((from_mm - to_mm) / 20.0 + 0.010, abs=0.006)
    assert math.isnan(bench.state.reference_N) and math.isnan(bench.state.tangent_N_mm)
    assert (bench.machine.busy, len(bench.ended)) == (False, 1)


def test_a_retreat_that_is_stopped_goes_out_as_far_as_it_would_have_gone() -> None:
    """After a restart nobody knows where the surface is: ten millimetres out of thirty in a limb were twenty in it."""
    bench = Cycled(45.0, position_min_mm=1.0)
    bench.start(Retract(clearance_mm=60.0, speed_mm_s=5.0, floor_mm=1.0))
    assert bench.cycle("too much")
    bench.cycles_until(Mode.SAFE)
    assert bench.state.setpoint == Setpoint(1.0, 0.0)
    known = Cycled(30.0)
    known.start(Retract(clearance_mm=5.0, speed_mm_s=5.0))
    known.state.surface_mm = 25.0
    assert known.cycle("too much")
    known.cycles_until(Mode.SAFE)
    assert known.state.setpoint == Setpoint(15.0, 0.0)


def test_during_a_retraction_a_soft_cause_changes_nothing_and_an_immediate_one_stops_it() -> None:
    soft = Cycled()
    soft.start(Hold(duration_s=1.0))
    soft.cycle("first")
    for _ in range(5):
        assert soft.cycle("second") is None
    assert soft.machine.latched == Incident(Action.SOFT, "alarm", "first")
    immediate = Cycled(action=Action.IMMEDIATE)
    immediate.start(Hold(duration_s=1.0))
    immediate.machine._stop(Incident(Action.SOFT, "other", "first"))
    assert immediate.machine.mode.name == "RETRACT"
    assert immediate.cycle("second") == Incident(Action.IMMEDIATE, "alarm", "second")
    assert immediate.machine.mode is Mode.SAFE


def test_an_immediate_stop_stays_where_it_is() -> None:
    bench = Cycled(action=Action.IMMEDIATE)
    bench.start(MoveTo(position_mm=30.0, speed_mm_s=20.0))
    for _ in range(50):
        bench.cycle()
    at = bench.state.setpoint
    bench.cycle("blocked")
    assert (bench.machine.mode, bench.state.setpoint) == (Mode.SAFE, at)
    for _ in range(10):
        bench.cycle()
    assert bench.state.setpoint == at


def test_safe_is_left_by_acknowledging_and_nothing_else_is() -> None:
    bench = Cycled(action=Action.IMMEDIATE)
    bench.start(Hold(duration_s=1.0))
    bench.machine.acknowledge()
    assert bench.machine.mode is Mode.COMPRESS
    bench.cycle("blocked")
    bench.state.position_mm, bench.state.rest_N = 19.0, 4.0
    bench.machine.acknowledge()
    assert (bench.machine.mode, bench.machine.latched) == (Mode.IDLE, None)
    assert bench.state.setpoint == Setpoint(19.0, 0.0)
    assert math.isnan(bench.state.rest_N)


def test_a_bench_that_is_held_is_safe_until_it_is_acknowledged() -> None:
    bench = Cycled()
    incident = Incident(Action.IMMEDIATE, "axis_returned", "it is back")
    bench.machine.hold(incident)
    assert (bench.machine.mode, bench.machine.latched) == (Mode.SAFE, incident)
    bench.machine.acknowledge()
    assert bench.machine.mode is Mode.IDLE


def test_a_step_that_refuses_is_a_soft_stop_of_the_protocol() -> None:
    bench = Cycled()
    bench.start(Zero(duration_s=0.001))
    bench.state.reference_zero, bench.state.force_samples = (9.0, 0.0, 0.0, 0.0, 0.0, 0.0), 1
    bench.cycle()
    incident = bench.cycle()
    assert incident is not None and (incident.action, incident.code) == (Action.SOFT, "protocol")
    assert incident.text.startswith("fx in the air moved by -9")
    assert (bench.machine.latched, bench.machine.mode) == (incident, Mode.RETRACT)


@pytest.mark.parametrize(("target_mm", "end_mm"), [(61.0, 60.0), (-1.0, 0.0)])
def test_a_step_that_leads_out_of_the_workspace_is_stopped_at_its_end(target_mm: float, end_mm: float) -> None:
    bench = Cycled(end_mm)
    bench.start(MoveTo(position_mm=target_mm, speed_mm_s=20.0))
    incident = bench.cycle()
    assert incident is not None and (incident.action, incident.code) == (Action.SOFT, "workspace")
    wanted = f"{end_mm + math.copysign(0.002, target_mm):.2f}"
    assert incident.text == f"the program leads to {wanted} mm, outside 0 to 60 mm"
    assert bench.ended == [("workspace", incident)]
    assert bench.state.setpoint == Setpoint(end_mm, 0.0)


def test_the_end_of_the_workspace_itself_may_be_reached() -> None:
    for end_mm in (0.0, 60.0):
        bench = Cycled(30.0)
        bench.start(MoveTo(position_mm=end_mm, speed_mm_s=50.0))
        bench.cycles_until(Mode.IDLE)
        assert bench.ended == [("complete", None)]


def rested(*forces_N: float, bench: Cycled | None = None) -> Cycled:
    bench = bench or Cycled()
    for force_N in forces_N:
        bench.state.load = QUIET._replace(force_N=force_N)
        bench.cycle()
    return bench


def test_the_rest_is_the_smallest_load_since_the_tip_rests() -> None:
    assert rested(3.0, 2.0, 4.0).state.rest_N == 2.0
    moving = Cycled()
    moving.start(Hold(duration_s=1.0))
    assert math.isnan(rested(3.0, 2.0, bench=moving).state.rest_N)


def test_a_limb_that_pushes_at_rest_is_left_from_where_the_tip_is() -> None:
    bench = Cycled(code="pushed")
    bench.state.setpoint = Setpoint(50.0, 0.0)
    bench.alarm = "it pushes"
    incident = bench.machine.update(bench.inputs)
    assert incident is not None and bench.machine.mode is Mode.RETRACT
    assert bench.state.setpoint == Setpoint(20.0, 0.0)
    assert bench.ended == []
    bench.cycles_until(Mode.SAFE)
    assert bench.state.setpoint.position_mm == 10.0
    again = bench.cycle("and again")
    assert again is not None and bench.machine.mode is Mode.RETRACT, "also from SAFE, as long as there is way"
    bench.cycles_until(Mode.SAFE)
    assert bench.state.setpoint.position_mm == 0.0
    assert bench.cycle("and again") is None, "at the end there is none"


def test_half_a_millimetre_from_the_end_is_the_end() -> None:
    for position_mm, goes in ((0.49, False), (0.5, True)):
        bench = Cycled(position_mm, code="pushed")
        bench.machine.hold(Incident(Action.SOFT, "first", "first"))
        assert (bench.cycle("it pushes") is not None) is goes
    unlatched = Cycled(0.1, code="pushed")
    assert unlatched.cycle("it pushes") is not None, "the first stop is always told"


def test_a_drive_without_power_stays_until_the_stop_is_acknowledged() -> None:
    bench = Cycled(code="pushed")
    bench.cycle("it pushes")
    bench.machine.stay()
    assert bench.machine.mode is Mode.SAFE
    assert bench.cycle("it pushes") is None
    bench.machine.acknowledge()
    assert bench.cycle("it pushes") is not None
    bench.cycles_until(Mode.SAFE)
    assert bench.cycle("it pushes") is not None, "and it leaves again and again"


@pytest.mark.parametrize("code", ["pain_stop", "operator_stop"])
def test_a_persons_stop_at_rest_holds_and_moves_the_tip_only_out_of_contact(code: str) -> None:
    away = Cycled(code=code)
    incident = away.cycle("asked")
    assert (away.machine.mode, away.machine.latched) == (Mode.SAFE, incident)
    surface = Cycled(code=code)
    surface.state.surface_mm = 20.0
    surface.cycle("asked")
    assert surface.machine.mode is Mode.SAFE
    inside = Cycled(code=code)
    inside.state.surface_mm = 19.9
    inside.cycle("asked")
    assert inside.machine.mode is Mode.RETRACT
    stopped = Cycled(code=code)
    first = Incident(Action.IMMEDIATE, "first", "first")
    stopped.machine.hold(first)
    stopped.state.surface_mm = 10.0
    stopped.cycle("asked")
    assert (stopped.machine.mode, stopped.machine.latched) == (Mode.SAFE, first)


def test_a_persons_stop_while_the_tip_moves_retracts_wherever_it_is() -> None:
    bench = Cycled(code="pain_stop")
    bench.start(Retract(clearance_mm=5.0, speed_mm_s=5.0))
    bench.cycle("asked")
    assert bench.machine.mode is Mode.RETRACT
    assert bench.ended[0][0] == "pain_stop"


def test_a_withdrawal_goes_to_the_end_of_the_workspace_from_where_the_tip_is() -> None:
    bench = Cycled(position_min_mm=2.0)
    bench.machine.hold(Incident(Action.IMMEDIATE, "recovery", "it was killed"))
    bench.machine.stay()
    bench.state.setpoint = Setpoint(50.0, 0.0)
    bench.machine.withdraw()
    assert (bench.machine.mode, bench.state.setpoint) == (Mode.RETRACT, Setpoint(20.0, 0.0))
    assert not bench.machine._stays
    bench.cycles_until(Mode.SAFE)
    assert bench.state.setpoint == Setpoint(2.0, 0.0)
