"""All products of the bench on their wires: each mock with its plant, its wire and the faults either can have."""

import random
from collections.abc import Callable
from pathlib import Path

from drivers.epos4.objects import SERIAL
from mock_devices.bench import Bench
from mock_devices.bota.mock import BotaMock
from mock_devices.epos4.mock import Epos4Mock
from mock_devices.faults.devices import BOTA_FAULTS, EPOS4_FAULTS, NDI_FAULTS, ROBOTIQ_FAULTS
from mock_devices.faults.sensing import CAMERA_FAULTS, SENSOR_FAULTS
from mock_devices.faults.wires import FaultyWire, faults_of
from mock_devices.ndi.mock import NdiMock
from mock_devices.parameters import Axis, Parameters
from mock_devices.played import MockDevice, number_of, served
from mock_devices.robotiq.mock import RobotiqMock
from mock_devices.wire import PtyWire, TcpWire, Wire

TOOLS = ("tip", "arm")
BOTA_NUMBER, ROBOTIQ_NUMBER, AXIS_NUMBER = 271, 1234, int(SERIAL.default)


class DeviceFactory:
    """Builds devices on ``bench``; ``clock_ns`` times delayed writes, ``seed`` draws what wire faults spoil."""

    def __init__(
        self, bench: Bench, start_ns: int, clock_ns: Callable[[], int], seed: int, links: Path | None = None
    ) -> None:
        """Serial lines are found under ``links`` by the name of their role, also after they were unplugged."""
        self._links = links
        self.bench = bench
        self.start_ns = start_ns
        self._clock_ns = clock_ns
        self._rng = random.Random(seed)

    def bota(self) -> list[MockDevice]:
        """The SensONE."""
        wire = self.faulty(self.line("force"))
        drift_ppm = self.bench.parameters.force.counter_drift_ppm
        number = number_of(self.bench.parameters.force, Parameters().force, BOTA_NUMBER)
        mock = BotaMock(wire, self.bench.force, self.start_ns, drift_ppm, f"{number:06d}")
        return [served("force", mock, wire, BOTA_FAULTS, faults_of(self.bench.force, SENSOR_FAULTS))]

    def robotiq(self) -> list[MockDevice]:
        """The FT 300."""
        wire = self.faulty(self.line("force_modbus"))
        drift_ppm = self.bench.parameters.force_modbus.counter_drift_ppm
        number = number_of(self.bench.parameters.force_modbus, Parameters().force_modbus, ROBOTIQ_NUMBER)
        mock = RobotiqMock(wire, self.bench.force_modbus, self.start_ns, drift_ppm, number)
        inside = faults_of(self.bench.force_modbus, SENSOR_FAULTS)
        return [served("force_modbus", mock, wire, ROBOTIQ_FAULTS, inside)]

    def epos4(self) -> list[MockDevice]:
        """The drive."""
        wire = self.faulty(self.line("axis"))
        axis = self.bench.parameters.axis
        per_rev = abs(axis.increments_per_mm) * axis.lead_mm
        number = number_of(Axis(increments_per_mm=axis.increments_per_mm, lead_mm=axis.lead_mm), Axis(), AXIS_NUMBER)
        mock = Epos4Mock(
            wire, self.bench.axis, self.start_ns, axis.node, axis.increments_per_mm, per_rev, self._clock_ns, number
        )
        return [served("axis", mock, wire, EPOS4_FAULTS)]

    def ndi(self) -> list[MockDevice]:
        """The camera on both of its wires."""
        serial = self.faulty(self.line("tracker"))
        tcp = self.faulty(_listen(self.bench.parameters.tracker.tcp_port))
        tracker = self.bench.tracker
        inside = faults_of(tracker, CAMERA_FAULTS)
        return [
            served("tracker", NdiMock(serial, tracker, self.start_ns, TOOLS, "polaris"), serial, NDI_FAULTS, inside),
            served("tracker", NdiMock(tcp, tracker, self.start_ns, TOOLS, "vega"), tcp, NDI_FAULTS, inside),
        ]

    def line(self, role: str) -> PtyWire:
        """A serial line, which can be plugged in again where there are links."""
        return PtyWire(self._links / role if self._links else None)

    def faulty(self, wire: Wire) -> FaultyWire:
        """The wire with all the faults that one can have."""
        return FaultyWire(wire, self._rng, self._clock_ns)


def _listen(port: int) -> TcpWire:
    """The camera's own port where it is free, any other where not."""
    try:
        return TcpWire(port)
    except OSError:
        return TcpWire()
