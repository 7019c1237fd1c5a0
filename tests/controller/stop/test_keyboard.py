"""The keypad of the stop process: presses become requests, and one that is gone is shown and looked for."""

import os
import selectors
import struct
from collections.abc import Iterator
from pathlib import Path

import pytest

from controller.stop.keyboard import Keyboard
from controller.stop.keypad import Keys, open_device
from controller.stop.word import Deed, Keypad, Lane, Requester, Responder, StopReason, StopWord

KEYS = Keys({48: StopReason.PAIN}, StopReason.EMERGENCY)


def press(code: int) -> bytes:
    return struct.pack("<qqHHi", 0, 0, 1, code, 1)


class KeypadServed:
    """A keypad that is a FIFO, and the stop process' way of asking it."""

    def __init__(self, folder: Path, required: bool = False) -> None:
        self.path = folder / "pad"
        self.page = StopWord.create(folder / "a.stop")
        self.loop = Responder(self.page)
        self.selector = selectors.DefaultSelector()
        self.plug_in()
        self.descriptor = open_device(str(self.path))
        self.keyboard = Keyboard(self.page, str(self.path), self.descriptor, KEYS, required)

    def plug_in(self) -> None:
        os.mkfifo(self.path)
        self.writer = os.open(self.path, os.O_RDWR)

    def pull_out(self) -> None:
        self.path.unlink()
        os.close(self.writer)

    def turn(self, now: float) -> None:
        self.keyboard.turn(self.selector, now)
        for key, _ in self.selector.select(0):
            key.data()

    @property
    def shown(self) -> str:
        """What people see of the keypad."""
        return self.page.keypad.name

    def taken(self) -> list[StopReason]:
        """Stops asked for since the last time."""
        kinds = [request.kind for request in self.loop.take(1)]
        self.loop.answer(Deed.HELD, 1)
        return kinds


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    yield tmp_path
    (tmp_path / "a.stop").unlink(missing_ok=True)


def test_presses_are_counted_and_asked_for_in_the_stop_process_own_lane(folder: Path) -> None:
    served = KeypadServed(folder)
    assert served.page.keypad is Keypad.OK
    served.turn(0.0)
    os.write(served.writer, press(48) + press(30) + press(48))
    served.turn(0.1)
    assert served.keyboard.presses == 3
    assert sorted(served.taken()) == sorted([StopReason.PAIN, StopReason.EMERGENCY])
    assert Requester(served.page, Lane.STOP_PROCESS).request(StopReason.STOP).id == 4


@pytest.mark.parametrize(("required", "stops"), [(True, [StopReason.KEYPAD_LOST]), (False, [])])
def test_a_keypad_that_goes_is_told_let_go_and_looked_for_every_second(
    folder: Path, capsys: pytest.CaptureFixture[str], required: bool, stops: list[StopReason]
) -> None:
    served = KeypadServed(folder, required)
    served.turn(0.0)
    served.pull_out()
    served.turn(0.1)
    assert served.shown == "LOST"
    assert served.taken() == stops
    assert capsys.readouterr().err == f"{served.path}: the keypad is gone; plug it in again\n"
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(served.descriptor)
    served.turn(5.0)
    assert served.taken() == stops, "again and again: it cannot be acknowledged away"
    served.plug_in()
    served.turn(5.99)
    assert (served.shown, served.taken()) == ("LOST", [])
    served.turn(6.0)
    assert served.shown == "OK"
    os.write(served.writer, press(48))
    served.turn(6.1)
    assert served.taken() == [StopReason.PAIN]
    served.pull_out()
    served.turn(6.2)
    assert capsys.readouterr().err.startswith(f"{served.path}: the keypad is gone")


def test_without_a_keypad_nothing_is_looked_for(folder: Path) -> None:
    page = StopWord.create(folder / "a.stop")
    keyboard = Keyboard(page, "", -1, KEYS, required=True)
    with selectors.DefaultSelector() as selector:
        keyboard.turn(selector, 100.0)
        assert not selector.get_map()
    keyboard.read(selectors.DefaultSelector())
    assert (page.keypad, Responder(page).take(1)) == (Keypad.NONE, ())
