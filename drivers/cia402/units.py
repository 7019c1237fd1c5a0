"""Units of a CiA 402 drive: what it says of them itself, held against what the configuration states."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

from drivers.epos4.node import Node
from drivers.epos4.objects import U32, Entry
from rig.config.products.cia402 import Cia402Wiring
from rig.errors import DeviceError

FEED, FEED_TURNS = Entry(0x6092, 1, "feed", U32, "rw"), Entry(0x6092, 2, "driving shaft revolutions", U32, "rw")
ENCODER, ENCODER_TURNS = Entry(0x608F, 1, "encoder increments", U32, "rw"), Entry(0x608F, 2, "motor turns", U32, "rw")
GEAR, GEAR_TURNS = Entry(0x6091, 1, "motor revolutions", U32, "rw"), Entry(0x6091, 2, "shaft revolutions", U32, "rw")
SI_UNIT_POSITION = Entry(0x60A8, 0, "SI unit position", U32, "rw")
SI_UNIT_VELOCITY = Entry(0x60A9, 0, "SI unit velocity", U32, "rw")
# CiA 303-2; bytes of objects 60A8 and 60A9 from the highest: power of ten, numerator, denominator.
METRES, SECONDS, REVOLUTIONS, MINUTES = 0x01, 0x03, 0xB4, 0x47
# Two whole numbers of five digits give a ratio to 2e-5; more is another lead or gear.
SCALE_TOLERANCE = 1e-3
NOT_SET_UP = 1.0  # the profile's default of each factor: no turn of a shaft is one position unit, nor a unit a mm
Has = Callable[[Entry], bool]


class PositionScale(NamedTuple):
    """Position units a millimetre, and what says so."""

    per_mm: float
    said_by: str

    def __str__(self) -> str:
        return f"{self.per_mm:g} units a mm by {self.said_by}"


def position_scale(node: Node, config: Cia402Wiring, has: Has) -> PositionScale:
    """As stated, else as the drive says; raises DeviceError where two of these differ, and where nothing says it.

    With ``increments_per_mm`` but without ``lead_mm`` the drive is not asked.
    """
    stated = PositionScale(config.increments_per_mm, "axis.increments_per_mm")
    if config.increments_per_mm and not config.lead_mm:
        return stated
    said = list(_said(node, config, has))
    if config.increments_per_mm:
        said.insert(0, stated)
    elif not said or not _set_up(node, has):
        raise DeviceError(
            f"{node.name}: nothing says how many of its position units are a millimetre: give axis.increments_per_mm,"
            " or axis.lead_mm where the drive's factors (objects 6092, or 608F and 6091) are set up"
        )
    for other in said[1:]:
        if abs(other.per_mm / said[0].per_mm - 1) > SCALE_TOLERANCE:
            raise DeviceError(
                f"{node.name}: by {other.said_by} that is {other.per_mm:g} a mm, where {said[0].said_by} says"
                f" {said[0].per_mm:g}; correct whichever is wrong"
            )
    return said[0]


def _said(node: Node, config: Cia402Wiring, has: Has) -> Iterator[PositionScale]:
    """What the drive says, by its factors and by its unit; a unit that a feed of 1 belies was never chosen."""
    per_turn = units_per_turn(node, has)
    if per_turn and config.lead_mm:
        factors = f"its own factors (objects 6092, 608F, 6091), where {per_turn:g} units are one turn"
        yield PositionScale(per_turn / config.lead_mm, f"{factors}, and axis.lead_mm {config.lead_mm:g}")
    if has(SI_UNIT_POSITION) and has(FEED) and per_turn > NOT_SET_UP:
        unit = node.read(SI_UNIT_POSITION)
        per_mm = 10.0 ** (-3 - _exponent(unit))
        if _fraction(unit) == (METRES, 0) and per_mm > NOT_SET_UP:
            yield PositionScale(per_mm, "its unit of position (object 60A8)")


def _set_up(node: Node, has: Has) -> bool:
    """Whether somebody gave the drive its factors: an encoder without its gear leaves the shaft's turns unknown."""
    return (has(FEED) or has(GEAR)) and units_per_turn(node, has) > NOT_SET_UP


def units_per_turn(node: Node, has: Has) -> float:
    """Position units for one turn of the driving shaft by the drive's factors; 0 where it has none of them."""
    if has(FEED):
        return _ratio(node, FEED, FEED_TURNS, has)
    if has(ENCODER):
        return _ratio(node, ENCODER, ENCODER_TURNS, has) * _gear(node, has)
    return 0.0


def _gear(node: Node, has: Has) -> float:
    return _ratio(node, GEAR, GEAR_TURNS, has) if has(GEAR) else 1.0


def _ratio(node: Node, above: Entry, below: Entry, has: Has) -> float:
    divisor = node.read(below) if has(below) else 1
    if not divisor:
        raise DeviceError(f"{node.name}: {below} is 0, and nothing can be divided by it; set up its factors")
    return node.read(above) / divisor


def speed_unit(node: Node, config: Cia402Wiring, has: Has, per_mm: float) -> float:
    """The drive's unit of speed in position units a second; raises DeviceError where it names one unknown here."""
    if config.speed_unit == "rpm":
        return _units_per_rev(node, config, has) / 60
    if config.speed_unit == "units/s" or not has(SI_UNIT_VELOCITY):
        return 1.0
    said = node.read(SI_UNIT_VELOCITY)
    if _fraction(said) == (REVOLUTIONS, MINUTES):
        return float(_units_per_rev(node, config, has) / 60 * 10.0 ** _exponent(said))
    if _fraction(said) == (METRES, SECONDS):
        return float(per_mm * 10.0 ** (3 + _exponent(said)))
    if said:
        raise DeviceError(
            f"{node.name}: its unit of speed (object 60A9 is {said:#010x}) is neither rpm nor metres a second; say"
            " axis.speed_unit units/s or rpm, whichever its manual names"
        )
    return 1.0


def _units_per_rev(node: Node, config: Cia402Wiring, has: Has) -> float:
    """Of the shaft whose speed is counted; behind a gear nothing says which shaft that is."""
    if config.increments_per_rev:
        return config.increments_per_rev
    if _set_up(node, has) and _gear(node, has) == 1:
        return units_per_turn(node, has)
    raise DeviceError(
        f"{node.name}: its speeds are in rpm, and nothing says how many of its position units are a turn: give"
        " axis.increments_per_rev"
    )


def _exponent(unit: int) -> int:
    return (unit >> 24 ^ 0x80) - 0x80  # signed


def _fraction(unit: int) -> tuple[int, int]:
    return unit >> 16 & 0xFF, unit >> 8 & 0xFF
