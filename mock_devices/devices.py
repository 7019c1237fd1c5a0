"""All products of the bench on their wires: each mock with its plant, its wire and the faults either can have."""

import os
import random
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import TypeVar
from zlib import crc32

from drivers.epos4.objects import SERIAL
from mock_devices.bench import Bench
from mock_devices.bota.mock import BotaMock
from mock_devices.epos4.mock import Epos4Mock
from mock_devices.evdev.mock import SwitchMock, own_path
from mock_devices.faults.devices import BOTA_FAULTS, EPOS4_FAULTS, NDI_FAULTS, ROBOTIQ_FAULTS
from mock_devices.faults.inputs import BREATHING_FAULTS, GLOVE_FAULTS, SWITCH_FAULTS
from mock_devices.faults.sensing import CAMERA_FAULTS, SENSOR_FAULTS
from mock_devices.faults.wires import WIRE_FAULTS, Fault, FaultKind, FaultyWire, faults_of
from mock_devices.firmata.glove import GlovePlant
from mock_devices.firmata.mock import FirmataMock
from mock_devices.interfaces import ProtocolMock
from mock_devices.lsl.mock import BreathingMock
from mock_devices.ndi.mock import NdiMock
from mock_devices.no_wire import NoWire
from mock_devices.parameters import Axis, Parameters, Sensor
from mock_devices.robotiq.mock import RobotiqMock
from mock_devices.wire import PtyWire, TcpWire, Wire
from rig.config.products.registry import AXES, FORCE_SENSORS, TRACKERS
from rig.config.products.roles import Product

AnyMock = TypeVar("AnyMock", bound=ProtocolMock)
TOOLS = ("tip", "arm")
BOTA_NUMBER, ROBOTIQ_NUMBER, AXIS_NUMBER = 271, 1234, int(SERIAL.default)
# Six digits are what the Bota sensor prints.
OTHER_DEVICES = 900_000
# The force sensors that the bench can play, and all of them at once.
FORCE_CHOICES: dict[str, tuple[type[Product], ...]] = {
    "both": tuple(sensor for sensor in FORCE_SENSORS.values() if sensor.mock),
    **{name: (sensor,) for name, sensor in FORCE_SENSORS.items() if sensor.mock},
}


@dataclass(frozen=True)
class MockDevice:
    """One product on one wire; ``role`` is where its endpoint stands among the bench's."""

    role: str
    mock: ProtocolMock
    wire: FaultyWire
    faults: dict[str, Fault]


