"""Where tasks run: one after the other, on the cores of this computer, or on those of a Dask cluster."""

import os
import warnings
from collections.abc import Callable, Generator, Sequence
from typing import Any

from api.operations.cohort.task import Task, TaskOutcome, run
from rig.errors import RigError, UsageError

Runner = Callable[[Sequence[Task]], Generator[TaskOutcome]]
# A scheduler on the same network answers in milliseconds; one that is being started takes a few seconds.
TIMEOUT_S = 15.0
RETRIES = 3  # of a session whose worker died: a computer is switched off, and twice more is no accident


def cores() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def one_by_one(tasks: Sequence[Task]) -> Generator[TaskOutcome]:
    """In this process."""
    yield from map(run, tasks)


def on_cores(tasks: Sequence[Task], most: int | None = None) -> Generator[TaskOutcome]:
    """A process for each core, as they finish; raises RigError where one of them dies."""
    from joblib import Parallel, delayed  # noqa: PLC0415 - a tenth of a second
    from joblib.externals.loky.process_executor import TerminatedWorkerError  # noqa: PLC0415

    count = min(most or cores(), len(tasks))
    if count < 2:
        yield from one_by_one(tasks)
        return
    work = Parallel(n_jobs=count, return_as="generator_unordered")
    found = work(delayed(run)(task) for task in tasks)
    try:
        for outcome in found:  # noqa: UP028 - whoever ends early must not end this from within
            yield outcome
    except TerminatedWorkerError as error:
        raise RigError(
            "a process of the cohort was killed, by hand or because memory ran out; what is finished is kept: the same "
            "command goes on from there"
        ) from error
    finally:
        _end(found)


def _end(found: Any) -> None:
    """Ends what still runs. That it is ended early is what somebody asked for, and no warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        found.close()


def on_cluster(address: str) -> Runner:
    """The workers of the Dask scheduler at ``address``; raises UsageError where none answers."""
    try:
        import distributed  # noqa: PLC0415 - half a second
    except ImportError:
        raise UsageError("--scheduler needs Dask, which is not installed: pip install 'tissue-rig[cluster]'") from None
    return lambda tasks: _distributed(distributed, address, tasks)


def _distributed(dask: Any, address: str, tasks: Sequence[Task]) -> Generator[TaskOutcome]:
    client = _connected(dask, address)
    try:
        asked = {future: task for task in tasks for future in [client.submit(run, task, pure=False, retries=RETRIES)]}
        for future in dask.as_completed(asked, loop=client.loop):
            yield _outcome(future, asked[future])
    finally:
        client.close()


def _connected(dask: Any, address: str) -> Any:
    """A client of a scheduler that has workers."""
    try:
        client = dask.Client(address, timeout=TIMEOUT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise UsageError(
            f"--scheduler {address}: no Dask scheduler answers there within {TIMEOUT_S:g} s; start one with "
            f"`dask scheduler`, and give the address it prints ({type(error).__name__})"
        ) from None
    try:
        client.wait_for_workers(1, timeout=TIMEOUT_S)
    except TimeoutError:
        client.close()
        raise UsageError(f"--scheduler {address}: has no workers; start some with `dask worker {address}`") from None
    return client


def _outcome(future: Any, task: Task) -> TaskOutcome:
    """A worker without this program, or one that died too often, is the reason of that session alone."""
    error = future.exception()
    if error is None:
        found: TaskOutcome = future.result()
        return found
    return TaskOutcome(task, {}, 0.0, f"{task.place}: no worker could do it: {type(error).__name__}: {error}")
