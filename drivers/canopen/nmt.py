"""The small messages of CANopen (CiA 301): network management, SYNC, heartbeat, emergency, and identifiers."""

import struct
from enum import IntEnum
from typing import NamedTuple

from drivers.can.slcan import CanFrame

# Identifiers of the predefined connection set (CiA 301); a node's number is added to all but SYNC.
SYNC = CanFrame(0x080)
EMERGENCY_ID = 0x080
TPDO_IDS = (0x180, 0x280, 0x380, 0x480)
RPDO_IDS = (0x200, 0x300, 0x400, 0x500)
SDO_RESPONSE_ID = 0x580
SDO_REQUEST_ID = 0x600
HEARTBEAT_ID = 0x700  # above it no identifier of the set but heartbeats


class NmtCommand(IntEnum):
    """What the network's master may order a node to do."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


class NmtState(IntEnum):
    """What a heartbeat says; BOOT_UP is sent once, after a start or a reset."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class Emergency(NamedTuple):
    """An emergency message; ``code`` 0 says that the error is gone."""

    code: int
    register: int
    detail: bytes


def encode_nmt(command: NmtCommand, node: int) -> CanFrame:
    """The order to ``node``, or to all nodes where it is 0."""
    return CanFrame(0x000, bytes((command, node)))


def encode_heartbeat(node: int, state: NmtState) -> CanFrame:
    """The heartbeat of ``node``."""
    return CanFrame(HEARTBEAT_ID + node, bytes((state,)))


def decode_heartbeat(data: bytes) -> NmtState | None:
    """The state in a heartbeat, its toggle bit masked out; None where it is none."""
    try:
        return NmtState(data[0] & 0x7F) if len(data) == 1 else None
    except ValueError:
        return None


def decode_emergency(data: bytes) -> Emergency | None:
    """The emergency in the 8 bytes; None where there are not 8."""
    return Emergency(*struct.unpack("<HB5s", data)) if len(data) == 8 else None
