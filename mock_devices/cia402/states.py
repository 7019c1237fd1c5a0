"""The state machine of a CiA 402 drive as the drive has it: what each command of a controlword does in each state."""

from drivers.epos4.cia402 import PdsState

OFF, SHUTDOWN, SWITCH_ON, ENABLE, STOP = range(5)
TRANSITIONS = {
    (PdsState.SWITCH_ON_DISABLED, SHUTDOWN): PdsState.READY,
    (PdsState.READY, SWITCH_ON): PdsState.SWITCHED_ON,
    (PdsState.READY, ENABLE): PdsState.SWITCHED_ON,
    (PdsState.READY, OFF): PdsState.SWITCH_ON_DISABLED,
    (PdsState.READY, STOP): PdsState.SWITCH_ON_DISABLED,
    (PdsState.SWITCHED_ON, ENABLE): PdsState.ENABLED,
    (PdsState.SWITCHED_ON, SHUTDOWN): PdsState.READY,
    (PdsState.SWITCHED_ON, OFF): PdsState.SWITCH_ON_DISABLED,
    (PdsState.SWITCHED_ON, STOP): PdsState.SWITCH_ON_DISABLED,
    (PdsState.ENABLED, SWITCH_ON): PdsState.SWITCHED_ON,
    (PdsState.ENABLED, SHUTDOWN): PdsState.READY,
    (PdsState.ENABLED, OFF): PdsState.SWITCH_ON_DISABLED,
    (PdsState.ENABLED, STOP): PdsState.QUICK_STOP,
    (PdsState.QUICK_STOP, ENABLE): PdsState.ENABLED,
    (PdsState.QUICK_STOP, OFF): PdsState.SWITCH_ON_DISABLED,
}


def command_of(word: int) -> int:
    """The state machine's command in a controlword without fault reset (CiA 402)."""
    if not word & 0x02:
        return OFF
    if not word & 0x04:
        return STOP
    if not word & 0x01:
        return SHUTDOWN
    return ENABLE if word & 0x08 else SWITCH_ON
