"""Every line of the safety table as it is specified: its place, its action, and its bound, met exactly and passed."""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import pytest

from controller.loop.modes import Mode
from controller.loop.registration import Interval
from controller.loop.state import LoopState
from controller.safety import checks as safety_checks
from controller.safety.inputs import SafetyInputs
from controller.safety.load import UNKNOWN, TipLoad
from controller.safety.table import BY_PERSON, TABLE, Action, Check, Incident, evaluate
from rig.config.wiring import Wiring

SOFT, IMMEDIATE = Action.SOFT, Action.IMMEDIATE
# Code, action, bound [s], at rest too: written down here once more, in the order in which they are looked at.
LINES = [
    ("emergency_stop", IMMEDIATE, 0.1, True),
    ("drive_fault", IMMEDIATE, 0.1, False),
    ("axis_lost", IMMEDIATE, 0.6, False),
    ("following_error", IMMEDIATE, 0.5, False),
    ("axis_frozen", IMMEDIATE, 0.45, False),
    ("overspeed", IMMEDIATE, 0.1, False),
    ("workspace", IMMEDIATE, 0.1, False),
    ("force_limit", SOFT, 0.1, True),
    ("torque_limit", SOFT, 0.1, True),
    ("pushed", SOFT, 0.1, True),
    ("pain_stop", SOFT, 0.1, True),
    ("operator_stop", SOFT, 0.1, True),
    ("force_lost", SOFT, 0.6, False),
    ("force_invalid", SOFT, 0.1, False),
    ("force_rate", SOFT, 0.1, True),
    ("contact_lost", SOFT, 0.7, False),
    ("oscillation", SOFT, 1.1, False),
    ("first_touch", SOFT, 2.0, False),
    ("axis_scale", SOFT, 2.1, False),
    ("depth_limit", SOFT, 0.1, False),
    ("tracker_lost", SOFT, 0.6, False),
    ("patient_moved", SOFT, 0.3, False),
    ("loop_overrun", SOFT, 0.1, False),
    ("recorder_stalled", SOFT, 3.1, False),
    ("stop_lost", SOFT, 1.1, False),
    ("input_lost", SOFT, 1.3, False),
    ("supervisor_lost", SOFT, 0.1, False),
    ("operator_silent", SOFT, 3.1, False),
]
QUIET = TipLoad(force_N=0.0, torque_N_m=0.0, rate_N_s=0.0, stiffness_N_mm=0.0, predicted_N=0.0, vanished_N=0.0)
WRENCH = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)


def load(**parts: float) -> dict[str, Any]:
    return {"load": QUIET._replace(**parts)}


def asked(*requests: str) -> dict[str, Any]:
    return {"requests": frozenset(requests)}


def resting(force_N: float, rest_N: float, mode: Mode = Mode.SAFE) -> dict[str, Any]:
    return {**load(force_N=force_N, predicted_N=force_N), "rest_N": rest_N, "mode": mode}


def wiring(**sections: dict[str, Any]) -> Wiring:
    return Wiring.model_validate(sections)


@dataclass
class Case:
    """A check with what it may still see, what it may not, and the sentence that follows."""

    code: str
    within: dict[str, Any]
    beyond: dict[str, Any]
    sentence: str
    wiring: Wiring = field(default_factory=Wiring)


