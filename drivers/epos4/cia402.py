"""The CiA 402 state machine of a drive: how to read its state, and which controlword leads on towards a goal.

Patterns and transitions: CiA 402-2, as the EPOS4 implements them (the quick stop stays in its state, and enable
operation leads out of it). Nothing here ever resets a fault on its own: that is an order of its own, given by a person.
"""

from enum import Enum, IntEnum

STATE_MASK = 0x6F
SHORT_MASK = 0x4F


class State(Enum):
    """States of the drive; UNKNOWN is a pattern that none of them has."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    ENABLED = "operation enabled"
    QUICK_STOP = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"
    UNKNOWN = "unknown"


class Goal(Enum):
    """Where a walk is to end."""

    ENABLED = "operation enabled"
    STOPPED = "stopped by the quick stop ramp"
    DISABLED = "without torque"


class Control(IntEnum):
    """Controlwords, and the bits that modes add to them; combining them gives a plain integer."""

    DISABLE_VOLTAGE = 0x00
    SHUTDOWN = 0x06
    SWITCH_ON = 0x07
    ENABLE_OPERATION = 0x0F
    QUICK_STOP = 0x0B
    FAULT_RESET = 0x80
    START = 0x10
    IMMEDIATELY = 0x20
    RELATIVE = 0x40
    HALT = 0x100


class Status(IntEnum):
    """Statusword bits beside the state; the meaning of bits 10, 12 and 13 is the mode's."""

    FAULT = 0x08
    VOLTAGE = 0x10
    WARNING = 0x80
    REMOTE = 0x200
    TARGET_REACHED = 0x400
    INTERNAL_LIMIT = 0x800
    ACKNOWLEDGE = 0x1000
    MODE_ERROR = 0x2000
    REFERENCED = 0x8000


STATE_WORDS = {
    State.NOT_READY: 0x00,
    State.SWITCH_ON_DISABLED: 0x40,
    State.READY: 0x21,
    State.SWITCHED_ON: 0x23,
    State.ENABLED: 0x27,
    State.QUICK_STOP: 0x07,
    State.FAULT_REACTION: 0x0F,
    State.FAULT: 0x08,
}
_LONG = {word: state for state, word in STATE_WORDS.items() if word & 0x20 or state is State.QUICK_STOP}
_SHORT = {word: state for state, word in STATE_WORDS.items() if state not in _LONG.values()}

_WALK: dict[Goal, dict[State, int]] = {
    Goal.ENABLED: {
        State.SWITCH_ON_DISABLED: Control.SHUTDOWN,
        State.READY: Control.SWITCH_ON,
        State.SWITCHED_ON: Control.ENABLE_OPERATION,
        State.ENABLED: Control.ENABLE_OPERATION,
        State.QUICK_STOP: Control.ENABLE_OPERATION,
    },
    Goal.STOPPED: {
        State.ENABLED: Control.QUICK_STOP,
        State.QUICK_STOP: Control.QUICK_STOP,
    },
    Goal.DISABLED: {
        State.ENABLED: Control.SWITCH_ON,
    },
}
_AT = {
    Goal.ENABLED: {State.ENABLED},
    Goal.STOPPED: {State.QUICK_STOP, State.SWITCH_ON_DISABLED, State.READY, State.SWITCHED_ON, State.FAULT},
    Goal.DISABLED: {State.SWITCH_ON_DISABLED, State.FAULT},
}


def decode_state(status: int) -> State:
    """The state in a statusword."""
    return _LONG.get(status & STATE_MASK) or _SHORT.get(status & SHORT_MASK, State.UNKNOWN)


def next_controlword(status: int, goal: Goal) -> int:
    """The controlword to send next; where nothing leads on, the one that takes the torque away."""
    return int(_WALK[goal].get(decode_state(status), Control.DISABLE_VOLTAGE))


def reached(status: int, goal: Goal) -> bool:
    """Whether the walk is over. A drive in fault has no torque, so it is stopped and disabled."""
    return decode_state(status) in _AT[goal]


def obstacle(status: int, goal: Goal) -> str:
    """Why no controlword leads from here to ``goal``; empty where one does, or where waiting does."""
    state = decode_state(status)
    if goal is Goal.ENABLED and state is State.FAULT:
        return "the drive is in fault; remove the cause and reset the fault"
    if state is State.UNKNOWN:
        return f"statusword {status:#06x} has the pattern of no state"
    return ""
