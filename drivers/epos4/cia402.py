"""The CiA 402 state machine of a drive: how to read its state, and which controlword leads on towards a goal.

Patterns and transitions: CiA 402-2, as the EPOS4 implements them (the quick stop stays in its state, and enable
operation leads out of it). Nothing here ever resets a fault on its own: that is an order of its own, given by a person.
"""

from enum import Enum, IntEnum

STATE_MASK = 0x6F
SHORT_MASK = 0x4F


class PdsState(Enum):
    """States of the power drive system (PDS); UNKNOWN is a pattern that none of them has."""

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


class Controlword(IntEnum):
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


class Statusword(IntEnum):
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
    PdsState.NOT_READY: 0x00,
    PdsState.SWITCH_ON_DISABLED: 0x40,
    PdsState.READY: 0x21,
    PdsState.SWITCHED_ON: 0x23,
    PdsState.ENABLED: 0x27,
    PdsState.QUICK_STOP: 0x07,
    PdsState.FAULT_REACTION: 0x0F,
    PdsState.FAULT: 0x08,
}
_LONG = {word: state for state, word in STATE_WORDS.items() if word & 0x20 or state is PdsState.QUICK_STOP}
_SHORT = {word: state for state, word in STATE_WORDS.items() if state not in _LONG.values()}

_WALK: dict[Goal, dict[PdsState, int]] = {
    Goal.ENABLED: {
        PdsState.SWITCH_ON_DISABLED: Controlword.SHUTDOWN,
        PdsState.READY: Controlword.SWITCH_ON,
        PdsState.SWITCHED_ON: Controlword.ENABLE_OPERATION,
        PdsState.ENABLED: Controlword.ENABLE_OPERATION,
        PdsState.QUICK_STOP: Controlword.ENABLE_OPERATION,
    },
    Goal.STOPPED: {PdsState.ENABLED: Controlword.QUICK_STOP, PdsState.QUICK_STOP: Controlword.QUICK_STOP},
    Goal.DISABLED: {PdsState.ENABLED: Controlword.SWITCH_ON},
}
_AT = {
    Goal.ENABLED: {PdsState.ENABLED},
    Goal.STOPPED: {
        PdsState.QUICK_STOP, PdsState.SWITCH_ON_DISABLED, PdsState.READY, PdsState.SWITCHED_ON, PdsState.FAULT
    },
    Goal.DISABLED: {PdsState.SWITCH_ON_DISABLED, PdsState.FAULT},
}  # fmt: skip


def decode_state(status: int) -> PdsState:
    """The state in a statusword."""
    return _LONG.get(status & STATE_MASK) or _SHORT.get(status & SHORT_MASK, PdsState.UNKNOWN)


def next_controlword(status: int, goal: Goal) -> int:
    """The controlword to send next; where nothing leads on, the one that takes the torque away."""
    return int(_WALK[goal].get(decode_state(status), Controlword.DISABLE_VOLTAGE))


def reached(status: int, goal: Goal) -> bool:
    """Whether the walk is over. A drive in fault has no torque, so it is stopped and disabled."""
    return decode_state(status) in _AT[goal]


def obstacle(status: int, goal: Goal) -> str:
    """Why no controlword leads from here to ``goal``; empty where one does, or where waiting does."""
    state = decode_state(status)
    if goal is Goal.ENABLED and state is PdsState.FAULT:
        return "the drive is in fault; remove the cause and reset the fault"
    if state is PdsState.UNKNOWN:
        return f"statusword {status:#06x} has the pattern of no state"
    return ""
