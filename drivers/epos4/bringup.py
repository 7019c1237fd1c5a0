"""Bringing a drive up: who it is, its limits and PDOs written and read back, and the step to operational."""

from collections.abc import Callable
from functools import partial

from drivers.canopen.nmt import NmtCommand, NmtState
from drivers.epos4 import objects, setup
from drivers.epos4.node import TRIES, Node
from drivers.epos4.objects import Entry
from drivers.roles import Identity
from rig.config.products.can_axis import CanAxisProduct
from rig.errors import DeviceError

VENDOR, PRODUCT_FAMILY = 0xFB, 0x6150
PROFILE_POSITION, HOMING, CYCLIC_POSITION = 1, 6, 8
NEEDED_MODES = (PROFILE_POSITION, HOMING, CYCLIC_POSITION)
START_S = 1.0


def identify(node: Node) -> Identity:
    """Who the node says it is; raises DeviceError where it is silent, no EPOS4, or without a mode that is needed."""
    vendor = reread(lambda: node.probe(objects.VENDOR), lambda value: value == VENDOR)
    product = reread(lambda: node.read(objects.PRODUCT), lambda value: value >> 16 == PRODUCT_FAMILY)
    if vendor != VENDOR or product >> 16 != PRODUCT_FAMILY:
        raise DeviceError(
            f"{node.name}: is not a maxon EPOS4: its identity (object 1018) is vendor {vendor:#x}, product "
            f"{product:#010x} instead of 0xfb, 0x6150xxxx; check axis.port and axis.node"
        )
    modes = reread(lambda: node.read(objects.SUPPORTED_MODES), lambda value: not _missing(value))
    if missing := _missing(modes):
        raise DeviceError(f"{node.name}: lacks modes {missing} (object 6502 is {modes:#x}); update its firmware")
    return Identity(
        product=f"maxon {node.read_text(objects.DEVICE_NAME)} {product:08X}",
        serial=f"{node.read(objects.SERIAL):08X}",
        firmware=f"{node.read(objects.REVISION) >> 16:04X}",
        settings={"node": str(node.number), "modes": f"{modes:#x}"},
    )


def configure(node: Node, writes: list[tuple[Entry, int]]) -> None:
    """Writes all of it, then reads it back; raises DeviceError where a value differs."""
    for entry, value in writes:
        node.write(entry, value)
    for entry, value in setup.expected(writes).items():
        got = reread(partial(node.read, entry), partial(setup.agrees, entry, value))
        if not setup.agrees(entry, value, got):
            raise DeviceError(f"{node.name}: {entry} was set to {value} and reads back as {got}; restart the drive")


def go_operational(node: Node, config: CanAxisProduct, now: Callable[[], int]) -> None:
    """Starts the node and waits until its heartbeat says so; raises DeviceError where it does not."""
    node.state = None
    node.order(NmtCommand.START)
    deadline_ns = now() + round(START_S * 1e9) + setup.drive_heartbeat_limit_ns(config)
    while not node.is_in(NmtState.OPERATIONAL):
        left_ns = deadline_ns - now()
        if left_ns <= 0:
            raise DeviceError(f"{node.name}: sends no heartbeat of an operational node; restart the drive")
        node.pump(left_ns / 1e9)


def _missing(modes: int) -> list[int]:
    return [mode for mode in NEEDED_MODES if not modes >> (mode - 1) & 1]


def reread(read: Callable[[], int], expected: Callable[[int], bool]) -> int:
    """A value as read, again where it is not as expected: a line of SLCAN has no checksum, a wrong digit passes."""
    for _ in range(TRIES - 1):
        if expected(value := read()):
            return value
    return read()
