"""A foot switch by the bytes that Linux writes, through a FIFO; found by its name; and gone."""

import fcntl
import os
import select
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.evdev.codec import EventParser, KeyChange
from drivers.evdev.device import FootSwitch, open_switch
from drivers.evdev.port import path_of
from mock_devices.evdev.mock import SwitchMock
from rig.config.products.evdev_switch import EvdevSwitch
from rig.errors import DeviceError
from tests.controller.descriptors import open_files

# As `evtest` shows them: scan code, key b (48) down, report, repeat, key b up; at 1705108059.750000 s.
DOWN = bytes.fromhex(
    "5be2a16500000000b0710b0000000000 0400 0400 05000700"
    "5be2a16500000000b0710b0000000000 0100 3000 01000000"
    "5be2a16500000000b0710b0000000000 0000 0000 00000000"
)
REPEAT = bytes.fromhex("5be2a16500000000b0710b0000000000 0100 3000 02000000")
UP = bytes.fromhex("5be2a16500000000b0710b0000000000 0100 3000 00000000")
AT_NS = 1_705_108_059_750_000_000


@pytest.fixture
def mock(tmp_path: Path) -> Iterator[SwitchMock]:
    switch = SwitchMock(tmp_path / "events")
    yield switch
    switch.close()


def opened(tmp_path: Path, **more: object) -> FootSwitch:
    switch = open_switch(EvdevSwitch.model_validate({"port": str(tmp_path / "events")} | more))
    switch.start()
    return switch


def test_golden_bytes_are_changes_of_a_key() -> None:
    assert EventParser().changes(DOWN + REPEAT + UP) == [KeyChange(AT_NS, 48, True), KeyChange(AT_NS, 48, False)]


def test_a_press_and_its_release_are_samples(mock: SwitchMock, tmp_path: Path) -> None:
    switch = opened(tmp_path)
    mock.press(True)
    (down,) = switch.poll(5_000)
    mock.press(False)
    (up,) = switch.poll(9_000)
    assert (down.values, up.values) == ((1.0, 48.0), (0.0, 48.0))
    assert (down.seq, up.seq) == (0, 1)
    # Of a FIFO the clock is a time of day, so that nobody knows when it was: capture is arrival.
    assert (down.capture_ns, down.arrival_ns, down.uncertainty_ns) == (5_000, 5_000, -1)
    assert down.device_ns > 1e18 and down.device_ns + down.correction_ns == down.capture_ns
    switch.close()


def test_where_the_kernel_gives_the_hosts_clock_capture_is_its_time(
    mock: SwitchMock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[int, object]] = []
    monkeypatch.setattr(fcntl, "ioctl", lambda _, request, argument: asked.append((request, argument)))
    switch = opened(tmp_path)
    # _IOW('E', 0x90, int) and _IOW('E', 0xa0, int) of linux/input.h; CLOCK_MONOTONIC is 1.
    assert asked == [(0x40044590, 1), (0x400445A0, struct.pack("i", time.CLOCK_MONOTONIC))]
    monkeypatch.undo()
    mock._clock_ns = lambda: 7_000_123_000
    mock.press(True)
    (sample,) = switch.poll(7_000_900_000)
    assert (sample.capture_ns, sample.device_ns, sample.uncertainty_ns) == (7_000_123_000, 7_000_123_000, 0)
    switch.close()


UINPUT = Path("/dev/uinput")
# linux/uinput.h: UI_SET_EVBIT, UI_SET_KEYBIT, UI_DEV_SETUP, UI_DEV_CREATE; struct uinput_setup; EV_KEY and KEY_B.
SET_EVENTS, SET_KEY, SETUP, CREATE = 0x40045564, 0x40045565, 0x405C5503, 0x5501
EV_KEY, KEY_B = 1, 48
BUS_USB = 3


