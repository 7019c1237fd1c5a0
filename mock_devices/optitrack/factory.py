"""The simulated Motive of the bench, and what can go wrong inside it."""

from collections.abc import Mapping

from mock_devices.devices import TOOLS, DeviceFactory
from mock_devices.faults.sensing import CAMERA_FAULTS
from mock_devices.faults.trackers import hiding, spoiling
from mock_devices.faults.wires import FaultKind, faults_of, switching
from mock_devices.optitrack.mock import OptiTrackMock
from mock_devices.played import MockDevice, served
from mock_devices.udp_wire import UdpWire

FAULTS: Mapping[str, FaultKind[OptiTrackMock]] = {
    "silent": FaultKind("sends nothing", True, switching("silent")),
    "frozen": FaultKind("repeats its last frame", True, switching("frozen")),
    "unknown": FaultKind("says that it streams NatNet 2.10", True, switching("unknown")),
    "corrupt_every": FaultKind("cuts every n-th frame short; 0: none", 10, spoiling("corrupt_every")),
    "missing": FaultKind("the body of this index is not tracked; false: none", 0, hiding("missing")),
}


def optitrack(factory: DeviceFactory) -> list[MockDevice]:
    """The cameras behind Motive."""
    wire, plant = factory.faulty(UdpWire()), factory.bench.tracker
    mock = OptiTrackMock(wire, plant, factory.start_ns, TOOLS)
    mock.latency_ms = 1e3 * factory.bench.parameters.tracker.latency_s
    return [served("tracker_natnet", mock, wire, FAULTS, faults_of(plant, CAMERA_FAULTS))]