class DeviceFactory:
    """Builds devices on ``bench``; ``clock_ns`` times delayed writes, ``seed`` draws what wire faults spoil."""

    def __init__(
        self, bench: Bench, start_ns: int, clock_ns: Callable[[], int], seed: int, links: Path | None = None
    ) -> None:
        """Serial lines are found under ``links`` by the name of their role, also after they were unplugged."""
        self._links = links
        self._bench = bench
        self._start_ns = start_ns
        self._clock_ns = clock_ns
        self._rng = random.Random(seed)

    def devices(self, sensors: Iterable[type[Product]]) -> list[MockDevice]:
        """Those ``sensors``, and every axis and tracker there is."""
        products = [*sensors, *AXES.values(), *TRACKERS.values()]
        makers = [resolve_name(product.mock.maker) for product in products if product.mock]
        return [device for maker in makers for device in maker(self)]

    def bota(self) -> list[MockDevice]:
        """The SensONE."""
        wire = self._faulty(self._line("force"))
        drift_ppm = self._bench.parameters.force.counter_drift_ppm
        number = number_of(self._bench.parameters.force, Parameters().force, BOTA_NUMBER)
        mock = BotaMock(wire, self._bench.force, self._start_ns, drift_ppm, f"{number:06d}")
        return [_device("force", mock, wire, BOTA_FAULTS, faults_of(self._bench.force, SENSOR_FAULTS))]

    def robotiq(self) -> list[MockDevice]:
        """The FT 300."""
        wire = self._faulty(self._line("force_modbus"))
        drift_ppm = self._bench.parameters.force_modbus.counter_drift_ppm
        number = number_of(self._bench.parameters.force_modbus, Parameters().force_modbus, ROBOTIQ_NUMBER)
        mock = RobotiqMock(wire, self._bench.force_modbus, self._start_ns, drift_ppm, number)
        inside = faults_of(self._bench.force_modbus, SENSOR_FAULTS)
        return [_device("force_modbus", mock, wire, ROBOTIQ_FAULTS, inside)]

    def epos4(self) -> list[MockDevice]:
        """The drive."""
        wire = self._faulty(self._line("axis"))
        axis = self._bench.parameters.axis
        per_rev = abs(axis.increments_per_mm) * axis.lead_mm
        number = number_of(Axis(increments_per_mm=axis.increments_per_mm, lead_mm=axis.lead_mm), Axis(), AXIS_NUMBER)
        mock = Epos4Mock(
            wire, self._bench.axis, self._start_ns, axis.node, axis.increments_per_mm, per_rev, self._clock_ns, number
        )
        return [_device("axis", mock, wire, EPOS4_FAULTS)]

    def ndi(self) -> list[MockDevice]:
        """The camera on both of its wires."""
        serial = self._faulty(self._line("tracker"))
        tcp = self._faulty(_listen(self._bench.parameters.tracker.tcp_port))
        tracker = self._bench.tracker
        inside = faults_of(tracker, CAMERA_FAULTS)
        return [
            _device("tracker", NdiMock(serial, tracker, self._start_ns, TOOLS, "polaris"), serial, NDI_FAULTS, inside),
            _device("tracker", NdiMock(tcp, tracker, self._start_ns, TOOLS, "vega"), tcp, NDI_FAULTS, inside),
        ]

    def glove(self) -> list[MockDevice]:
        """The pain glove."""
        wire = self._faulty(self._line("glove"))
        return [_device("glove", FirmataMock(wire, GlovePlant(), self._start_ns), wire, GLOVE_FAULTS)]

    def switch(self) -> list[MockDevice]:
        """The foot switch."""
        path = self._links / "switch" if self._links else own_path()
        return [self._wireless(SwitchMock(path), SWITCH_FAULTS)]

    def breathing(self) -> list[MockDevice]:
        """The respiration belt, which follows the limb's surface."""
        mock = BreathingMock(f"mock-belt-{os.getpid()}", lambda: self._bench.limb.position_mm, self._start_ns)
        return [self._wireless(mock, BREATHING_FAULTS)]

    def _wireless(self, mock: AnyMock, kinds: Mapping[str, FaultKind[AnyMock]]) -> MockDevice:
        return MockDevice(mock.name, mock, self._faulty(NoWire()), faults_of(mock, kinds))

    def _line(self, role: str) -> PtyWire:
        return PtyWire(self._links / role if self._links else None)

    def _faulty(self, wire: Wire) -> FaultyWire:
        return FaultyWire(wire, self._rng, self._clock_ns)


def number_of(device: Sensor | Axis, usual: Sensor | Axis, number: int) -> int:
    """A device made of other figures is another device, and has another serial number."""
    return number if device == usual else number + 1 + crc32(device.model_dump_json().encode()) % OTHER_DEVICES


def _device(
    role: str,
    mock: AnyMock,
    wire: FaultyWire,
    kinds: Mapping[str, FaultKind[AnyMock]],
    inside: Mapping[str, Fault] | None = None,
) -> MockDevice:
    return MockDevice(role, mock, wire, faults_of(wire, WIRE_FAULTS) | faults_of(mock, kinds) | dict(inside or {}))


def _listen(port: int) -> TcpWire:
    """The camera's own port where it is free, any other where not."""
    try:
        return TcpWire(port)
    except OSError:
        return TcpWire()
