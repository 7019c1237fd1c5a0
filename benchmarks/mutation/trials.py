"""One mutant, one forked process: it imports the code under test anew, the mutated file in place of the real one.

The parent has imported everything else (the interpreter's and the packages' modules, pytest, those parts of the
project that are not mutated): a trial costs an import of the controller and the tests that run the mutated line.
"""

import ast
import contextlib
import gc
import importlib
import importlib.abc
import importlib.machinery
import os
import resource
import signal
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import CodeType, ModuleType

import pytest

from benchmarks.mutation.lines import file_of

FRESH = {"controller", "tests", "api", "mock_devices"}
"""Packages that each trial imports anew: those that are mutated, and whatever may have copied a constant of them."""
SLOWEST = 5.0
LEAST_CPU_S = 2.0
"""CPU time a test may take: this and so many times what it took while it was traced. More is an endless loop."""
LONGEST_S = 20.0
"""A mutant that waits for ever takes no CPU time: a trial may last this and so many times what its tests took."""
MEMORY_BYTES = 8 << 30
SURVIVED, KILLED, TIMED_OUT = 0, 1, 3
# pytest itself is imported before the trial.
REWRITTEN = "ignore::pytest.PytestAssertRewriteWarning"
OPTIONS = (
    "-q",
    "-m",
    "not bench",
    "-p",
    "no:xdist",
    "--timeout=60",  # of one test; what ends a trial is below
    "--hypothesis-seed=0",
    "-W",
    REWRITTEN,
)


class Instead(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports modules from code given, each by its name; ``extra`` stands among each module's names."""

    def __init__(self, codes: Mapping[str, CodeType], extra: Mapping[str, Mapping[str, object]] | None = None) -> None:
        self._codes, self._extra = codes, extra or {}

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,  # noqa: ARG002
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> importlib.machinery.ModuleSpec | None:
        if fullname not in self._codes:
            return None
        return importlib.machinery.ModuleSpec(fullname, self, origin=self._codes[fullname].co_filename)

    def exec_module(self, module: ModuleType) -> None:
        module.__dict__.update(self._extra.get(module.__name__, {}))
        exec(self._codes[module.__name__], module.__dict__)


class Budget:
    """A pytest plugin: the tests wanted, in their order, each with its CPU time; the first failure is told."""

    def __init__(self, wanted: Sequence[str], seconds: Mapping[str, float], told: int) -> None:
        self._order = {test: number for number, test in enumerate(wanted)}
        self._seconds, self.told = seconds, told
        self._slowest_s = dict[str, float]()
        for test, test_s in seconds.items():
            self._slowest_s[file_of(test)] = max(test_s, self._slowest_s.get(file_of(test), 0.0))
        self.failed = False

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Tests that only a mutant has (a table's entry under another name) are run too, last."""
        known = [item for item in items if item.nodeid in self._order or item.nodeid not in self._seconds]
        items[:] = sorted(known, key=lambda item: self._order.get(item.nodeid, len(self._order)))

    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """The clock starts."""
        signal.signal(signal.SIGPROF, lambda *_: self._late(item.nodeid))
        signal.setitimer(signal.ITIMER_PROF, self.cpu_s(item.nodeid))

    def cpu_s(self, test: str) -> float:
        """What ``test`` may take, with what its file's tests share, as whichever of them comes first makes that."""
        return LEAST_CPU_S + SLOWEST * self._seconds.get(test, 1.0) + 2.0 * self._slowest_s.get(file_of(test), 0.0)

    def _late(self, test: str) -> None:
        os.write(self.told, f"out of time in {test}".encode())
        os._exit(TIMED_OUT)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """What killed the mutant."""
        if report.failed:
            self.failed = True
            os.write(self.told, report.nodeid.encode())

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """A mutant that cannot even be imported."""
        if report.failed:
            os.write(self.told, f"import, in {report.nodeid}".encode())


@dataclass(frozen=True)
class Verdict:
    """How a trial ended: by which test the mutant was killed, nothing where it survived."""

    killed: bool
    by: str
    seconds: float


@dataclass
class Trial:
    """A trial under way in a process of its own."""

    pid: int
    told: int
    began: float
    longest_s: float = LONGEST_S

    def poll(self) -> Verdict | None:
        """The verdict, once there is one; a trial that takes too long is ended here."""
        pid, status = os.waitpid(self.pid, os.WNOHANG)
        late = time.monotonic() - self.began > self.longest_s
        if not pid and not late:
            return None
        if not pid:
            os.killpg(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
        by = os.read(self.told, 500).decode(errors="replace")
        os.close(self.told)
        code = os.waitstatus_to_exitcode(status) if pid else TIMED_OUT
        seconds = time.monotonic() - self.began
        return Verdict(code != SURVIVED, "" if code == SURVIVED else by or f"ended with {code}", seconds)


def warm(modules: Iterable[str]) -> None:
    """Imports what trials need and never mutate; what would bring mutated modules with it is left to each trial."""
    for name in modules:
        before = set(sys.modules)
        # What cannot be imported by itself is imported by the trial.
        with contextlib.suppress(Exception):
            importlib.import_module(name)
        brought = sys.modules.keys() - before
        if any(_package(found) in FRESH for found in brought):
            for found in brought:
                if _package(found) in {*FRESH, _package(name)}:
                    del sys.modules[found]
    gc.freeze()


def _package(name: str) -> str:
    return name.partition(".")[0]


def imported() -> list[str]:
    """Modules that this process has, those of the packages tried anew left out."""
    return [name for name in sys.modules if _package(name) not in FRESH and name != "__main__"]


def begin(path: Path, module: str, tree: ast.Module, tests: Sequence[str], seconds: Mapping[str, float]) -> Trial:
    """Starts a trial of ``tree`` in place of ``module``."""
    instead = Instead({module: compile(tree, str(path), "exec")})
    told, tell = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.setpgid(0, 0)
        os._exit(_run(instead, Budget(tests, seconds, tell), tests))
    os.close(tell)
    return Trial(pid, told, time.monotonic(), longest_s(tests, seconds))


def longest_s(tests: Iterable[str], seconds: Mapping[str, float]) -> float:
    """How long a trial of these tests may last."""
    return LONGEST_S + SLOWEST * sum(seconds.get(test, 1.0) for test in tests)


def limited() -> None:
    """This process may take so much memory and say nothing."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nothing, stream)


def _run(instead: Instead, budget: Budget, tests: Sequence[str]) -> int:
    limited()
    sys.meta_path.insert(0, instead)
    files = list(dict.fromkeys(file_of(test) for test in tests))
    try:  # the first file alone: most mutants are killed there, and to collect the others takes seconds
        killed = any(part and _tested(part, budget) not in (0, 5) for part in (files[:1], files[1:]))
    except BaseException as error:
        os.write(budget.told, f"{type(error).__name__}: {error}".encode())
        return KILLED
    return KILLED if killed else SURVIVED


def _tested(files: Sequence[str], budget: Budget) -> int:
    return pytest.main([*OPTIONS, "-x", *files], plugins=[budget])
