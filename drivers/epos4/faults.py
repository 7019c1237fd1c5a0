"""What the drive's error codes mean, and what it does on each (EPOS4 error codes, CiA 301 error register bits)."""

from typing import Literal, NamedTuple


class Fault(NamedTuple):
    """One error: words for a person, its bit in object 1001, and which option code decides how the drive stops."""

    text: str
    register: int
    reaction: Literal["off", "abort connection", "fault reaction"]


FAULTS = {
    0x1000: Fault("generic error", 0x01, "off"),
    0x2310: Fault("overcurrent", 0x02, "off"),
    0x2320: Fault("power stage protection", 0x02, "off"),
    0x3210: Fault("supply voltage too high", 0x04, "off"),
    0x3220: Fault("supply voltage too low", 0x04, "off"),
    0x4210: Fault("power stage too hot", 0x08, "off"),
    0x4380: Fault("motor too hot", 0x08, "off"),
    0x5113: Fault("logic supply too low", 0x04, "off"),
    0x6080: Fault("no sign of life", 0x01, "off"),
    0x6320: Fault("a parameter is out of range", 0x01, "fault reaction"),
    0x7320: Fault("position sensor error", 0x20, "off"),
    0x7380: Fault("position sensor breach", 0x20, "off"),
    0x7381: Fault("position sensor resolution", 0x20, "off"),
    0x7382: Fault("position sensor index", 0x20, "off"),
    0x7388: Fault("hall sensor error", 0x20, "off"),
    0x7389: Fault("hall sensor not found", 0x20, "off"),
    0x738A: Fault("hall angle detection", 0x20, "off"),
    0x8110: Fault("CAN overrun, a message was lost", 0x10, "abort connection"),
    0x8111: Fault("CAN overrun", 0x10, "abort connection"),
    0x8120: Fault("CAN controller in passive mode, check termination and wiring", 0x10, "abort connection"),
    0x8130: Fault("the host's heartbeat was missing", 0x10, "abort connection"),
    0x8150: Fault("two PDOs share an identifier", 0x10, "abort connection"),
    0x81FD: Fault("CAN bus off", 0x10, "abort connection"),
    0x8210: Fault("PDO too short", 0x10, "abort connection"),
    0x8250: Fault("cyclic set-points were missing", 0x10, "abort connection"),
    0x8611: Fault("following error", 0x80, "fault reaction"),
    0x8A80: Fault("negative limit switch", 0x80, "fault reaction"),
    0x8A81: Fault("positive limit switch", 0x80, "fault reaction"),
    0x8A82: Fault("software position limit", 0x80, "fault reaction"),
    0x8A88: Fault("safe torque off", 0x01, "off"),
}
UNKNOWN = Fault("an error its table does not name", 0x01, "off")


def describe(code: int) -> str:
    """The code and what it means, for a person."""
    return f"0x{code:04X} {FAULTS.get(code, UNKNOWN).text}"