@pytest.fixture
def kernels() -> Iterator[tuple[int, str]]:
    """A switch that the kernel itself makes, and its name."""
    if not os.access(UINPUT, os.W_OK):
        pytest.skip("this kernel has no uinput, or lets nobody use it; the other tests use a FIFO")
    name, fd = f"tissue-rig {os.getpid()}", os.open(UINPUT, os.O_WRONLY | os.O_NONBLOCK)
    fcntl.ioctl(fd, SET_EVENTS, EV_KEY)
    fcntl.ioctl(fd, SET_KEY, KEY_B)
    fcntl.ioctl(fd, SETUP, struct.pack("=4H80sI", BUS_USB, 1, 1, 1, name.encode(), 0))
    fcntl.ioctl(fd, CREATE)
    yield fd, name
    os.close(fd)


def test_a_switch_of_the_kernel_is_found_by_its_name_and_dated_by_the_hosts_clock(kernels: tuple[int, str]) -> None:
    fd, name = kernels
    switch = open_switch(EvdevSwitch(port=f"name:{name}"))
    switch.start()
    before_ns = time.monotonic_ns()
    os.write(fd, struct.pack("@qqHHi", 0, 0, EV_KEY, KEY_B, 1) + struct.pack("@qqHHi", 0, 0, 0, 0, 0))
    assert select.select([switch.fileno()], [], [], 5.0)[0]
    (down,) = switch.poll(time.monotonic_ns())
    assert (down.values, down.uncertainty_ns) == ((1.0, float(KEY_B)), 0)
    assert before_ns - 1000 <= down.capture_ns <= down.arrival_ns
    switch.close()


def test_one_key_of_several_counts_where_it_is_named(mock: SwitchMock, tmp_path: Path) -> None:
    switch = opened(tmp_path, key="p")
    mock.press(True)
    assert switch.poll(1) == []
    assert switch.counters.frames == 1
    switch.close()


def test_pulled_out_it_is_named_and_plugged_in_it_opens_again(mock: SwitchMock, tmp_path: Path) -> None:
    before = open_files()
    switch = opened(tmp_path)
    mock.close()
    with pytest.raises(DeviceError, match="events: the switch is gone; plug it in again"):
        switch.poll(1)
    switch.close()
    with pytest.raises(DeviceError, match=r"switch .*events: No such file .*group input"):
        opened(tmp_path)
    mock.plug()
    again = opened(tmp_path)
    mock.press(True)
    assert len(again.poll(1)) == 1
    again.close()
    again.close()
    assert len(open_files()) == len(before)


def test_what_is_no_input_device_is_refused(tmp_path: Path) -> None:
    (tmp_path / "events").write_bytes(DOWN)
    with pytest.raises(DeviceError, match="is no input device"):
        opened(tmp_path)


@pytest.fixture
def names(tmp_path: Path) -> Path:
    for node, name in (("event3", "Foot Switch"), ("event4", "Keyboard"), ("event7", "Pedal"), ("event8", "Pedal")):
        (tmp_path / node / "device").mkdir(parents=True)
        (tmp_path / node / "device" / "name").write_text(f"{name}\n")
    return tmp_path


def test_a_device_is_found_by_its_name(names: Path) -> None:
    assert path_of("Foot Switch", names) == "/dev/input/event3"


def test_two_of_one_name_and_none_are_refused(names: Path) -> None:
    with pytest.raises(DeviceError, match="2 input devices are called 'Pedal': /dev/input/event7, /dev/input/event8"):
        path_of("Pedal", names)
    with pytest.raises(DeviceError, match="no input device is called 'X'; there are: 'Foot Switch', 'Keyboard'"):
        path_of("X", names)
    with pytest.raises(DeviceError, match="there are: none at all"):
        path_of("X", names / "nowhere")


def test_a_port_that_begins_with_name_is_looked_up(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "found")
    monkeypatch.setattr("drivers.evdev.device.path_of", lambda name: str(tmp_path / "found") if name == "Pedal" else "")
    switch = open_switch(EvdevSwitch(port="name:Pedal"))
    assert switch.identity.settings == {"path": str(tmp_path / "found")}
    switch.close()