CASES = [
    Case("emergency_stop", asked("stop", "pain"), asked("estop"), "emergency stop pressed"),
    Case("drive_fault", {}, {"drive_fault": "2310 overcurrent"}, "the drive reports: 2310 overcurrent"),
    Case("axis_lost", {"axis_age_ms": 50.0}, {"axis_age_ms": 50.5},
         "axis: newest sample is 50 ms old (limit 50 ms)"),
    Case("axis_lost", {}, {"axis_lost": "no heartbeat"}, "axis lost: no heartbeat"),
    Case("axis_lost", {"axis_age_ms": 60.0}, {"axis_age_ms": 3e9},
         "axis: newest sample is 1000000 ms old (limit 60 ms)", wiring(loop={"stale_axis_ms": 60.0})),
    Case("following_error", {"following_mm": 2.0}, {"following_mm": 2.01},
         "the axis lags its set-point by 2.01 mm (limit 2 mm): is it blocked?"),
    Case("following_error", {"following_mm": -2.0}, {"following_mm": -2.01},
         "the axis lags its set-point by 2.01 mm (limit 2 mm): is it blocked?"),
    Case("axis_frozen", {"standstill_mm": 0.3}, {"standstill_mm": 0.31, "position_mm": 7.25},
         "the axis goes on reporting 7.250 mm while its set-point went 0.31 mm further (limit 0.3 mm):"
         " its position is frozen, or it is blocked"),
    Case("overspeed", {"velocity_mm_s": 72.0}, {"velocity_mm_s": 73.0}, "the axis moves at 73 mm/s (limit 72 mm/s)"),
    Case("overspeed", {"velocity_mm_s": -72.0}, {"velocity_mm_s": -73.0}, "the axis moves at 73 mm/s (limit 72 mm/s)"),
    Case("workspace", {"position_mm": 61.0}, {"position_mm": 61.01}, "position 61.01 mm is outside -1 to 61 mm"),
    Case("workspace", {"position_mm": -1.0}, {"position_mm": -1.01}, "position -1.01 mm is outside -1 to 61 mm"),
    Case("force_limit", load(force_N=15.0, predicted_N=15.0), load(force_N=15.01, predicted_N=15.01),
         "force 15.01 N is above the subject's pain threshold, 15 N"),
    Case("force_limit", {}, load(force_N=14.0, predicted_N=15.01),
         "force 14.00 N would be 15.01 N before the axis stands, above the subject's pain threshold, 15 N"),
    Case("force_limit", {}, load(force_N=15.0, predicted_N=15.01),
         "force 15.00 N would be 15.01 N before the axis stands, above the subject's pain threshold, 15 N"),
    Case("force_limit", load(force_N=12.0, predicted_N=12.0), load(force_N=12.01),
         "force 12.01 N is above limits.force_N, 12 N", wiring(limits={"force_N": 12.0})),
    Case("force_limit", load(force_N=12.0), load(force_N=12.01), "force 12.01 N is above limits.force_N, 12 N",
         wiring(limits={"force_N": 12.0}, subject={"pain_threshold_N": 12.0})),
    Case("force_limit", {}, load(force_N=math.nan), "force nan N is above the subject's pain threshold, 15 N"),
    Case("force_limit", {}, load(predicted_N=math.nan),
         "force 0.00 N would be nan N before the axis stands, above the subject's pain threshold, 15 N"),
    Case("torque_limit", load(torque_N_m=0.5), load(torque_N_m=0.501),
         "torque 0.501 N m is above limits.torque_N_m, 0.5 N m"),
    Case("torque_limit", {}, load(torque_N_m=math.nan), "torque nan N m is above limits.torque_N_m, 0.5 N m"),
    Case("pushed", resting(6.0, 1.0), resting(6.01, 1.0),
         "the limb pushes: 5.01 N more than when the tip came to rest (limits.pushed_N 5 N)"),
    Case("pushed", resting(9.0, 1.0, mode=Mode.COMPRESS), resting(9.0, 1.0, mode=Mode.IDLE),
         "the limb pushes: 8.00 N more than when the tip came to rest (limits.pushed_N 5 N)"),
    Case("pushed", resting(9.0, math.nan), resting(7.5, 1.0, mode=Mode.SAFE),
         "the limb pushes: 6.50 N more than when the tip came to rest (limits.pushed_N 5 N)"),
    Case("first_touch", {"touch_wrong": ""}, {"touch_wrong": "another channel answers"}, "another channel answers"),
    Case("oscillation", {"oscillation": ""}, {"oscillation": "the force swings"}, "the force swings"),
    Case("axis_scale", {"axis_scale": Interval(0.9, 0.95)}, {"axis_scale": Interval(0.9, 0.949)},
         "the tracker sees 0.900 to 0.949 mm for each mm of the axis (1 within 0.05): check axis.increments_per_mm,"
         " then `rig calibrate axis`"),
    Case("axis_scale", {"axis_scale": Interval(1.05, 1.1)}, {"axis_scale": Interval(1.051, 1.1)},
         "the tracker sees 1.051 to 1.100 mm for each mm of the axis (1 within 0.05): check axis.increments_per_mm,"
         " then `rig calibrate axis`"),
    Case("pain_stop", asked("stop"), {**asked("pain"), "force_N": 7.25}, "the subject's pain stop at 7.25 N"),
    Case("operator_stop", asked("pain"), asked("stop"), "stopped by the operator"),
    Case("operator_stop", asked("pain"), asked("stop", "keypad"),
         "the keypad or foot switch for stops is gone: plug it in, then acknowledge the stop"),
    Case("force_lost", {"force_age_ms": 4.0}, {"force_age_ms": 5.0}, "force: newest sample is 5 ms old (limit 4 ms)"),
    Case("force_lost", {}, {"force_lost": "cable"}, "force sensor lost: cable"),
    Case("force_invalid", {}, {"force_valid": False},
         "the force sensor marks its samples as invalid or out of range"),
    Case("force_invalid", {}, {"wrench": (0.0, math.nan, 0.0, 0.0, 0.0, 0.0)},
         "the force sensor marks its samples as invalid or out of range"),
    Case("force_invalid", {}, {"wrench": (0.0, 0.0, 0.0, 0.0, 0.0, math.inf)},
         "the force sensor marks its samples as invalid or out of range"),
    Case("force_invalid", {}, {"force_frozen": True}, "the force sensor repeats the same value: it is frozen"),
    Case("force_rate", load(rate_N_s=1000.0), load(rate_N_s=1001.0), "force changes by 1001 N/s (limit 1000 N/s)"),
    Case("contact_lost", load(vanished_N=0.0), load(vanished_N=0.34),
         "0.34 N vanished at once though the tip did not leave: the limb is gone, or a force channel died or lost its"
         " gain; check sensor and cable, then `rig calibrate force`"),
    Case("contact_lost", {**load(vanished_N=3.0), "mode": Mode.RETRACT}, {"contact_lost": "nothing is felt"},
         "nothing is felt"),
    Case("depth_limit", {"position_mm": 35.0, "surface_mm": 20.0}, {"position_mm": 35.01, "surface_mm": 20.0},
         "depth 15.01 mm is above 15 mm"),
    Case("tracker_lost", {"marker_age_ms": 200.0}, {"marker_age_ms": 201.0},
         "tracker: newest sample is 201 ms old (limit 200 ms)"),
    Case("tracker_lost", {"limb_age_ms": 200.0}, {"limb_age_ms": 201.0},
         "limb's marker: newest sample is 201 ms old (limit 200 ms)"),
    Case("tracker_lost", {}, {"marker_lost": "cable"}, "tracker lost: cable"),
    Case("patient_moved", {"patient_mm": 10.0}, {"patient_mm": 10.5},
         "the limb moved by 10.5 mm against the robot (limit 10 mm)"),
    Case("loop_overrun", {"late_ms": 100.0}, {"late_ms": 101.0},
         "the loop came 101 ms late (limit 100 ms): is the computer overloaded?"),
    Case("recorder_stalled", {"recorder_fill": 0.5}, {"recorder_fill": 0.51},
         "the recorder is silent for 0.0 s, its buffer 51 % full"),
    Case("recorder_stalled", {"recorder_silent_s": 3.0}, {"recorder_silent_s": 3.1},
         "the recorder is silent for 3.1 s, its buffer 0 % full"),
    Case("recorder_stalled", asked("pain"), asked("recording"),
         "the recording failed, and nothing moves unrecorded: the trial says why"),
    Case("input_lost", {"input_lost": ""}, {"input_lost": "input pedal is lost: gone"}, "input pedal is lost: gone"),
    Case("stop_lost", {"stop_silent_s": 1.0}, {"stop_silent_s": 1.01},
         "the stop process is silent for 1.0 s (limit 1 s), so nobody could stop what moves: start the bench again"),
    Case("supervisor_lost", {}, {"supervisor_lost": True}, "the program that started the loop is gone"),
    Case("operator_silent", {"operator_silent_s": 3.0}, {"operator_silent_s": 3.1},
         "the operator's program is silent for 3.1 s (lease 3 s)"),
    Case("operator_silent", asked("stop"), asked("unattended"),
         "whoever started this is not in control any more: control was given back or ran out"),
]  # fmt: skip


