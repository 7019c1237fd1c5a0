"""Stop keys on a terminal: none is lost, whenever it is pressed, and the terminal is as before afterwards."""

import os
import termios
import time
from collections.abc import Callable, Iterator

import pytest

from api.cli.keys import StopKeys
from controller.stop.word import StopReason


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    """Keyboard and program's end."""
    keyboard, program = os.openpty()
    yield keyboard, program
    os.close(keyboard)
    os.close(program)


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def test_keys_are_taken_in_order_and_others_do_nothing(terminal: tuple[int, int]) -> None:
    keyboard, program = terminal
    pressed: list[StopReason] = []
    with StopKeys(program) as keys:
        keys.attach(pressed.append)
        os.write(keyboard, b"xP sq\xff\n")
        until(lambda: len(pressed) == 3)
    assert pressed == [StopReason.PAIN, StopReason.EMERGENCY, StopReason.STOP]


def test_keys_from_before_the_bench_are_handed_over_once_it_is_there(terminal: tuple[int, int]) -> None:
    keyboard, program = terminal
    os.write(keyboard, b"p")
    pressed: list[StopReason] = []
    with StopKeys(program) as keys:
        os.write(keyboard, b" ")
        until(lambda: keys._early == [StopReason.PAIN, StopReason.EMERGENCY])
        keys.attach(pressed.append)
        assert pressed == [StopReason.PAIN, StopReason.EMERGENCY]
        os.write(keyboard, b"s")
        until(lambda: len(pressed) == 3)
        assert keys._early == []


def test_the_terminal_is_given_back_as_it_was(terminal: tuple[int, int]) -> None:
    _, program = terminal
    before = termios.tcgetattr(program)
    with StopKeys(program):
        assert termios.tcgetattr(program) != before
    assert termios.tcgetattr(program) == before


def test_a_terminal_that_is_closed_ends_the_reading_and_nothing_else(terminal: tuple[int, int]) -> None:
    _, program = terminal
    with StopKeys(program) as keys:
        os.dup2(os.open(os.devnull, os.O_RDWR), program)
        until(lambda: not keys._thread.is_alive())
