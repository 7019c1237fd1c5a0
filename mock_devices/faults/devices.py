"""What can go wrong inside the devices, by name: each sets one attribute of the mock that plays the device."""

from collections.abc import Mapping

from mock_devices.bota.mock import BotaMock
from mock_devices.epos4.mock import Epos4Mock
from mock_devices.faults.wires import FaultKind, Value, as_number, as_switch, switching
from mock_devices.ndi.mock import NdiMock
from mock_devices.robotiq.mock import RobotiqMock
from rig.errors import UsageError

ASTRAY_LARGEST_MM_S = 500.0  # eight times the fastest axis: more is a slip of the unit


def _whole(value: Value, high: int) -> int:
    return round(as_number(value, 0, high))


def _corrupt(device: BotaMock | RobotiqMock | NdiMock, value: Value) -> None:
    device.corrupt_every = _whole(value, 1_000_000)


def _refuse(sensor: BotaMock, value: Value) -> None:
    if not isinstance(value, str):
        raise UsageError(f"this fault takes the letters of the commands to refuse, not {value!r}")
    sensor.refuse = value


def _missing(tracker: NdiMock, value: Value) -> None:
    tracker.missing = _tools(value)


def _unplugged(tracker: NdiMock, value: Value) -> None:
    tracker.unplugged = _tools(value)


def _tools(value: Value) -> set[int]:
    """No tool for false, the tool of that index otherwise."""
    return set() if value is False else {_whole(value, 23)}


def _error_reply(tracker: NdiMock, value: Value) -> None:
    tracker.error_reply = None if value is False else _whole(value, 0xFF)


def _astray(axis: Epos4Mock, value: Value) -> None:
    axis.lead_astray(as_number(value, -ASTRAY_LARGEST_MM_S, ASTRAY_LARGEST_MM_S))


def _error(axis: Epos4Mock, value: Value) -> None:
    axis.inject_fault(_whole(value, 0xFFFF))


def _restart(device: Epos4Mock | BotaMock, value: Value) -> None:
    if as_switch(value):
        device.restart()


def _lasting_error(axis: Epos4Mock, value: Value) -> None:
    axis.inject_fault(_whole(value, 0xFFFF), lasting=True)


BOTA_FAULTS: Mapping[str, FaultKind[BotaMock]] = {
    "silent": FaultKind("sends nothing", True, switching("silent")),
    "frozen": FaultKind("repeats the last forces under running time", True, switching("frozen")),
    "invalid": FaultKind("flags its measurements as invalid", True, switching("invalid")),
    "wrong_identity": FaultKind("prints another maker's name after a reset", True, switching("wrong_identity")),
    "corrupt_every": FaultKind("spoils the checksum of every n-th frame; 0: none", 10, _corrupt),
    "restart": FaultKind("loses its power for a moment, and boots again", True, _restart),
    "refuse": FaultKind("answers these commands with code 1", "R", _refuse),
}
ROBOTIQ_FAULTS: Mapping[str, FaultKind[RobotiqMock]] = {
    "silent": FaultKind("sends nothing", True, switching("silent")),
    "frozen": FaultKind("repeats the last forces", True, switching("frozen")),
    "invalid": FaultKind("gives the converter's end on all channels", True, switching("invalid")),
    "wrong_identity": FaultKind("has firmware letters that are no force sensor's", True, switching("wrong_identity")),
    "corrupt_every": FaultKind("spoils the checksum of every n-th frame; 0: none", 10, _corrupt),
    "mute_start": FaultKind("starts the stream without answering", True, switching("mute_start")),
    "deaf": FaultKind("streams on whatever comes", True, switching("deaf")),
    "refuse_stream": FaultKind("answers the start of the stream with exception 3", True, switching("refuse_stream")),
}
NDI_FAULTS: Mapping[str, FaultKind[NdiMock]] = {
    "silent": FaultKind("answers nothing", True, switching("silent")),
    "frozen": FaultKind("answers, but the frame number stands still", True, switching("frozen")),
    "corrupt_every": FaultKind("one bit is wrong in every n-th reply; 0: none", 10, _corrupt),
    "missing": FaultKind("the tool of this index is MISSING; false: none", 0, _missing),
    "unplugged": FaultKind("the tool of this index is pulled out of its port; false: none", 0, _unplugged),
    "error_reply": FaultKind("answers TX and BX with this ERROR code; false: none", 0x0D, _error_reply),
}
EPOS4_FAULTS: Mapping[str, FaultKind[Epos4Mock]] = {
    "silent": FaultKind("neither hears nor sends anything", True, switching("silent")),
    "frozen": FaultKind("repeats the position it had", True, switching("frozen")),
    "wrong_identity": FaultKind("has another maker and product", True, switching("wrong_identity")),
    "unguarded": FaultKind("watches neither heartbeats nor its own limits any more", True, switching("unguarded")),
    "astray": FaultKind(
        "its set-points run away from those that were sent at this speed, mm/s; 0: no more", 10.0, _astray
    ),
    "error": FaultKind("this error happens once (0x603F code, for example 0x8611 following error)", 0x8611, _error),
    "restart": FaultKind("loses its power for a moment, and with it reference, limits and torque", True, _restart),
    "lasting_error": FaultKind("this error comes back at each reset; 0: its cause is gone", 0x3210, _lasting_error),
}
