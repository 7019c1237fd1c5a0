"""The boot text is for whoever opens the port first, and comes again after a power cycle: by pyserial, unchanged."""

import select
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import serial

from mock_devices.bota.mock import BotaMock
from mock_devices.interfaces import NEVER_NS
from mock_devices.opening import OpenWatch, PortPower
from mock_devices.testing.force import StillPlant
from mock_devices.wire import PtyWire

BOOT_END = b"FW version: 1.0.6\r\n"
PATIENCE_S = 5.0


class Served:
    """A Bota mock in a thread, in real time; ``restart`` takes its power away for a moment."""

    def __init__(self) -> None:
        self.mock = BotaMock(PtyWire(), StillPlant(), time.monotonic_ns())
        self.address = self.mock.endpoints()["serial"]
        self._over = threading.Event()
        self._asked = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def restart(self) -> None:
        self._asked.set()
        while self._asked.is_set():
            time.sleep(0.001)

    def end(self) -> None:
        self._over.set()
        self._thread.join()
        self.mock.close()

    def _serve(self) -> None:
        while not self._over.is_set():
            if self._asked.is_set():
                self.mock.receive(time.monotonic_ns())
                self.mock.restart()
                self._asked.clear()
            if select.select(self.mock.filenos(), [], [], 0.005)[0]:
                self.mock.receive(time.monotonic_ns())
            if self.mock.due_ns <= time.monotonic_ns():
                self.mock.tick(time.monotonic_ns())


@pytest.fixture
def served() -> Iterator[Served]:
    served = Served()
    yield served
    served.end()


@contextmanager
def client(served: Served) -> Iterator[serial.Serial]:
    """As the maker's example opens it: what waits in the line is thrown away."""
    with serial.Serial(served.address, 460_800, timeout=PATIENCE_S) as port:
        yield port


def heard(port: serial.Serial, seconds: float) -> bytes:
    port.timeout = seconds
    return bytes(port.read(4096))


def test_a_client_that_comes_late_sees_the_boot_text(served: Served) -> None:
    time.sleep(0.4)
    assert served.mock.due_ns == NEVER_NS
    with client(served) as port:
        text = port.read_until(BOOT_END)
        assert b"App Init" in text
        assert text.endswith(BOOT_END)
        port.write(b"C")
        assert port.read_until(b"\r\n") == b"r,0,C,0\r\n"


def test_the_second_client_finds_it_as_the_first_left_it(served: Served) -> None:
    with client(served) as port:
        port.read_until(BOOT_END)
    with client(served) as port:
        assert heard(port, 0.4) == b""


def test_a_power_cycle_boots_before_the_client_that_is_there(served: Served) -> None:
    with client(served) as port:
        port.read_until(BOOT_END)
        port.write(b"CR")
        port.read_until(b"r,0,R,0\r\n")
        served.restart()
        assert BOOT_END in port.read_until(BOOT_END)
        assert heard(port, 0.1) == b""


def test_a_power_cycle_without_a_client_boots_for_the_next_one(served: Served) -> None:
    with client(served) as port:
        port.read_until(BOOT_END)
    served.restart()
    time.sleep(0.3)
    with client(served) as port:
        assert port.read_until(BOOT_END).endswith(BOOT_END)


def test_a_watch_counts_who_comes_and_goes() -> None:
    wire = PtyWire()
    watched = OpenWatch(wire.endpoint)
    assert not watched.opened()
    with serial.Serial(wire.endpoint, 9600):
        assert watched.opened()
        assert not watched.opened()
        assert watched.clients == 1
    assert not watched.opened()
    assert watched.clients == 0
    watched.close()
    watched.close()
    wire.close()


def test_what_is_no_line_is_not_watched() -> None:
    for path in ("127.0.0.1:1", "/nowhere/at/all"):
        power = PortPower(path)
        assert (power.watched, power.filenos(), power.opened(), power.taken()) == (False, [], False, True)
        power.close()
