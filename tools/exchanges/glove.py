"""The client reads a simulated finger from the simulated board."""

import time

import pyfirmata2

from mock_devices.firmata.glove import GloveFigures, GlovePlant
from mock_devices.firmata.mock import FirmataMock
from mock_devices.testing.commands import until
from mock_devices.testing.played import played
from mock_devices.wire import PtyWire


def exchange() -> None:
    """6 N against 12 N in the divider are a third of the supply."""
    plant = GlovePlant(figures=GloveFigures(noise_counts=0.0), weights_N={1: 5.5})
    mock = FirmataMock(PtyWire(), plant, time.monotonic_ns())
    pyfirmata2.pyfirmata2.BOARD_SETUP_WAIT_TIME = 0.1
    with played(mock):
        board = pyfirmata2.Board(mock.endpoints()["serial"])
        pin = board.get_pin("a:1:i")
        pin.enable_reporting()
        board.samplingOn(20)
        until(lambda: pin.value is not None and abs(pin.value - 1 / 3) < 1e-3, 10.0, "the finger's force")
        board.exit()
