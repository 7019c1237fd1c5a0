"""What the bench plays: a product on a wire, with the faults it can have. Makers in other distributions begin here."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar
from zlib import crc32

from mock_devices.faults.wires import WIRE_FAULTS, Fault, FaultKind, FaultyWire, faults_of
from mock_devices.interfaces import ProtocolMock
from mock_devices.parameters import Axis, Sensor
from rig.config.products.registry import ROLES
from rig.config.products.roles import Product

AnyMock = TypeVar("AnyMock", bound=ProtocolMock)
ALL = "all"
# Six digits are what the Bota sensor prints.
OTHER_DEVICES = 900_000
# What the bench can play in each role: one product, or all of them at once.
CHOICES: dict[str, dict[str, tuple[type[Product], ...]]] = {
    role: {
        ALL: tuple(product for product in products.values() if product.mock),
        **{name: (product,) for name, product in products.items() if product.mock},
    }
    for role, products in ROLES.items()
}


@dataclass(frozen=True)
class MockDevice:
    """One product on one wire; ``role`` is where its endpoint stands among the bench's."""

    role: str
    mock: ProtocolMock
    wire: FaultyWire
    faults: dict[str, Fault]


def number_of(device: Sensor | Axis, usual: Sensor | Axis, number: int) -> int:
    """A device made of other figures is another device, and has another serial number."""
    return number if device == usual else number + 1 + crc32(device.model_dump_json().encode()) % OTHER_DEVICES


def served(
    role: str,
    mock: AnyMock,
    wire: FaultyWire,
    kinds: Mapping[str, FaultKind[AnyMock]],
    inside: Mapping[str, Fault] | None = None,
) -> MockDevice:
    """A device with its faults: those of the wire, of ``kinds``, and of what is ``inside``."""
    return MockDevice(role, mock, wire, faults_of(wire, WIRE_FAULTS) | faults_of(mock, kinds) | dict(inside or {}))
