"""What kinds of CiA 402 drive differ in: who they are, what they are told, their units and their second PDO."""

from functools import partial
from typing import Protocol

from drivers.epos4 import objects, setup
from drivers.epos4.bringup import identify, reread
from drivers.epos4.cia402 import Statusword
from drivers.epos4.codec import DriveMotion, Units, decode_motion_pdo
from drivers.epos4.node import Node, NoObject
from drivers.epos4.objects import Entry
from drivers.epos4.walker import STANDSTILL_RPM
from drivers.roles import Identity
from rig.config.products.can_axis import CanAxisProduct
from rig.config.wiring import Limits
from rig.errors import DeviceError


class DriveKind(Protocol):
    """What one kind of CiA 402 drive has of its own; ``referenced_bit`` 0: no bit of the statusword says it."""

    referenced_bit: int

    @property
    def standstill(self) -> int:
        """Speed, in the drive's unit, up to which it stands."""

    @property
    def scale(self) -> Units:
        """Units of position and speed, known after ``identify``."""

    @property
    def turn_mm(self) -> float:
        """Travel of one turn of the screw, known after ``identify``."""

    def identify(self, node: Node) -> Identity:
        """Who the node says it is; raises DeviceError where it is another or lacks what is needed."""

    def agree(self, node: Node) -> str:
        """What of the scale cannot be compared, in words; raises DeviceError where it is another than configured."""

    def writes(self, limits: Limits) -> list[tuple[Entry, int]]:
        """Limits, stops, heartbeats and PDOs, in their order."""

    def decode_motion(self, data: bytes) -> DriveMotion | None:
        """TPDO2; None where the length is wrong."""


class Epos4Kind:
    """A maxon EPOS4."""

    referenced_bit, standstill = int(Statusword.REFERENCED), STANDSTILL_RPM
    identify = staticmethod(identify)
    decode_motion = staticmethod(decode_motion_pdo)

    def __init__(self, config: CanAxisProduct) -> None:
        self._config = config
        self.scale = Units(config.increments_per_mm, config.increments_per_rev, config.direction)
        self.turn_mm = config.increments_per_rev / config.increments_per_mm

    def agree(self, node: Node) -> str:
        """Its increments a turn are those that speeds are computed with, or every speed would be another."""
        stated = self._config.increments_per_rev
        try:
            counted = reread(partial(node.read, objects.SENSOR_RESOLUTION), lambda value: value == stated)
        except NoObject:  # older firmware, which went by what is stated before it was asked
            return f"speeds by axis.increments_per_rev {stated:g}: its firmware has no object 3000:05 to compare"
        if counted != stated:
            raise DeviceError(
                f"{node.name}: counts {counted} increments a turn (object 3000:05) where axis.increments_per_rev says"
                f" {stated:g}: give what its encoder has, four times its lines, or set up the drive"
            )
        return ""

    def writes(self, limits: Limits) -> list[tuple[Entry, int]]:
        """Limits, stops, heartbeats and PDOs, in their order."""
        return setup.parameters(self._config, limits, self.scale) + setup.process_data(self._config)
