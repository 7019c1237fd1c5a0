"""The drive's object table as data: what each object is called, its type, access, default, range and mapping.

Gathered from public tables of EPOS4 clients and CiA 301/402; position in increments, velocity in rpm, acceleration in
rpm/s, current in mA, torque in 1/1000 of object 6076. ``rw+`` may be received in a PDO, ``ro+`` may be sent in one.
"""

import struct
from dataclasses import dataclass
from typing import Literal

U8, U16, U32, I8, I16, I32, TEXT = "B", "H", "I", "b", "h", "i", "s"
Access = Literal["ro", "ro+", "rw", "rw+", "const", "wo"]
# Ranges of INTEGER32 and UNSIGNED32 (CiA 301).
I32_MIN, I32_MAX, U32_MAX = -(1 << 31), (1 << 31) - 1, (1 << 32) - 1


@dataclass(frozen=True)
class Entry:
    """One object, or one sub-object of a record; the node's number is added to the default where ``by_node``."""

    index: int
    sub: int
    name: str
    kind: str
    access: Access
    default: int | str = 0
    low: int | None = None
    high: int | None = None
    by_node: bool = False

    @property
    def size(self) -> int:
        """Bytes of the value; 0 for text."""
        return 0 if self.kind == TEXT else struct.calcsize(self.kind)

    def pack(self, value: int) -> bytes:
        """The value as it goes over the wire; raises ValueError where it does not fit."""
        try:
            return struct.pack("<" + self.kind, value)
        except struct.error as error:
            raise ValueError(f"{self}: {value} does not fit its type") from error

    def unpack(self, data: bytes) -> int | None:
        """The value in ``data``; None where the length is wrong."""
        return int(struct.unpack("<" + self.kind, data)[0]) if len(data) == self.size else None

    def __str__(self) -> str:
        return f"object {self.index:04X}:{self.sub:02X} ({self.name})"


ERROR_REGISTER = Entry(0x1001, 0, "error register", U8, "ro+")
DEVICE_NAME = Entry(0x1008, 0, "device name", TEXT, "const", "EPOS4")
ERROR_COUNT = Entry(0x1003, 0, "number of errors", U8, "rw", 0, 0, 0)
ERROR_HISTORY = tuple(Entry(0x1003, sub, f"error history {sub}", U32, "ro") for sub in range(1, 6))
"""The newest first; the lower half of a value is the error code (CiA 301, object 1003)."""
HEARTBEAT_CONSUMER = Entry(0x1016, 1, "consumer heartbeat time 1", U32, "rw")
HEARTBEAT_PRODUCER = Entry(0x1017, 0, "producer heartbeat time", U16, "rw")
VENDOR = Entry(0x1018, 1, "vendor", U32, "ro", 0xFB)
PRODUCT = Entry(0x1018, 2, "product", U32, "ro", 0x6150_0000)
REVISION = Entry(0x1018, 3, "revision", U32, "ro", 0x0170_0000)
SERIAL = Entry(0x1018, 4, "serial number", U32, "ro", 0x6201_4711)
SENSOR_RESOLUTION = Entry(0x3000, 5, "main sensor resolution", U32, "ro")
CURRENT_LIMIT = Entry(0x3001, 2, "output current limit", U32, "rw", 10_000)
CURRENT_AVERAGED = Entry(0x30D1, 1, "current averaged", I32, "ro+")
CURRENT_ACTUAL = Entry(0x30D1, 2, "current", I32, "ro+")
ABORT_OPTION = Entry(0x6007, 0, "abort connection option code", I16, "rw", 3, 2, 3)
ERROR_CODE = Entry(0x603F, 0, "error code", U16, "ro+")
CONTROLWORD = Entry(0x6040, 0, "controlword", U16, "rw+")
STATUSWORD = Entry(0x6041, 0, "statusword", U16, "ro+")
QUICK_STOP_OPTION = Entry(0x605A, 0, "quick stop option code", I16, "rw", 6, 6, 6)
SHUTDOWN_OPTION = Entry(0x605B, 0, "shutdown option code", I16, "rw", 0, 0, 1)
DISABLE_OPTION = Entry(0x605C, 0, "disable operation option code", I16, "rw", 1, 0, 1)
FAULT_OPTION = Entry(0x605E, 0, "fault reaction option code", I16, "rw", 2, 0, 2)
MODE = Entry(0x6060, 0, "mode of operation", I8, "rw+", 1)
MODE_DISPLAY = Entry(0x6061, 0, "mode of operation display", I8, "ro+", 1)
DEMAND = Entry(0x6062, 0, "position demand", I32, "ro+")
POSITION = Entry(0x6064, 0, "position actual", I32, "ro+")
FOLLOWING_WINDOW = Entry(0x6065, 0, "following error window", U32, "rw", 2000)
VELOCITY = Entry(0x606C, 0, "velocity actual", I32, "ro+")
TARGET = Entry(0x607A, 0, "target position", I32, "rw+")
LIMIT_LOW = Entry(0x607D, 1, "software position limit, minimum", I32, "rw", I32_MIN)
LIMIT_HIGH = Entry(0x607D, 2, "software position limit, maximum", I32, "rw", I32_MAX)
MAX_PROFILE_VELOCITY = Entry(0x607F, 0, "maximal profile velocity", U32, "rw", 50_000, 1)
PROFILE_VELOCITY = Entry(0x6081, 0, "profile velocity", U32, "rw+", 1000, 1)
PROFILE_ACCELERATION = Entry(0x6083, 0, "profile acceleration", U32, "rw+", 10_000, 1)
PROFILE_DECELERATION = Entry(0x6084, 0, "profile deceleration", U32, "rw+", 10_000, 1)
QUICK_STOP_DECELERATION = Entry(0x6085, 0, "quick stop deceleration", U32, "rw", 10_000, 1)
HOMING_METHOD = Entry(0x6098, 0, "homing method", I8, "rw", 7, -4, 37)
HOMING_SPEED_SWITCH = Entry(0x6099, 1, "homing speed for switch search", U32, "rw", 100, 1)
HOMING_SPEED_ZERO = Entry(0x6099, 2, "homing speed for zero search", U32, "rw", 10, 1)
HOMING_ACCELERATION = Entry(0x609A, 0, "homing acceleration", U32, "rw", 1000, 1)
INTERPOLATION = Entry(0x60C2, 1, "interpolation time period", U8, "rw", 0, 0, 100)
TARGET_VELOCITY = Entry(0x60FF, 0, "target velocity", I32, "rw+")
SUPPORTED_MODES = Entry(0x6502, 0, "supported modes", U32, "ro", 0x3A5)
HOMING_METHODS = (-4, -3, -2, -1, 1, 2, 7, 11, 17, 18, 23, 27, 33, 34, 37)

