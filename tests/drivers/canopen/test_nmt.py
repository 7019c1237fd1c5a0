"""The small messages, byte by byte (CiA 301, 7.2.8 and 7.2.7)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.can.slcan import CanFrame
from drivers.canopen.nmt import (
    SYNC,
    Emergency,
    NmtCommand,
    NmtState,
    decode_emergency,
    decode_heartbeat,
    encode_heartbeat,
    encode_nmt,
)


def test_sync_is_an_empty_frame() -> None:
    assert (SYNC.can_id, SYNC.data) == (0x080, b"")


@pytest.mark.parametrize(
    ("command", "data"),
    [
        (NmtCommand.START, "01 05"),
        (NmtCommand.STOP, "02 05"),
        (NmtCommand.ENTER_PRE_OPERATIONAL, "80 05"),
        (NmtCommand.RESET_NODE, "81 05"),
        (NmtCommand.RESET_COMMUNICATION, "82 05"),
    ],
)
def test_orders_name_command_and_node(command: NmtCommand, data: str) -> None:
    assert encode_nmt(command, 5) == CanFrame(0x000, bytes.fromhex(data))


@pytest.mark.parametrize(
    ("byte", "state"),
    [
        (0x00, NmtState.BOOT_UP),
        (0x04, NmtState.STOPPED),
        (0x05, NmtState.OPERATIONAL),
        (0x7F, NmtState.PRE_OPERATIONAL),
        (0x85, NmtState.OPERATIONAL),
    ],
)
def test_heartbeats_say_the_state(byte: int, state: NmtState) -> None:
    assert decode_heartbeat(bytes((byte,))) is state


def test_the_hosts_own_heartbeat() -> None:
    assert encode_heartbeat(127, NmtState.OPERATIONAL) == CanFrame(0x77F, b"\x05")


@pytest.mark.parametrize("data", [b"", b"\x05\x05", b"\x01", b"\x7e"])
def test_what_is_no_heartbeat_is_none(data: bytes) -> None:
    assert decode_heartbeat(data) is None


def test_an_emergency_carries_code_register_and_five_bytes() -> None:
    data = bytes.fromhex("11 86 80 01 02 03 04 05")
    emergency = Emergency(0x8611, 0x80, bytes((1, 2, 3, 4, 5)))
    assert decode_emergency(data) == emergency


@given(data=st.binary(max_size=8))
def test_emergencies_of_other_lengths_are_none(data: bytes) -> None:
    assert (decode_emergency(data) is None) == (len(data) != 8)
