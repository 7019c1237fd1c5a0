"""Rows of one input for whoever watches: by its driver, and out of a ring that a loop writes."""

import itertools
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from controller.inputs import watch
from controller.inputs.examination import look_at
from controller.inputs.watch import by_driver, by_ring
from mock_devices.evdev.mock import SwitchMock
from mock_devices.firmata.glove import GloveFigures, GlovePlant
from mock_devices.firmata.mock import FirmataMock
from mock_devices.wire import PtyWire
from rig.config.products.evdev_switch import EvdevSwitch
from rig.config.products.firmata_glove import FirmataGlove
from rig.errors import DeviceError
from rig.input_streams import InputSample, input_stream
from rig.recording.ring import RingWriter

CONFIG = EvdevSwitch(port="/dev/pedal")
STREAM = input_stream(0, "pedal", CONFIG.channels)


def row(seq: int) -> bytes:
    return STREAM.pack(InputSample(seq, seq, seq, 0, 0, -1, (1.0, 48.0), 0, 1).row)


def times(count: int) -> Callable[[], bool]:
    """Goes on so often."""
    left = iter(range(count))
    return lambda: next(left, None) is not None


def test_of_a_ring_only_what_comes_from_now_on(tmp_path: Path) -> None:
    ring = RingWriter.create(tmp_path / "a.ring", 64)
    ring.put(STREAM.id, row(0))
    rows = by_ring(ring.path, STREAM, times(50))
    for seq in (1, 2):
        threading.Timer(0.1 * seq, ring.put, (STREAM.id, row(seq))).start()
    assert [int(found[0]) for found in itertools.islice(rows, 2)] == [1, 2]
    rows.close()  # type: ignore[attr-defined]
    ring.close()


def test_of_a_driver_what_it_brings(tmp_path: Path) -> None:
    mock = SwitchMock(tmp_path / "events")
    rows = by_driver(EvdevSwitch(port=str(tmp_path / "events")), times(100))
    threading.Timer(0.1, lambda: mock.press(True)).start()
    (found,) = itertools.islice(rows, 1)
    assert found[6:8] == (1.0, 48.0)
    rows.close()  # type: ignore[attr-defined]
    mock.close()


def test_who_ends_it_ends_it(tmp_path: Path) -> None:
    ring = RingWriter.create(tmp_path / "a.ring", 64)
    assert list(by_ring(ring.path, STREAM, times(3))) == []
    ring.close()


def test_an_input_that_says_nothing_at_all_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(watch, "SILENT_S", 0.05)
    ring = RingWriter.create(tmp_path / "a.ring", 64)
    with pytest.raises(DeviceError, match="no sample of the input for"):
        list(by_ring(ring.path, STREAM, lambda: True))
    ring.close()


@pytest.fixture
def glove() -> Iterator[FirmataMock]:
    mock = FirmataMock(PtyWire(), GlovePlant(figures=GloveFigures()), time.monotonic_ns())
    ending = threading.Event()

    def play() -> None:
        while not ending.wait(0.002):
            mock.receive(time.monotonic_ns())
            mock.tick(time.monotonic_ns())

    thread = threading.Thread(target=play)
    thread.start()
    yield mock
    ending.set()
    thread.join()
    mock.close()


def test_a_look_at_a_glove_says_who_it_is_its_rate_and_what_it_lacks(
    glove: FirmataMock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drivers.firmata.device.RESET_S", 0.0)
    found = look_at("glove", FirmataGlove(port=glove.endpoints()["serial"]), 0.5)
    assert (found.role, found.product, found.firmware) == ("glove", "firmata-glove", "StandardFirmata.ino 2.5")
    assert "no calibration of thumb, index, middle" in found.problem
    assert found.rate_Hz == pytest.approx(50.0, rel=0.2)


def test_a_look_at_what_is_not_there_says_where_to_look() -> None:
    found = look_at("pedal", CONFIG, 0.1)
    assert "No such file" in found.problem and "its cable" in found.advice


def test_a_look_at_a_switch_that_nobody_presses_finds_nothing_wrong(tmp_path: Path) -> None:
    mock = SwitchMock(tmp_path / "events")
    found = look_at("pedal", EvdevSwitch(port=str(tmp_path / "events")), 0.05)
    assert (found.product, found.problem) == ("evdev-switch", "")
    mock.close()
