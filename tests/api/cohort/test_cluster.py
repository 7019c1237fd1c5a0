"""A cohort on a real Dask scheduler with two workers, one of which is killed while it works."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from pathlib import Path

import pytest

from api.operations.cohort.cohort import cohort, cohort_operation
from api.operations.cohort.runners import on_cluster, one_by_one
from api.operations.cohort.task import Task, TaskOutcome
from api.operations.cohort.wanted import Wanted
from rig.errors import UsageError

pytestmark = [pytest.mark.bench, pytest.mark.xdist_group("cluster"), pytest.mark.timeout(180)]
FIT = Wanted("fit")
PROGRAM = (sys.executable, "-m", "dask")


def started(*arguments: str | Path) -> subprocess.Popen[bytes]:
    quiet = subprocess.DEVNULL
    return subprocess.Popen([*PROGRAM, *map(str, arguments)], stdout=quiet, stderr=quiet)


@contextlib.contextmanager
def ended(*processes: subprocess.Popen[bytes]) -> Iterator[None]:
    try:
        yield
    finally:
        for process in processes:
            process.kill()
        for process in processes:
            process.wait()


def until(there: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 60.0
    while not there():
        assert time.monotonic() < deadline_s, "a process of Dask did not start within a minute"
        time.sleep(0.1)


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    file = tmp_path_factory.mktemp("scheduler") / "where.json"
    arguments = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-jupyter")
    process = started("scheduler", *arguments, "--scheduler-file", file)
    with ended(process):
        until(lambda: file.exists() and bool(file.read_text()))
        yield str(json.loads(file.read_text())["address"])


def test_a_scheduler_without_workers_is_said(
    scheduler: str, sessions: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("api.operations.cohort.runners.TIMEOUT_S", 2.0)
    with pytest.raises(UsageError, match="has no workers; start some with `dask worker tcp://"):
        list(on_cluster(scheduler)([Task.of("first", sessions[0], FIT, None)]))


def test_a_cohort_outlives_a_worker_that_is_killed(
    scheduler: str, sessions: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Without nannies nobody starts it again, and only the scheduler knows what it had.
    alone = ("--no-nanny", "--nthreads", "1", "--no-dashboard", "--local-directory", tmp_path)
    workers = [started("worker", scheduler, *alone) for _ in range(2)]
    killed: list[int] = []

    def cut(tasks: Sequence[Task]) -> Generator[TaskOutcome]:
        from distributed import Client  # noqa: PLC0415

        with Client(scheduler, set_as_default=False) as client:  # type: ignore[no-untyped-call]
            client.wait_for_workers(2, timeout=60)
        for outcome in on_cluster(scheduler)(tasks):
            if not killed:
                os.kill(workers[0].pid, signal.SIGKILL)
                killed.append(workers[0].wait())
            yield outcome

    with ended(*workers):
        found = cohort(cohort_operation(FIT, sessions), sessions, tmp_path / "cluster", FIT, cut)
    assert killed == [-signal.SIGKILL]
    assert [each.state for each in found.sessions] == ["done"] * len(sessions)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
    serial = cohort(cohort_operation(FIT, sessions), sessions, tmp_path / "serial", FIT, one_by_one)
    assert found.parameters == serial.parameters
    for place in sessions:
        for name in ("fit.json", "model.json", "table.csv"):
            one, two = (tmp_path / kind / place.name / name for kind in ("cluster", "serial"))
            assert one.read_bytes() == two.read_bytes()
