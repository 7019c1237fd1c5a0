"""Units of a CiA 402 drive: what it says of them itself, and from increments and speed units to mm and back."""

from collections.abc import Callable

from drivers.epos4.codec import Units
from drivers.epos4.node import Node
from drivers.epos4.objects import U32, Entry
from rig.config.products.cia402 import Cia402Wiring
from rig.errors import DeviceError

FEED, FEED_TURNS = Entry(0x6092, 1, "feed", U32, "rw"), Entry(0x6092, 2, "driving shaft revolutions", U32, "rw")
ENCODER, ENCODER_TURNS = Entry(0x608F, 1, "encoder increments", U32, "rw"), Entry(0x608F, 2, "motor turns", U32, "rw")
GEAR, GEAR_TURNS = Entry(0x6091, 1, "motor revolutions", U32, "rw"), Entry(0x6091, 2, "shaft revolutions", U32, "rw")
SI_UNIT_VELOCITY = Entry(0x60A9, 0, "SI unit velocity", U32, "rw")
# CiA 303-2: revolutions, minutes; bytes of object 60A9 from the highest: prefix, numerator, denominator.
REVOLUTIONS, MINUTES = 0xB4, 0x47
# Two whole numbers of five digits give a ratio to 2e-5; more is another lead or gear.
SCALE_TOLERANCE = 1e-3
Has = Callable[[Entry], bool]


def units_per_turn(node: Node, has: Has) -> float:
    """Position units for one turn of the driving shaft by the drive's factors; 0 where it has none of them."""
    if has(FEED):
        return _ratio(node, FEED, FEED_TURNS, has)
    if has(ENCODER):
        gear = _ratio(node, GEAR, GEAR_TURNS, has) if has(GEAR) else 1.0
        return _ratio(node, ENCODER, ENCODER_TURNS, has) * gear
    return 0.0


def _ratio(node: Node, above: Entry, below: Entry, has: Has) -> float:
    divisor = node.read(below) if has(below) else 1
    if not divisor:
        raise DeviceError(f"{node.name}: {below} is 0, and nothing can be divided by it; set up its factors")
    return node.read(above) / divisor


def check_scale(node: Node, config: Cia402Wiring, has: Has) -> None:
    """Raises DeviceError where the drive's own factors say another scale than ``increments_per_mm``."""
    per_turn = units_per_turn(node, has) if config.lead_mm else 0.0
    if not per_turn:
        return
    found = per_turn / config.lead_mm
    if abs(found / config.increments_per_mm - 1) > SCALE_TOLERANCE:
        raise DeviceError(
            f"{node.name}: by its own factors (objects 6092, 608F, 6091) {per_turn:g} units are one turn, with "
            f"axis.lead_mm {config.lead_mm:g} that is {found:g} a mm, where axis.increments_per_mm is "
            f"{config.increments_per_mm:g}; correct whichever is wrong"
        )


def scale_of(config: Cia402Wiring, speed_unit: float) -> Units:
    """Scale of a drive whose unit of speed is ``speed_unit`` position units a second."""
    return Units(config.increments_per_mm, 60 * speed_unit, config.direction)


def speed_unit(node: Node, config: Cia402Wiring, has: Has) -> float:
    """The drive's unit of speed in position units a second; raises DeviceError where it names one unknown here."""
    if config.speed_unit == "rpm":
        return config.increments_per_rev / 60
    if config.speed_unit == "units/s" or not has(SI_UNIT_VELOCITY):
        return 1.0
    said = node.read(SI_UNIT_VELOCITY)
    prefix, numerator, denominator = said >> 24, said >> 16 & 0xFF, said >> 8 & 0xFF
    exponent = prefix - 256 if prefix > 127 else prefix
    if (numerator, denominator) == (REVOLUTIONS, MINUTES):
        return float(config.increments_per_rev / 60 * 10.0**exponent)
    if said:
        raise DeviceError(
            f"{node.name}: its unit of speed (object 60A9 is {said:#010x}) is not rpm; say axis.speed_unit units/s or "
            "rpm, whichever its manual names"
        )
    return 1.0
