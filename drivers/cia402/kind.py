"""A drive known by its data sheet: what is asked of it, what it is told, and what its second PDO says."""

import struct
from functools import cached_property

from drivers.canopen.nmt import RPDO_IDS, TPDO_IDS
from drivers.cia402 import units
from drivers.cia402.eds import DataSheet
from drivers.epos4 import objects, setup
from drivers.epos4.bringup import CYCLIC_POSITION, HOMING, PROFILE_POSITION
from drivers.epos4.codec import DriveMotion, PdoMap, Units
from drivers.epos4.node import Node
from drivers.epos4.objects import I16, NO_RTR, TEXT, U16, U32, Entry
from drivers.roles import Identity
from rig.config.products.cia402 import Cia402Wiring
from rig.config.wiring import Limits
from rig.errors import DeviceError, UsageError

MODES = {PROFILE_POSITION: "profile position", HOMING: "homing", CYCLIC_POSITION: "cyclic synchronous position"}
RATED_CURRENT = Entry(0x6075, 0, "motor rated current", U32, "rw")
MAX_CURRENT = Entry(0x6073, 0, "largest current", U16, "rw")
CURRENT = Entry(0x6078, 0, "current actual", I16, "ro+")
TORQUE = Entry(0x6077, 0, "torque actual", I16, "ro+")
# Without one of these the axis cannot be moved, watched or stopped by what this driver does.
NEEDED = (
    objects.CONTROLWORD, objects.STATUSWORD, objects.MODE, objects.MODE_DISPLAY, objects.POSITION, objects.VELOCITY,
    objects.TARGET, objects.PROFILE_VELOCITY, objects.PROFILE_ACCELERATION, objects.HOMING_METHOD,
    objects.HOMING_SPEED_SWITCH, objects.HOMING_SPEED_ZERO, objects.SUPPORTED_MODES, objects.LIMIT_LOW,
    objects.LIMIT_HIGH, objects.HEARTBEAT_PRODUCER, objects.HEARTBEAT_CONSUMER, objects.ABORT_OPTION, objects.VENDOR,
    objects.ERROR_REGISTER,
)  # fmt: skip
LONGEST_TURN_MM = 10.0  # lead of the screws of small axes, where nothing states it: homing may take so much longer
STANDSTILL_MM_S = 0.1  # an encoder of 10 um that flickers between two lines at 10 Hz
PDOS = range(1, 4)


def check_sheet(sheet: DataSheet, where: str) -> None:
    """Raises UsageError where the data sheet lacks a needed object, or has it as another type."""
    missing = [entry for entry in NEEDED if (entry.index, entry.sub) not in sheet.objects]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise UsageError(
            f"{where}: lacks {missing[0]}{more}, which an axis of this bench needs; it is no CiA 402 servo drive with "
            "cyclic positions, limits and heartbeat"
        )
    for entry in NEEDED:
        kind = sheet.objects[entry.index, entry.sub].kind
        if kind != entry.kind:
            raise UsageError(f"{where}: {entry} is of another type than CiA 402 gives it; check the data sheet")


