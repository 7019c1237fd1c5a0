"""Which protocol the driver of each role keeps, and what one lacks of it."""

from collections.abc import Mapping
from typing import NamedTuple

from drivers.input_role import Input
from drivers.roles import ForceSensor, MarkerTracker, ServoAxis
from rig.config.products.input_role import InputProduct
from rig.config.products.roles import AxisProduct, ForceProduct, Product, TrackerProduct
from rig.plugins import lacking


class Kept(NamedTuple):
    """What a role's products are declared by, and what their drivers keep."""

    declared: type[Product]
    protocol: type


KEPT: Mapping[str, Kept] = {
    "force": Kept(ForceProduct, ForceSensor), "axis": Kept(AxisProduct, ServoAxis),
    "tracker": Kept(TrackerProduct, MarkerTracker), "input": Kept(InputProduct, Input),
}  # fmt: skip


def lack(driver: object, role: str, whole: bool = True) -> str:
    """What ``driver`` (or its class) has not of its role, in words; "" if nothing. ``whole`` as in `lacking`."""
    protocol = KEPT[role].protocol
    absent = lacking(driver, protocol, whole)
    return f"its driver has no {', no '.join(absent)}, which {protocol.__name__} has" if absent else ""
