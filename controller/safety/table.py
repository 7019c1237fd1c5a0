"""One priority table: what stops motion, how, and how soon. First match wins.

IMMEDIATE: the drive stops by its own quick-stop ramp and stays. SOFT: the tip retracts at safe speed, then stays.
Both are latched until acknowledged. At rest (IDLE, SAFE) a soft stop gives way: `controller.safety.giving_way`.
"""

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

from controller.loop.state import LoopState
from controller.safety import checks
from controller.safety.inputs import SafetyInputs
from rig.config.wiring import Wiring


class Action(IntEnum):
    """What an event does, as the level in the event stream."""

    NOTE = 10
    WARNING = 20
    SOFT = 30
    IMMEDIATE = 40


class Incident(NamedTuple):
    """An event that stops motion."""

    action: Action
    code: str
    text: str


class Check(NamedTuple):
    """One line of the table.

    ``evaluate`` gives a sentence, "" where all is well. ``bound_s`` is the longest time from the fault to the reaction
    that is accepted [s]. ``at_rest``: also evaluated in IDLE and SAFE.
    """

    code: str
    action: Action
    evaluate: Callable[[LoopState, SafetyInputs, Wiring], str]
    bound_s: float
    at_rest: bool = False


# One turn of the loop; on a busy computer it may wake loop.overrun_ms (100 ms) late before that is itself a stop.
TURN_S = 0.1
# The oldest sample that any stale limit lets pass (500 ms, a tracker; mock devices: 400 ms), and one turn.
STALE_S = 0.6
# The set-point must go 12 mm ahead (following_error_mm with a mock axis) at 30 mm/s, and one turn.
FOLLOWING_S = 0.5
# Ten reports of an axis that is asked 1000 times a second, 0.3 mm at 1 mm/s, and one turn.
STANDSTILL_S = 0.45
# Two tracker frames of 60 Hz each for six that are averaged, and one turn.
PATIENT_S = 0.3
# RECORDER_SILENT_S, and one turn.
RECORDER_S = checks.RECORDER_SILENT_S + TURN_S
# From the first load: 1 N of the softest tissue (0.1 N/mm) at the 5 mm/s of an approach.
TOUCH_S = 2.0
# Three millimetres of a search at 5 mm/s, and one turn; what vanishes at once is told at once.
CONTACT_S = 0.6 + TURN_S
# From the depth at which tissue is too stiff: half of a press that is made once a second, until it is pressed upon with
# force enough to swing; then six turns of 12 Hz, and one turn of the loop.
OSCILLATION_S = 0.5 + 0.5 + TURN_S
# From the first motion: 2 mm of it at 1 mm/s, and one turn.
SCALE_S = 2.0 + TURN_S
# A needed input names its loss within 1 s and tells it every 0.2 s, or says nothing for 1 s; and one turn.
INPUT_S = 1.2 + TURN_S
# checks.STOP_SILENT_S, and one turn.
STOP_S = checks.STOP_SILENT_S + TURN_S
# The lease of 3 s, and one turn; what says by itself that nobody is there is faster.
OPERATOR_S = 3.0 + TURN_S

TABLE: tuple[Check, ...] = (
    Check("emergency_stop", Action.IMMEDIATE, checks.emergency_stop, TURN_S, at_rest=True),
    Check("drive_fault", Action.IMMEDIATE, checks.drive_fault, TURN_S),
    Check("axis_lost", Action.IMMEDIATE, checks.axis_lost, STALE_S),
    Check("following_error", Action.IMMEDIATE, checks.following_error, FOLLOWING_S),
    Check("axis_frozen", Action.IMMEDIATE, checks.axis_frozen, STANDSTILL_S),
    Check("overspeed", Action.IMMEDIATE, checks.overspeed, TURN_S),
    Check("workspace", Action.IMMEDIATE, checks.workspace, TURN_S),
    Check("force_limit", Action.SOFT, checks.force_limit, TURN_S, at_rest=True),
    Check("torque_limit", Action.SOFT, checks.torque_limit, TURN_S, at_rest=True),
    Check("pushed", Action.SOFT, checks.pushed, TURN_S, at_rest=True),
    Check("pain_stop", Action.SOFT, checks.pain_stop, TURN_S, at_rest=True),
    Check("operator_stop", Action.SOFT, checks.operator_stop, TURN_S, at_rest=True),
    Check("force_lost", Action.SOFT, checks.force_lost, STALE_S),
    Check("force_invalid", Action.SOFT, checks.force_invalid, TURN_S),
    Check("force_rate", Action.SOFT, checks.force_rate, TURN_S, at_rest=True),
    Check("contact_lost", Action.SOFT, checks.contact_lost, CONTACT_S),
    Check("oscillation", Action.SOFT, checks.oscillation, OSCILLATION_S),
    Check("first_touch", Action.SOFT, checks.first_touch, TOUCH_S),
    Check("axis_scale", Action.SOFT, checks.axis_scale, SCALE_S),
    Check("depth_limit", Action.SOFT, checks.depth_limit, TURN_S),
    Check("tracker_lost", Action.SOFT, checks.tracker_lost, STALE_S),
    Check("patient_moved", Action.SOFT, checks.patient_moved, PATIENT_S),
    Check("loop_overrun", Action.SOFT, checks.loop_overrun, TURN_S),
    Check("recorder_stalled", Action.SOFT, checks.recorder_stalled, RECORDER_S),
    Check("stop_lost", Action.SOFT, checks.stop_lost, STOP_S),
    Check("input_lost", Action.SOFT, checks.input_lost, INPUT_S),
    Check("supervisor_lost", Action.SOFT, checks.supervisor_lost, TURN_S),
    Check("operator_silent", Action.SOFT, checks.operator_silent, OPERATOR_S),
)

# Whoever stops motion wants it stopped: nothing that would go on by itself after another stop goes on after these.
BY_PERSON = frozenset({"emergency_stop", "pain_stop", "operator_stop"})


def evaluate(
    state: LoopState,
    inputs: SafetyInputs,
    wiring: Wiring,
    table: tuple[Check, ...] = TABLE,
    least: Action = Action.SOFT,
    at_rest: bool = False,
) -> Incident | None:
    """The first incident of ``table`` at or above ``least``, of the checks made at rest only; None if all is well."""
    for line in table:
        if line.action >= least and (line.at_rest or not at_rest):
            text = line.evaluate(state, inputs, wiring)
            if text:
                return Incident(line.action, line.code, text)
    return None
