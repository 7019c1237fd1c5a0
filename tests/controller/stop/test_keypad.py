"""Keys from input events: golden bytes of a keyboard, split reads, repeats, and devices that are none."""

import fcntl
import os
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from controller.stop.keypad import Keys, Pad, open_device
from controller.stop.word import StopReason
from drivers.evdev.codec import EventParser
from rig.config.stop import Stop
from rig.errors import DeviceError
from tests.controller.descriptors import open_files

# As `evtest` and the kernel's documentation lay them out: scan code, key b down, report; a repeat; its release.
PRESSED_B = bytes.fromhex(
    "5be2a16500000000b0710b0000000000 0400 0400 05000700"
    "5be2a16500000000b0710b0000000000 0100 3000 01000000"
    "5be2a16500000000b0710b0000000000 0000 0000 00000000"
)
HELD_B = bytes.fromhex("5be2a16500000000b0710b0000000000 0100 3000 02000000")
RELEASED_B = bytes.fromhex("5be2a16500000000b0710b0000000000 0100 3000 00000000")


def event(kind: int, code: int, value: int) -> bytes:
    return struct.pack("<qqHHi", 1, 2, kind, code, value)


def test_a_press_is_one_key_and_holding_and_releasing_it_none() -> None:
    parser = EventParser()
    assert parser.feed(PRESSED_B) == [48]
    assert parser.feed(HELD_B * 5 + RELEASED_B) == []


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 0x2FF), st.integers(-1, 2))), st.integers(1, 60))
def test_events_in_pieces_give_the_keys_that_went_down(events: list[tuple[int, int, int]], size: int) -> None:
    data = b"".join(event(*parts) for parts in events)
    parser = EventParser()
    found = [code for at in range(0, len(data), size) for code in parser.feed(data[at : at + size])]
    assert found == [code for kind, code, value in events if (kind, value) == (1, 1)]


@given(st.lists(st.binary(max_size=70), max_size=10))
def test_no_bytes_raise(pieces: list[bytes]) -> None:
    parser = EventParser()
    for piece in pieces:
        parser.feed(piece)


def test_a_key_does_what_it_is_configured_for_and_any_other_key_brakes() -> None:
    codes = Stop().key_codes
    assert codes == {25: "pain", 48: "pain", 31: "stop", 57: "emergency"}
    keys = Keys({48: StopReason.PAIN}, StopReason.EMERGENCY)
    assert (keys.kind(48), keys.kind(99)) == (StopReason.PAIN, StopReason.EMERGENCY)
    assert Stop(keys={"183": "pain", "keypad_enter": "stop"}).key_codes == {183: "pain", 96: "stop"}


@pytest.mark.parametrize("name", ["pedal", "0", "768", "-3", ""])
def test_a_key_that_there_is_not_is_one_sentence(name: str) -> None:
    with pytest.raises(ValidationError, match=f"no key '{name}': write a number from 1 to 767, or esc, backspace"):
        Stop(keys={name: "pain"})


def test_a_device_that_is_not_there_or_is_none_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"stop.keypad /dev/input/none: No such file or directory; ls -l /dev/input"):
        open_device("/dev/input/none")
    (tmp_path / "file").write_bytes(PRESSED_B)
    with pytest.raises(DeviceError, match="is no input device"):
        open_device(str(tmp_path / "file"))
    with pytest.raises(DeviceError, match="is no input device"):
        open_device(str(tmp_path))


def test_a_pad_is_read_without_waiting_and_says_when_it_is_gone(tmp_path: Path) -> None:
    path = tmp_path / "pad"
    os.mkfifo(path)
    writer = os.open(path, os.O_RDWR)
    pad = Pad(str(path), open_device(str(path)))
    assert pad.read() == []
    os.write(writer, PRESSED_B[:30])
    assert pad.read() == []
    os.write(writer, PRESSED_B[30:])
    assert pad.read() == [48]
    os.close(writer)
    with pytest.raises(DeviceError, match="the keypad is gone; plug it in again"):
        pad.read()
    pad.close()


def test_a_device_is_taken_for_this_process_alone_and_given_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, asked = open_files(), list[tuple[int, int, int]]()
    monkeypatch.setattr(fcntl, "ioctl", lambda *values: asked.append(values))
    path = tmp_path / "pad"
    os.mkfifo(path)
    pad = Pad(str(path), open_device(str(path)))
    # EVIOCGRAB of linux/input.h, _IOW('E', 0x90, int): no other program gets the keys.
    assert asked == [(pad.fd, 0x40044590, 1)]
    pad.close()
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(DeviceError, match="is no input device"):
        open_device(str(tmp_path / "file"))
    assert open_files() <= before
