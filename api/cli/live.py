"""An operation on the terminal: progress and live values, keys for pain stop and stop, Ctrl-C retracts."""

import contextlib
import os
import select
import signal
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator
from types import FrameType
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from controller.operation import Operation
from controller.supervisor import Supervisor
from rig.errors import DeviceError

LOOK_S = 0.1
KEYS = "keys: p pain stop, space emergency stop, s or Ctrl-C stop and retract"

T = TypeVar("T")


def run(bench: Supervisor, operation: Operation, work: Callable[[], T]) -> T:
    """Runs ``work`` in a thread while the terminal shows how it goes; returns or raises what ``work`` does."""
    results: list[T] = []
    errors: list[BaseException] = []

    def worker() -> None:
        try:
            results.append(work())
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=worker, name=operation.progress.name)
    with _interrupt_stops(bench, operation), _keys() as key:
        thread.start()
        _show(bench, operation, thread, key)
    thread.join()
    if errors:
        raise errors[0]
    return results[0]


def _show(bench: Supervisor, operation: Operation, thread: threading.Thread, key: Callable[[], str]) -> None:
    console = Console(stderr=True)
    columns = [TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()]
    with Progress(*columns, TextColumn("{task.fields[live]}"), console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task(operation.progress.name, live="")
        if console.is_terminal:
            bar.print(KEYS)
        while thread.is_alive():
            thread.join(LOOK_S)
            act_on(key(), bench, operation)
            now = operation.progress
            bar.update(task, completed=now.done, total=now.total, description=now.message, live=live_text(bench))


def live_text(bench: Supervisor) -> str:
    """Mode, depth, force and rate as of now, for one line."""
    status = bench.status
    if not status:
        return ""
    depth, force = status.get("depth_mm"), status.get("force_N")
    rates = status.get("rates_Hz", {})
    return " ".join(
        [
            f"{status.get('mode', ''):>8}",
            f"{depth:6.2f} mm" if depth is not None else "  --   mm",
            f"{force:6.2f} N" if force is not None else "  --   N",
            f"{rates.get('force', 0):5.0f} Hz",
        ]
    )


def act_on(key: str, bench: Supervisor, operation: Operation) -> None:
    """What a key does; other keys do nothing."""
    actions = {"p": bench.pain, " ": bench.estop, "s": bench.stop}
    if key in actions:
        operation.stop()
        with contextlib.suppress(DeviceError):
            actions[key]()


@contextlib.contextmanager
def _interrupt_stops(bench: Supervisor, operation: Operation) -> Iterator[None]:
    def interrupted(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - the signature of a handler
        if number == signal.SIGHUP:
            _leave_terminal()
        act_on("s", bench, operation)

    before = {number: signal.signal(number, interrupted) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _leave_terminal() -> None:
    """A terminal that was closed answers every write with an error, which must not end the retraction."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdin, sys.stdout, sys.stderr):
        os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


@contextlib.contextmanager
def _keys() -> Iterator[Callable[[], str]]:
    if not sys.stdin.isatty():
        yield lambda: ""
        return
    fd = sys.stdin.fileno()
    before = termios.tcgetattr(fd)
    tty.setcbreak(fd)
    try:
        yield lambda: sys.stdin.read(1).lower() if select.select([fd], [], [], 0)[0] else ""
    finally:
        termios.tcsetattr(fd, termios.TCSADRAIN, before)
