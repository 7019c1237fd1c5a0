"""One damaged answer while an FT 300 starts, identity and stream, over a wire that spoils it."""

import select
import threading
import time
from functools import partial

import pytest

from drivers.ports import open_port
from drivers.robotiq import device
from drivers.robotiq.codec import START_STREAM, STREAM_STARTED, encode_frame
from drivers.robotiq.device import RobotiqFt300
from mock_devices.robotiq.mock import RobotiqMock
from mock_devices.testing.force import StillPlant
from mock_devices.wire import TcpWire
from rig.config.products.robotiq_ft300 import Ft300Wiring
from tests.drivers.scripted_port import ScriptedPort


class SpoilingWire(TcpWire):
    """Flips a bit of one write."""

    def __init__(self, spoilt: int) -> None:
        super().__init__()
        self._left = spoilt

    def write(self, data: bytes) -> None:
        self._left -= 1
        super().write(data if self._left else data[:3] + bytes([data[3] ^ 4]) + data[4:])


def play(mock: RobotiqMock, ended: threading.Event) -> None:
    while not ended.is_set():
        select.select(mock.filenos(), [], [], max(0.0, min((mock.due_ns - time.monotonic_ns()) / 1e9, 0.02)))
        while mock.due_ns <= time.monotonic_ns():
            mock.tick(mock.due_ns)
        mock.receive(time.monotonic_ns())


@pytest.mark.bench
@pytest.mark.xdist_group("wire")
@pytest.mark.parametrize("spoilt", [1, 2, 3, 4, 5])
def test_any_one_damaged_answer_during_start_is_asked_for_again(spoilt: int) -> None:
    mock, ended = RobotiqMock(SpoilingWire(spoilt), StillPlant(), time.monotonic_ns()), threading.Event()
    thread = threading.Thread(target=play, args=(mock, ended))
    thread.start()
    sensor = RobotiqFt300(partial(open_port, f"tcp://{mock.endpoints()['tcp']}"), Ft300Wiring())
    try:
        sensor.start()
        assert sensor.identity.serial == "FTS-1234"
        assert len(sensor.poll(time.monotonic_ns())) > 100
    finally:
        sensor.close()
        ended.set()
        thread.join()
        mock.close()


def test_a_start_command_that_is_not_obeyed_is_said_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "FIRST_FRAME_S", 0.05)
    heard: list[bytes] = []

    def deaf_once(command: bytes) -> bytes:
        heard.append(command)
        return STREAM_STARTED + encode_frame([0] * 6) if len(heard) == 2 else b""

    sensor = RobotiqFt300(lambda _: ScriptedPort(deaf_once), Ft300Wiring())
    sensor._start_stream()
    assert heard == [START_STREAM] * 2
    sensor.close()
