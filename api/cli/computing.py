"""An operation that needs no bench on the terminal: a bar that says how far it is, what it says, Ctrl-C ends it."""

from collections.abc import Callable
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from api.cli.output import show
from controller.operation import Operation
from controller.operation import Progress as Snapshot

T = TypeVar("T")


def compute(asked: Operation | str, work: Callable[[Operation], T], prints: bool = True) -> T:
    """``here``, with a bar that says how far it is; where this ``prints`` none, the log is the caller's.

    ``asked``: the operation, or the name of one that has no parts to count.
    """
    operation = Operation(asked) if isinstance(asked, str) else asked
    screen = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=screen, disable=not screen.is_terminal, transient=True) as bar:
        task, say = bar.add_task(operation.progress.name, total=operation.progress.total), printed(operation)

        def watch(now: Snapshot) -> None:
            if prints:
                say(now)
            bar.update(task, description=now.message, completed=now.done)

        operation.watch = watch
        return operation.run(lambda: work(operation))


def here(operation: Operation, work: Callable[[], T]) -> T:
    """Runs ``work`` in this thread, which Ctrl-C ends at once; what the operation says is printed."""
    operation.watch = printed(operation)
    return operation.run(work)


def printed(operation: Operation) -> Callable[[Snapshot], None]:
    """What ``operation`` says from now on, on the terminal, a line each."""
    told = len(operation.progress.log)

    def watch(now: Snapshot) -> None:
        nonlocal told
        show(*now.log[told:])
        told = len(now.log)

    return watch