class SheetKind:
    """The drive of ``sheet``; ``scale`` is known after ``identify``."""

    scale: Units

    def __init__(self, config: Cia402Wiring, sheet: DataSheet) -> None:
        self._config, self._sheet = config, sheet
        self._rated_mA = 0
        self.referenced_bit = 1 << config.referenced_bit if config.referenced_bit >= 0 else 0

    @property
    def turn_mm(self) -> float:
        """Travel of one turn, as far as it is stated."""
        config = self._config
        return config.lead_mm or config.increments_per_rev / self.scale.increments_per_mm or LONGEST_TURN_MM

    @property
    def standstill(self) -> int:
        """Speed, in the drive's unit, below which it stands."""
        return self.scale.rpm(STANDSTILL_MM_S)

    def has(self, entry: Entry) -> bool:
        """Whether the data sheet lists the object."""
        return (entry.index, entry.sub) in self._sheet.objects

    def identify(self, node: Node) -> Identity:
        """Who it is; raises DeviceError where that is not the data sheet's drive, or it lacks a mode or a scale."""
        vendor, product = node.probe(objects.VENDOR), self._asked(node, objects.PRODUCT)
        self._check_identity(node, vendor, product)
        modes = node.read(objects.SUPPORTED_MODES)
        lacking = [f"{mode} ({words})" for mode, words in MODES.items() if not modes >> (mode - 1) & 1]
        if lacking:
            raise DeviceError(f"{node.name}: lacks modes {', '.join(lacking)} (object 6502 is {modes:#x})")
        found = units.position_scale(node, self._config, self.has)
        speed_unit = units.speed_unit(node, self._config, self.has, found.per_mm)
        self.scale = Units(found.per_mm, 60 * speed_unit, self._config.direction)
        self._rated_mA = self._asked(node, RATED_CURRENT)
        return Identity(
            product=f"{self._name(node)} {product:08X}",
            serial=f"{self._asked(node, objects.SERIAL):08X}",
            firmware=f"{self._asked(node, objects.REVISION) >> 16:04X}",
            settings={
                "node": str(node.number),
                "modes": f"{modes:#x}",
                "vendor": f"{vendor:#x}",
                "increments_per_mm": repr(found.per_mm),
                "scale": str(found),
            },
        )

    def agree(self, node: Node) -> str:  # noqa: ARG002 - the signature of a kind
        """Its factors were compared when it was identified."""
        return ""

    def _check_identity(self, node: Node, vendor: int, product: int) -> None:
        said = (self._sheet.vendor or vendor, self._sheet.product or product)
        if (vendor, product) != said:
            raise DeviceError(
                f"{node.name}: its identity (object 1018) is vendor {vendor:#x}, product {product:#010x}, the data "
                f"sheet's {said[0]:#x}, {said[1]:#010x}; check axis.eds, axis.port and axis.node"
            )

    def _name(self, node: Node) -> str:
        named = self._sheet.objects.get((objects.DEVICE_NAME.index, 0))
        return node.read_text(objects.DEVICE_NAME) if named and named.kind == TEXT else self._sheet.name

    def _asked(self, node: Node, entry: Entry) -> int:
        return node.read(entry) if self.has(entry) else 0

    def writes(self, limits: Limits) -> list[tuple[Entry, int]]:
        """Limits, stops, heartbeats and PDOs, as far as the data sheet lists the objects."""
        parameters = [
            (entry, value)
            for entry, value in setup.parameters(self._config, limits, self.scale)
            if self.has(entry) and entry not in (objects.CURRENT_LIMIT, objects.INTERPOLATION)
        ]
        if self.has(MAX_CURRENT) and self._rated_mA:
            parameters.insert(0, (MAX_CURRENT, round(self._config.current_limit_A * 1e6 / self._rated_mA)))
        return parameters + [write for pdo in self._pdos() for write in pdo.writes() if self.has(write[0])]

    def _pdos(self) -> list[PdoMap]:
        node = self._config.node
        motion = (objects.VELOCITY, self._current) if self._current else (objects.VELOCITY,)
        used = [
            PdoMap(0x1400, RPDO_IDS[0] + node, (objects.CONTROLWORD, objects.TARGET)),
            PdoMap(0x1800, TPDO_IDS[0] + node | NO_RTR, (objects.STATUSWORD, objects.POSITION)),
            PdoMap(0x1801, TPDO_IDS[1] + node | NO_RTR, motion),
        ]
        unused = [PdoMap(0x1400 + number, RPDO_IDS[number] + node, ()) for number in PDOS]
        return used + unused + [PdoMap(0x1800 + number, TPDO_IDS[number] + node | NO_RTR, ()) for number in (2, 3)]

    @cached_property
    def _current(self) -> Entry | None:
        return next((entry for entry in (CURRENT, TORQUE) if self.has(entry)), None)

    @cached_property
    def _motion(self) -> struct.Struct:
        return struct.Struct("<ih" if self._current else "<i")

    def decode_motion(self, data: bytes) -> DriveMotion | None:
        """TPDO2: speed, and the current in thousandths of the rated one; None where the length is wrong."""
        if len(data) != self._motion.size:
            return None
        speed, *per_mille = self._motion.unpack(data)
        return DriveMotion(speed, round(per_mille[0] * self._rated_mA / 1000) if per_mille else 0)
