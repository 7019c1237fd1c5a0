"""The simulated OpenIGTLink server of the bench, and what can go wrong inside it."""

import time
from collections.abc import Mapping

from mock_devices.devices import TOOLS, DeviceFactory
from mock_devices.faults.sensing import CAMERA_FAULTS
from mock_devices.faults.trackers import hiding, spoiling
from mock_devices.faults.wires import FaultKind, faults_of, switching
from mock_devices.openigtlink.mock import OpenIgtLinkMock
from mock_devices.played import MockDevice, served
from mock_devices.wire import TcpWire

FAULTS: Mapping[str, FaultKind[OpenIgtLinkMock]] = {
    "silent": FaultKind("sends nothing", True, switching("silent")),
    "frozen": FaultKind("goes on sending under one and the same time", True, switching("frozen")),
    "clockless": FaultKind("sends 0 in place of the time", True, switching("clockless")),
    "corrupt_every": FaultKind("spoils the checksum of every n-th message; 0: none", 10, spoiling("corrupt_every")),
    "missing": FaultKind("the tool of this index is hidden; false: none", 0, hiding("missing")),
}


def openigtlink(factory: DeviceFactory) -> list[MockDevice]:
    """The camera behind an OpenIGTLink server."""
    wire, plant = factory.faulty(TcpWire()), factory.bench.tracker
    since_1970_ns = time.time_ns() - time.monotonic_ns()
    mock = OpenIgtLinkMock(wire, plant, TOOLS, lambda now_ns: now_ns + since_1970_ns)
    mock.latency_ms = 1e3 * factory.bench.parameters.tracker.latency_s
    return [served("tracker_igtl", mock, wire, FAULTS, faults_of(plant, CAMERA_FAULTS))]
