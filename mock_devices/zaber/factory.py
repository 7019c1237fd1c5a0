"""The simulated Zaber axis of the bench on its two wires, and what can go wrong inside it."""

from collections.abc import Mapping

from drivers.zaber.flags import FLAGS
from mock_devices.devices import AXIS_NUMBER, DeviceFactory
from mock_devices.faults.trackers import spoiling
from mock_devices.faults.wires import FaultKind, Value, as_switch, switching
from mock_devices.parameters import Axis
from mock_devices.played import MockDevice, number_of, served
from mock_devices.zaber.mock import ZaberMock
from rig.errors import UsageError


def _raise_flag(axis: ZaberMock, value: Value) -> None:
    if not isinstance(value, str) or value not in FLAGS:
        raise UsageError(f"this fault takes a flag of the manual, for example FS, not {value!r}")
    axis.raise_flag(value)


def _restart(axis: ZaberMock, value: Value) -> None:
    if as_switch(value):
        axis.restart()


FAULTS: Mapping[str, FaultKind[ZaberMock]] = {
    "silent": FaultKind("answers nothing", True, switching("silent")),
    "frozen": FaultKind("repeats the position it had", True, switching("frozen")),
    "old": FaultKind("says that its firmware is 6.28", True, switching("old")),
    "corrupt_every": FaultKind("spoils the checksum of every n-th reply; 0: none", 10, spoiling("corrupt_every")),
    "flag": FaultKind("this flag comes up, for example FS: stalled and stopped", "FS", _raise_flag),
    "restart": FaultKind("loses its power for a moment, and with it its reference", True, _restart),
}


def zaber(factory: DeviceFactory) -> list[MockDevice]:
    """The axis on a serial line, on the plant that the other axes of the bench have too."""
    wire, axis = factory.faulty(factory.line("axis_ascii")), factory.bench.parameters.axis
    usual = Axis(increments_per_mm=axis.increments_per_mm, lead_mm=axis.lead_mm)
    number = number_of(usual, Axis(), AXIS_NUMBER) % 1_000_000
    mock = ZaberMock(wire, factory.bench.axis, factory.start_ns, axis.increments_per_mm, number)
    return [served("axis_ascii", mock, wire, FAULTS)]
