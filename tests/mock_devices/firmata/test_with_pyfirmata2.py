"""The mock board against a client that nobody here wrote: `pyfirmata2`, unchanged, over a pseudo-terminal."""

import os
import threading
import time
from collections.abc import Iterator
from select import select

import pyfirmata2
import pytest

from mock_devices.firmata.glove import GloveFigures, GlovePlant
from mock_devices.firmata.mock import FirmataMock
from mock_devices.wire import PtyWire

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("bench")]
QUIET = GloveFigures(noise_counts=0.0)


@pytest.fixture
def board() -> Iterator[FirmataMock]:
    mock = FirmataMock(PtyWire(), GlovePlant(figures=QUIET, weights_N={1: 5.5}), time.monotonic_ns())
    ending = threading.Event()

    def play() -> None:
        while not ending.is_set():
            if select(mock.filenos(), [], [], 0.002)[0]:
                mock.receive(time.monotonic_ns())
            mock.tick(time.monotonic_ns())

    thread = threading.Thread(target=play)
    thread.start()
    yield mock
    ending.set()
    thread.join()
    mock.close()


def test_pyfirmata2_finds_the_inputs_and_reads_what_lies_on_them(
    board: FirmataMock, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A real board resets when its port is opened, for which the client waits five seconds.
    monkeypatch.setattr(pyfirmata2.pyfirmata2, "BOARD_SETUP_WAIT_TIME", 0.1)
    client = pyfirmata2.Board(os.fspath(board.endpoints()["serial"]))
    try:
        assert len(client.analog) == 6
        read: list[float] = []
        pins = [client.get_pin(f"a:{number}:i") for number in range(2)]
        pins[1].register_callback(read.append)
        pins[1].enable_reporting()
        client.samplingOn(20)
        began_s = time.monotonic()
        time.sleep(1.0)
        took_s = time.monotonic() - began_s
        # 0.5 N of fabric and 5.5 N against 12 N in the divider: 6 / 18 of the supply.
        assert read[-1] == pytest.approx(6.0 / 18.0, abs=1e-3)
        assert pins[0].value == pytest.approx(0.5 / 12.5, abs=1e-3)
        assert len(read) == pytest.approx(50 * took_s, rel=0.2)
    finally:
        client.samplingOff()
        client.exit()
