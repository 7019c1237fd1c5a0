"""Increments and rpm to mm and back, and the three PDOs the loop exchanges with the drive each SYNC."""

import struct
from dataclasses import dataclass
from typing import NamedTuple

from drivers.canopen.nmt import RPDO_IDS, TPDO_IDS
from drivers.epos4 import objects
from drivers.epos4.objects import DISABLED, NO_RTR, Entry

SYNCHRONOUS = 1
"""Transmission type of every PDO here: applied at, or sent on, each SYNC."""


@dataclass(frozen=True)
class Units:
    """Scale of one axis: ``direction`` is 1 where increments grow into the tissue, else -1."""

    increments_per_mm: float
    increments_per_rev: float
    direction: int = 1

    def increments(self, position_mm: float) -> int:
        """Position in increments, rounded."""
        return self.direction * round(position_mm * self.increments_per_mm)

    def length(self, length_mm: float) -> int:
        """A length or window in increments: never negative, never 0."""
        return max(1, round(abs(length_mm) * self.increments_per_mm))

    def mm(self, increments: int) -> float:
        """Position in mm."""
        return self.direction * increments / self.increments_per_mm

    def rpm(self, speed_mm_s: float) -> int:
        """A speed (or, from mm/s2, an acceleration in rpm/s): never negative, never 0."""
        return max(1, round(abs(speed_mm_s) * self.increments_per_mm * 60 / self.increments_per_rev))

    def mm_s(self, rpm: int) -> float:
        """Velocity in mm/s, positive into the tissue."""
        return self.direction * rpm / 60 * self.increments_per_rev / self.increments_per_mm


_SETPOINT = struct.Struct("<Hi")
_STATE = struct.Struct("<Hi")
_MOTION = struct.Struct("<ii")


class DriveState(NamedTuple):
    """TPDO1: statusword and position."""

    status: int
    increments: int


class DriveMotion(NamedTuple):
    """TPDO2: velocity and motor current."""

    rpm: int
    current_mA: int


def encode_setpoint(controlword: int, increments: int) -> bytes:
    """RPDO1: controlword and target position, 6 bytes."""
    return _SETPOINT.pack(controlword, increments)


def decode_state_pdo(data: bytes) -> DriveState | None:
    """TPDO1; None where the length is wrong."""
    return DriveState._make(_STATE.unpack(data)) if len(data) == _STATE.size else None


def decode_motion_pdo(data: bytes) -> DriveMotion | None:
    """TPDO2; None where the length is wrong."""
    return DriveMotion._make(_MOTION.unpack(data)) if len(data) == _MOTION.size else None


@dataclass(frozen=True)
class PdoMap:
    """One PDO as it is to be configured; ``parameters`` is its communication record, 0x200 below its mapping."""

    parameters: int
    cob_id: int
    mapped: tuple[Entry, ...]

    def writes(self) -> list[tuple[Entry, int]]:
        """Objects and values in the order a drive accepts: off, type, no mapping, mapping, count, on."""
        table = objects.OBJECTS
        identifier = table[self.parameters, 1]
        count = table[self.parameters + 0x200, 0]
        return [
            (identifier, self.cob_id | DISABLED),
            *([(table[self.parameters, 2], SYNCHRONOUS), (count, 0)] if self.mapped else []),
            *(
                (table[self.parameters + 0x200, sub], objects.mapping(entry))
                for sub, entry in enumerate(self.mapped, start=1)
            ),
            *([(count, len(self.mapped)), (identifier, self.cob_id)] if self.mapped else []),
        ]


def pdo_maps(node: int) -> list[PdoMap]:
    """The PDOs of the loop, every other one switched off."""
    used = [
        PdoMap(0x1400, RPDO_IDS[0] + node, (objects.CONTROLWORD, objects.TARGET)),
        PdoMap(0x1800, TPDO_IDS[0] + node | NO_RTR, (objects.STATUSWORD, objects.POSITION)),
        PdoMap(0x1801, TPDO_IDS[1] + node | NO_RTR, (objects.VELOCITY, objects.CURRENT_AVERAGED)),
    ]
    unused = [PdoMap(0x1400 + number, RPDO_IDS[number] + node, ()) for number in (1, 2, 3)]
    unused += [PdoMap(0x1800 + number, TPDO_IDS[number] + node | NO_RTR, ()) for number in (2, 3)]
    return used + unused
