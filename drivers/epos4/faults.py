"""What the drive's error codes mean, and what it does on each (EPOS4 error codes, CiA 301 error register bits)."""

from typing import Literal, NamedTuple


class DriveFault(NamedTuple):
    """One error: words for a person, its bit in object 1001, and which option code decides how the drive stops."""

    text: str
    register: int
    reaction: Literal["off", "abort connection", "fault reaction"]


FAULTS = {
    0x1000: DriveFault("generic error", 0x01, "off"),
    0x2310: DriveFault("overcurrent", 0x02, "off"),
    0x2320: DriveFault("power stage protection", 0x02, "off"),
    0x3210: DriveFault("supply voltage too high", 0x04, "off"),
    0x3220: DriveFault("supply voltage too low", 0x04, "off"),
    0x4210: DriveFault("power stage too hot", 0x08, "off"),
    0x4380: DriveFault("motor too hot", 0x08, "off"),
    0x5113: DriveFault("logic supply too low", 0x04, "off"),
    0x6080: DriveFault("no sign of life", 0x01, "off"),
    0x6320: DriveFault("a parameter is out of range", 0x01, "fault reaction"),
    0x7320: DriveFault("position sensor error", 0x20, "off"),
    0x7380: DriveFault("position sensor breach", 0x20, "off"),
    0x7381: DriveFault("position sensor resolution", 0x20, "off"),
    0x7382: DriveFault("position sensor index", 0x20, "off"),
    0x7388: DriveFault("hall sensor error", 0x20, "off"),
    0x7389: DriveFault("hall sensor not found", 0x20, "off"),
    0x738A: DriveFault("hall angle detection", 0x20, "off"),
    0x8110: DriveFault("CAN overrun, a message was lost", 0x10, "abort connection"),
    0x8111: DriveFault("CAN overrun", 0x10, "abort connection"),
    0x8120: DriveFault("CAN controller in passive mode, check termination and wiring", 0x10, "abort connection"),
    0x8130: DriveFault("the host's heartbeat was missing", 0x10, "abort connection"),
    0x8150: DriveFault("two PDOs share an identifier", 0x10, "abort connection"),
    0x81FD: DriveFault("CAN bus off", 0x10, "abort connection"),
    0x8210: DriveFault("PDO too short", 0x10, "abort connection"),
    0x8250: DriveFault("cyclic set-points were missing", 0x10, "abort connection"),
    0x8611: DriveFault("following error", 0x80, "fault reaction"),
    0x8A80: DriveFault("negative limit switch", 0x80, "fault reaction"),
    0x8A81: DriveFault("positive limit switch", 0x80, "fault reaction"),
    0x8A82: DriveFault("software position limit", 0x80, "fault reaction"),
    0x8A88: DriveFault("safe torque off", 0x01, "off"),
}
UNKNOWN = DriveFault("an error its table does not name", 0x01, "off")


def describe(code: int) -> str:
    """The code and what it means, for a person."""
    return f"0x{code:04X} {FAULTS.get(code, UNKNOWN).text}"
