"""Whether the computer itself stood still while a test ran, as processes see that do nothing else.

A virtual machine that is held up for a tenth of a second loses samples and stops benches, as it should, and fails tests
that are about something else. One witness a core, of higher priority than loop and mock bench, writes down when it came
late; a test of the bench that failed meanwhile waits for a quiet moment and runs again, up to three times, and the
summary says so. Without a right to that priority no witness speaks, and nothing is repeated.
"""

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from rig.realtime import ask_fifo, lock_memory, shorten_timer_slack

ROOT = Path(__file__).parents[1]
# Half of the shortest time without a sample that a good trial may have (`gap_ms`, 20 ms).
STALL_MS = 10.0
PERIOD_S = 0.002
AGAIN = 3
QUIET_S, PATIENCE_S = 3.0, 20.0
# Above loop (50) and mock bench, which then cannot hold it up.
PRIORITY = 95


def watch(core: int, file: Path, now_ns: Callable[[], int], goes_on: Callable[[], bool]) -> None:
    """Wakes on ``core`` while ``goes_on``; a line in ``file`` for each wake that came late: end [ns], length [ms]."""
    os.sched_setaffinity(0, {core})
    with file.open("a", buffering=1) as stalls:
        before_ns = now_ns()
        while goes_on():
            time.sleep(PERIOD_S)
            after_ns = now_ns()
            late_ms = (after_ns - before_ns) * 1e-6 - PERIOD_S * 1e3
            if late_ms > STALL_MS:
                stalls.write(f"{after_ns} {late_ms:.1f}\n")
            before_ns = after_ns


class Witness:
    """The plugin: starts the witnesses in the first process, and asks them in each."""

    def __init__(self, file: Path) -> None:
        self.file, self._began_ns = file, 0

    def stalls_ms(self, since_ns: int = 0) -> list[float]:
        """How long the computer stood still, each time that ended after ``since_ns``."""
        lines = self.file.read_text().splitlines() if self.file.exists() else []
        return [float(late) for end, late in map(str.split, lines) if int(end) > since_ns]

    def stood_still(self) -> bool:
        """Whether it did since the newest try of a test began."""
        return bool(self.stalls_ms(self._began_ns))

    def await_quiet(self) -> None:
        """Returns when the computer has not stood still for ``QUIET_S``, and after ``PATIENCE_S`` in any case."""
        end_s = time.monotonic() + PATIENCE_S
        while (now_s := time.monotonic()) < end_s and self.stalls_ms(round((now_s - QUIET_S) * 1e9)):
            time.sleep(0.2)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        if getattr(item, "execution_count", 1) > 1:
            self.await_quiet()
        self._began_ns = time.monotonic_ns()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: Sequence[pytest.Item]) -> None:
        for item in items:
            if item.get_closest_marker("bench"):
                item.add_marker(pytest.mark.flaky(reruns=AGAIN, condition=self.stood_still))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        if found := self.stalls_ms():
            again = sorted({report.nodeid for report in terminalreporter.stats.get("rerun", [])})
            terminalreporter.write_line(
                f"the computer stood still {len(found)} times, for up to {max(found):.0f} ms; run again: "
                + (", ".join(again) or "nothing")
            )


@contextlib.contextmanager
def watched(file: Path) -> Iterator[None]:
    """A witness on each core until the block ends."""
    command = [sys.executable, "-m", "tests.witness", str(file)]
    started = [
        subprocess.Popen([*command, str(core)], cwd=ROOT, stderr=subprocess.DEVNULL) for core in os.sched_getaffinity(0)
    ]
    try:
        yield
    finally:
        for process in started:
            process.terminate()
            process.wait()


def main(file: str, core: str) -> None:
    """One witness, until whoever started it is gone."""
    if refused := ask_fifo(PRIORITY):
        sys.exit(refused)
    lock_memory()
    shorten_timer_slack()
    parent = os.getppid()
    watch(int(core), Path(file), time.monotonic_ns, lambda: os.getppid() == parent)


if __name__ == "__main__":
    main(*sys.argv[1:])
