"""The simulated load-cell transmitter of the bench, and what can go wrong inside it."""

from collections.abc import Mapping

from mock_devices.devices import DeviceFactory
from mock_devices.faults.sensing import SENSOR_FAULTS
from mock_devices.faults.trackers import spoiling
from mock_devices.faults.wires import FaultKind, faults_of, switching
from mock_devices.laumas.mock import LaumasMock
from mock_devices.parameters import Parameters
from mock_devices.played import MockDevice, number_of, served

NUMBER = 4711
MOST_NUMBERS = 60_000  # its register has 16 bits
FAULTS: Mapping[str, FaultKind[LaumasMock]] = {
    "silent": FaultKind("answers nothing", True, switching("silent")),
    "frozen": FaultKind("repeats the last weight", True, switching("frozen")),
    "invalid": FaultKind("sets the error bit of its status register", True, switching("invalid")),
    "refusing": FaultKind("answers with exception 2", True, switching("refusing")),
    "corrupt_every": FaultKind("spoils the checksum of every n-th answer; 0: none", 10, spoiling("corrupt_every")),
}


def laumas(factory: DeviceFactory) -> list[MockDevice]:
    """The transmitter, whose load cell stands where the sensor of `[force]` does, with its noise, zero and range."""
    wire, plant = factory.faulty(factory.line("force_gauge")), factory.bench.force
    sensor = factory.bench.parameters.force
    number = number_of(sensor, Parameters().force, NUMBER) % MOST_NUMBERS
    mock = LaumasMock(wire, plant, number, 1e3 * sensor.filter_s)
    return [served("force_gauge", mock, wire, FAULTS, faults_of(plant, SENSOR_FAULTS))]
