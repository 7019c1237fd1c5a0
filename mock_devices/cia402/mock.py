"""A CiA 402 drive of no maker: state machine and modes of the EPOS4's mock, other identity, units and defaults.

It counts in micrometres and in units a second, answers 254 where the EPOS4 answers 255, starts with other PDOs off, and
has no bit of its statusword for the reference.
"""

import math
from typing import TYPE_CHECKING

from drivers.cia402.device import NEUTRAL
from drivers.cia402.eds import read_eds
from drivers.epos4.cia402 import Statusword
from mock_devices.cia402.table import ObjectTable
from mock_devices.epos4.mock import Epos4Mock
from mock_devices.faults.devices import EPOS4_FAULTS

if TYPE_CHECKING:
    from mock_devices.devices import DeviceFactory
    from mock_devices.played import MockDevice

UNITS_PER_MM = 1000.0
HOMING_METHODS = (1, 2, 17, 18, 33, 34, 37)


def table(lead_mm: float) -> ObjectTable:
    """Its object dictionary, with the feed constant of a screw of that lead."""
    sheet = read_eds(NEUTRAL)
    return ObjectTable(
        sheet.objects,
        delivered={(0x6092, 1): round(UNITS_PER_MM * lead_mm)},
        texts={(0x1008, 0): sheet.name},
        homing_methods=HOMING_METHODS,
        status_mask=0xFFFF & ~Statusword.REFERENCED,
    )


def neutral(factory: "DeviceFactory") -> "list[MockDevice]":
    """The drive on a CAN adapter of its own, moving the bench's axis."""
    from mock_devices.played import served  # noqa: PLC0415 - that module names this one's product

    axis = factory.bench.parameters.axis
    wire = factory.faulty(factory.line("axis_cia402"))
    scale = math.copysign(UNITS_PER_MM, axis.increments_per_mm)
    mock = Epos4Mock(
        wire, factory.bench.axis, factory.start_ns, axis.node, scale, UNITS_PER_MM * axis.lead_mm,
        number=0x00C1_A402, table=table(axis.lead_mm), speed_unit=1.0,
    )  # fmt: skip
    return [served("axis_cia402", mock, wire, EPOS4_FAULTS)]
