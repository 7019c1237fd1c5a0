"""An operation on the terminal: progress and live values, keys for pain stop and stop, Ctrl-C retracts."""

import contextlib
import sys
import threading
from collections.abc import Callable, Iterator
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from api.cli.computing import printed
from api.cli.endings import ended_first, interrupt_stops, unhurried
from api.cli.keys import stop_keys
from api.cli.mock_bench import bench_for
from controller.operation import Operation
from controller.operation import Progress as Snapshot
from controller.stop.word import NOT_CONFIRMED, StopReason
from controller.supervisor import Supervisor
from rig.config.wiring import Wiring
from rig.errors import DeviceError

LOOK_S = 0.1
CONFIRM_S = 0.5  # as long as the stop process waits for the loop
NAMES = {StopReason.PAIN: "pain stop", StopReason.EMERGENCY: "emergency stop", StopReason.STOP: "stop"}
KEYS = "keys: p pain stop, space emergency stop, s or Ctrl-C stop and retract"

T = TypeVar("T")


@contextlib.contextmanager
def connected(wiring: Wiring) -> Iterator[Supervisor]:
    """The bench, running; the terminal's keys stop it from before it starts, and while the axis homes.

    A computer that shuts down and a terminal that is closed end the bench first, as Ctrl-C does.
    """
    with stop_keys() as attach, ended_first():
        bench = Supervisor(wiring)
        try:
            bench.prepare()
            attach(lambda kind: _press(bench, kind))
            bench.start()
            bench.refuse_held()
            yield bench
        finally:
            with unhurried():
                bench.close()


@contextlib.contextmanager
def running(wiring: Wiring, hide: tuple[str, ...] = ()) -> Iterator[Supervisor]:
    """The same, on the mock bench where ports say `mock`, with ``hide`` hidden in it."""
    with bench_for(wiring, hide) as (live_wiring, _), connected(live_wiring) as bench:
        yield bench


def _press(bench: Supervisor, kind: StopReason) -> None:
    """Asks for the stop and says what the loop made of it."""
    try:
        coming = bench.loop_is_to_come
        stops = bench.stops
        request = stops.request(kind)
        answer = None if coming else stops.confirmed(request, CONFIRM_S)
    except DeviceError:
        return
    said = answer.text if answer and answer.confirmed else "the bench will not start" if coming else NOT_CONFIRMED
    sys.stderr.write(f"{NAMES[kind]}: {said}\n")


def run(bench: Supervisor, operation: Operation, work: Callable[[], T]) -> T:
    """Runs ``work`` in a thread while the terminal shows how it goes; returns or raises what ``work`` does."""
    operation.watch = printed(operation)
    results: list[T] = []
    errors: list[BaseException] = []

    def worker() -> None:
        try:
            results.append(operation.run(work))
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=worker, name=operation.progress.name)
    with interrupt_stops(bench, operation):
        thread.start()
        _show(bench, operation, thread)
    thread.join()
    if errors:
        raise errors[0]
    return results[0]


def _show(bench: Supervisor, operation: Operation, thread: threading.Thread) -> None:
    screen = Console(stderr=True)
    columns = [TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()]
    with Progress(*columns, TextColumn("{task.fields[live]}"), console=screen, disable=not screen.is_terminal) as bar:
        task = bar.add_task(operation.progress.name, live="")
        if screen.is_terminal:
            bar.print(KEYS)
        while thread.is_alive():
            thread.join(LOOK_S)
            now = operation.progress
            bar.update(task, completed=now.done, total=now.total, description=now.message, live=_live(bench, now))


def _live(bench: Supervisor, now: Snapshot) -> str:
    return live_text(bench) + ("" if now.time_left_s is None else f"  {now.time_left_s:.0f} s left")


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