def found(line: Check, case: Case, change: dict[str, Any]) -> str:
    """What a line of the table says of a quiet bench with ``change``."""
    state = LoopState(position_mm=20.0, load=QUIET, wrench=WRENCH, reference_zero=WRENCH, force_N=0.0)
    inputs = SafetyInputs(mode=Mode.COMPRESS)
    for name, value in change.items():
        setattr(inputs if hasattr(inputs, name) else state, name, value)
    return line.evaluate(state, inputs, case.wiring)


def line_of(code: str) -> Check:
    return next(line for line in TABLE if line.code == code)


def test_the_table_is_the_one_written_down_here() -> None:
    assert [(line.code, line.action, line.bound_s, line.at_rest) for line in TABLE] == LINES


def test_a_person_stops_by_three_lines_and_no_other() -> None:
    assert {code for code, *_ in LINES if code in BY_PERSON} == {"emergency_stop", "pain_stop", "operator_stop"}


def test_actions_stand_in_the_event_stream_by_these_levels() -> None:
    assert {action.name: int(action) for action in Action} == {"NOTE": 10, "WARNING": 20, "SOFT": 30, "IMMEDIATE": 40}


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.code}-{case.sentence[:30]}")
def test_each_check_passes_its_bound_and_stops_beyond_it_with_its_figures(case: Case) -> None:
    line = line_of(case.code)
    assert found(line, case, case.within) == ""
    assert found(line, case, case.beyond) == case.sentence