MAX_MAPPED = 12  # sub-indices of a mapping in the maker's electronic data sheet
DISABLED = 1 << 31
NO_RTR = 1 << 30
RPDO_DEFAULTS = ((CONTROLWORD,), (CONTROLWORD, MODE), (CONTROLWORD, TARGET), (CONTROLWORD, TARGET_VELOCITY))
TPDO_DEFAULTS = ((STATUSWORD,), (STATUSWORD, MODE_DISPLAY), (STATUSWORD, POSITION), (STATUSWORD, VELOCITY))


def mapping(entry: Entry) -> int:
    """How a PDO's mapping names the object: index, sub-index, length in bits."""
    return entry.index << 16 | entry.sub << 8 | entry.size * 8


def _pdo(parameters: int, name: str, cob_id: int, mapped: tuple[Entry, ...], inhibit: bool) -> list[Entry]:
    entries = [mapping(entry) for entry in mapped] + [0] * (MAX_MAPPED - len(mapped))
    mappings = parameters + 0x200
    return [
        Entry(parameters, 0, f"{name} entries", U8, "const", 3 if inhibit else 2),
        Entry(parameters, 1, f"{name} identifier", U32, "rw", cob_id, by_node=True),
        Entry(parameters, 2, f"{name} transmission type", U8, "rw", 255),
        *([Entry(parameters, 3, f"{name} inhibit time", U16, "rw", 10)] if inhibit else []),
        Entry(mappings, 0, f"{name} mapped objects", U8, "rw", len(mapped), 0, MAX_MAPPED),
        *(
            Entry(mappings, sub, f"{name} mapped object {sub}", U32, "rw", entry)
            for sub, entry in enumerate(entries, start=1)
        ),
    ]


def _pdos() -> list[Entry]:
    table: list[Entry] = []
    for number in range(4):
        table += _pdo(0x1400 + number, f"RPDO{number + 1}", 0x200 + 0x100 * number, RPDO_DEFAULTS[number], False)
        cob_id = 0x180 + 0x100 * number + NO_RTR + (DISABLED if number else 0)
        table += _pdo(0x1800 + number, f"TPDO{number + 1}", cob_id, TPDO_DEFAULTS[number], True)
    return table


_NAMED = (
    ERROR_REGISTER, ERROR_COUNT, *ERROR_HISTORY, DEVICE_NAME, HEARTBEAT_CONSUMER, HEARTBEAT_PRODUCER,
    VENDOR, PRODUCT, REVISION, SERIAL,
    SENSOR_RESOLUTION, CURRENT_LIMIT, CURRENT_AVERAGED, CURRENT_ACTUAL, ABORT_OPTION, ERROR_CODE,
    CONTROLWORD, STATUSWORD,
    QUICK_STOP_OPTION, SHUTDOWN_OPTION, DISABLE_OPTION, FAULT_OPTION, MODE, MODE_DISPLAY, DEMAND, POSITION,
    FOLLOWING_WINDOW, VELOCITY, TARGET, LIMIT_LOW, LIMIT_HIGH, MAX_PROFILE_VELOCITY, PROFILE_VELOCITY,
    PROFILE_ACCELERATION, PROFILE_DECELERATION, QUICK_STOP_DECELERATION, HOMING_METHOD, HOMING_SPEED_SWITCH,
    HOMING_SPEED_ZERO, HOMING_ACCELERATION, INTERPOLATION, TARGET_VELOCITY, SUPPORTED_MODES,
)  # fmt: skip
OBJECTS: dict[tuple[int, int], Entry] = {
    (entry.index, entry.sub): entry for entry in sorted([*_NAMED, *_pdos()], key=lambda entry: (entry.index, entry.sub))
}
"""Every object the drive is asked for, by index and sub-index."""
