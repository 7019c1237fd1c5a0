"""Loops of two benches on one computer take a core each, as long as there are cores."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from controller.loop import realtime

PIN = "from controller.loop import realtime; print(realtime._pin(), flush=True); input()"


@contextmanager
def pinned_loop(state: Path) -> Iterator[str]:
    """What a process says that takes its core and keeps it until the block ends."""
    command, environment = [sys.executable, "-c", PIN], os.environ | {"XDG_STATE_HOME": str(state)}
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, env=environment, text=True) as process:
        assert process.stdin and process.stdout
        yield process.stdout.readline().strip()
        process.stdin.write("\n")


def test_each_loop_takes_the_last_core_that_no_other_has(tmp_path: Path) -> None:
    cores = sorted(os.sched_getaffinity(0), reverse=True)
    if len(cores) < 2:
        pytest.skip("this computer has one core")
    with ExitStack() as loops:
        said = [loops.enter_context(pinned_loop(tmp_path)) for _ in cores]
        assert said == [f"pinned to {core}" for core in cores]
        with pinned_loop(tmp_path) as one_too_many:
            assert one_too_many == f"pinned to {cores[0]}"
    with pinned_loop(tmp_path) as after:
        assert after == f"pinned to {cores[0]}"


def test_a_thread_is_prompt_until_the_block_ends() -> None:
    before = os.sched_getscheduler(0)
    with realtime.promptly(1):
        granted = os.sched_getscheduler(0)
    assert os.sched_getscheduler(0) == before
    if granted == before:
        pytest.skip("real-time priority is not granted here")
    assert granted == os.SCHED_FIFO
    with realtime.promptly(0):
        assert os.sched_getscheduler(0) == before