def test_every_line_has_a_case() -> None:
    assert {case.code for case in CASES} == {line.code for line in TABLE}


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.code}-{case.sentence[:30]}")
def test_what_one_check_stops_at_no_other_does(case: Case) -> None:
    assert [line.code for line in TABLE if found(line, case, case.beyond)] == [case.code]


@pytest.mark.parametrize("code", ["force_limit", "torque_limit", "force_rate", "pushed"])
@pytest.mark.parametrize("mode", [Mode.IDLE, Mode.SAFE])
@pytest.mark.parametrize(
    "unfelt",
    [
        {"force_lost": "cable"},
        {"force_valid": False},
        {"force_age_ms": 4.1},
        {"load": QUIET._replace(torque_N_m=math.nan)},
    ],
)
def test_at_rest_the_axis_gives_way_only_to_what_is_felt_now(code: str, mode: Mode, unfelt: dict[str, Any]) -> None:
    much = {**load(force_N=49.0, predicted_N=49.0, torque_N_m=4.0, rate_N_s=4000.0), "rest_N": 1.0, "mode": mode}
    assert found(line_of(code), CASES[0], {**much, "force_age_ms": 4.0})
    assert found(line_of(code), CASES[0], {**much, **unfelt}) == ""


@pytest.mark.parametrize(("code", "stops"), [("force_limit", False), ("torque_limit", False), ("force_rate", True)])
def test_at_rest_without_a_zero_only_a_change_says_something(code: str, stops: bool) -> None:
    much = {**load(force_N=49.0, predicted_N=49.0, torque_N_m=4.0, rate_N_s=4000.0), "mode": Mode.IDLE}
    assert bool(found(line_of(code), CASES[0], {**much, "reference_zero": None})) is stops
    assert found(line_of(code), CASES[0], {**much, "reference_zero": WRENCH})


