"""The inputs of the simulated bench: glove, foot switch and respiration belt, each with its faults."""

import os

from mock_devices.devices import DeviceFactory
from mock_devices.evdev.mock import SwitchMock, own_path
from mock_devices.faults.inputs import BREATHING_FAULTS, GLOVE_FAULTS, SWITCH_FAULTS
from mock_devices.faults.wires import Fault, faults_of
from mock_devices.firmata.glove import GlovePlant
from mock_devices.firmata.mock import FirmataMock
from mock_devices.lsl.mock import BreathingMock
from mock_devices.no_wire import NoWire
from mock_devices.played import AnyMock, MockDevice, served


def glove(factory: DeviceFactory) -> list[MockDevice]:
    """The pain glove."""
    wire = factory.faulty(factory.line("glove"))
    return [served("glove", FirmataMock(wire, GlovePlant(), factory.start_ns), wire, GLOVE_FAULTS)]


def switch(factory: DeviceFactory) -> list[MockDevice]:
    """The foot switch."""
    mock = SwitchMock(own_path())
    return [_wireless(factory, mock, faults_of(mock, SWITCH_FAULTS))]


def breathing(factory: DeviceFactory) -> list[MockDevice]:
    """The respiration belt, which follows the limb's surface."""
    mock = BreathingMock(f"mock-belt-{os.getpid()}", lambda: factory.bench.limb.position_mm, factory.start_ns)
    return [_wireless(factory, mock, faults_of(mock, BREATHING_FAULTS))]


def _wireless(factory: DeviceFactory, mock: AnyMock, faults: dict[str, Fault]) -> MockDevice:
    return MockDevice(mock.name, mock, factory.faulty(NoWire()), faults)
