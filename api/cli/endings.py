"""Signals that end a command: the bench is stopped first, and the tip comes out, whoever closes what."""

import contextlib
import os
import signal
import sys
from collections.abc import Callable, Iterator
from types import FrameType

from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.errors import DeviceError

ENDINGS = (signal.SIGTERM, signal.SIGHUP)  # a computer that shuts down, a terminal that is closed

Handler = Callable[[int, FrameType | None], None]


def ended_first() -> contextlib.AbstractContextManager[None]:
    """Where the bench starts and runs: it is ended as by Ctrl-C."""
    return _on_signals(_end, *ENDINGS)


def unhurried() -> contextlib.AbstractContextManager[None]:
    """Where the bench ends already."""
    return _on_signals(_let_end, *ENDINGS)


@contextlib.contextmanager
def interrupt_stops(bench: Supervisor, operation: Operation) -> Iterator[None]:
    """What is under way is stopped, and the tip retracts."""

    def interrupted(number: int, frame: FrameType | None) -> None:
        _let_end(number, frame)
        operation.cancel()
        with contextlib.suppress(DeviceError):
            bench.stop()

    with _on_signals(interrupted, signal.SIGINT, *ENDINGS):
        yield


@contextlib.contextmanager
def _on_signals(handler: Handler, *numbers: signal.Signals) -> Iterator[None]:
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def _end(number: int, frame: FrameType | None) -> None:
    """As Ctrl-C does, once: a shell and the kernel both say that a terminal was closed."""
    for ending in ENDINGS:
        signal.signal(ending, _let_end)
    _let_end(number, frame)
    raise KeyboardInterrupt


def _let_end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - the signature of a handler
    """What ends already is not hurried."""
    if number == signal.SIGHUP:
        _leave_terminal()


def _leave_terminal() -> None:
    """A terminal that was closed answers every write with an error, which must not end the retraction."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdin, sys.stdout, sys.stderr):
        os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