@pytest.mark.parametrize("code", ["force_limit", "torque_limit", "force_rate"])
def test_while_the_tip_moves_what_is_not_known_is_a_stop_too(code: str) -> None:
    nothing = {"load": UNKNOWN._replace(rate_N_s=math.nan), "force_lost": "cable", "mode": Mode.COMPRESS}
    assert found(line_of(code), CASES[0], nothing)


@pytest.mark.parametrize("mode", list(Mode))
def test_a_load_that_vanishes_counts_where_the_tip_is_to_press(mode: Mode) -> None:
    gone = {**load(vanished_N=3.0), "mode": mode}
    assert bool(found(line_of("contact_lost"), CASES[0], gone)) is (mode in (Mode.COMPRESS, Mode.CONTACT))


def test_without_a_tracker_no_tracker_can_be_lost() -> None:
    state, inputs = LoopState(), SafetyInputs(marker_lost="cable", marker_age_ms=1e9, limb_age_ms=1e9)
    assert safety_checks.tracker_lost(state, inputs, Wiring(tracker=None)) == ""


def test_without_a_lease_no_operator_is_silent() -> None:
    case = Case("operator_silent", {}, {}, "", wiring(loop={"lease_s": 0.0}))
    assert found(line_of("operator_silent"), case, {"operator_silent_s": 1e9}) == ""


def test_a_limb_whose_place_is_not_known_has_not_moved() -> None:
    assert found(line_of("patient_moved"), CASES[0], {"patient_mm": math.nan}) == ""


def told(*codes: str, least: Action = SOFT, at_rest: bool = False) -> Incident | None:
    """The table's answer where the causes of ``codes`` are there at the same time."""
    state, inputs = LoopState(), SafetyInputs()
    table = tuple(line._replace(evaluate=lambda *_, code=line.code: f"{code}!" if code in codes else "")
                  for line in TABLE)  # fmt: skip
    return evaluate(state, inputs, Wiring(), table, least, at_rest)


def test_of_two_causes_the_first_of_the_table_is_told() -> None:
    codes = [code for code, *_ in LINES]
    for first, second in pairwise(codes):
        incident = told(second, first)
        assert incident == Incident(line_of(first).action, first, f"{first}!")


def test_during_a_retraction_only_what_stops_at_once_counts() -> None:
    assert told("force_limit", least=IMMEDIATE) is None
    assert told("force_limit", "workspace", least=IMMEDIATE) == Incident(IMMEDIATE, "workspace", "workspace!")


def test_at_rest_only_the_lines_made_for_it_are_looked_at() -> None:
    for code, action, _, at_rest in LINES:
        incident = told(code, at_rest=True)
        assert incident == (Incident(action, code, f"{code}!") if at_rest else None)


def test_nothing_is_told_of_a_bench_that_is_well() -> None:
    assert told() is None


def test_what_the_table_looks_at_is_well_until_the_loop_says_otherwise() -> None:
    inputs = SafetyInputs()
    assert inputs == SafetyInputs(
        mode=Mode.IDLE, force_lost="", axis_lost="", marker_lost="", drive_fault="", force_valid=True,
        force_frozen=False, touch_wrong="", contact_lost="", oscillation="", force_age_ms=0.0,
        axis_age_ms=0.0, marker_age_ms=0.0, limb_age_ms=0.0, late_ms=0.0,
        recorder_fill=0.0, recorder_silent_s=0.0, stop_silent_s=0.0,
        supervisor_lost=False, operator_silent_s=0.0, requests=frozenset(),
    )  # fmt: skip
