"""Which test runs which statement of the mutated files, and how long each test takes: one run with a probe in each.

A probe is an assignment in front of every statement of a function; a trace of all lines would take ten times as long.
"""

import ast
import time
from collections import Counter, defaultdict
from collections.abc import Generator, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import accumulate
from typing import Any, TypeAlias

import pytest

RAN = "__ran__"
Line: TypeAlias = tuple[str, int]
LONGEST = 0.06
"""What the tests for one mutant may take of the time of all, on this computer: 10 s of 160, once for each of some 200
survivors. None of 292 killed in `steps.py` was by a test that comes later; nine in `bench_loop.py` were, so that tests
made for a file come first."""
QUICK = 0.0005
"""Of the time of all, for one test: 0.08 s of 160."""


def with_probes(tree: ast.Module) -> ast.Module:
    """``tree`` with ``__ran__[line] = 1`` in front of every statement within a function."""
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef):
            _probe(function)
    return ast.fix_missing_locations(tree)


def _probe(node: ast.AST) -> None:
    for name in ("body", "orelse", "finalbody"):
        held = getattr(node, name, None)
        if isinstance(held, list) and held and not getattr(node, f"probed_{name}", False):
            setattr(node, f"probed_{name}", True)
            for statement in held:
                _probe(statement)
            setattr(node, name, [part for statement in held for part in (_mark(statement.lineno), statement)])
    for part in (*getattr(node, "handlers", ()), *getattr(node, "cases", ())):
        _probe(part)


def _mark(line: int) -> ast.stmt:
    return ast.parse(f"{RAN}[{line}] = 1").body[0]


@dataclass
class Coverage:
    """What was found out: statements run (by their first line) and CPU seconds taken, by test, and what failed.

    Of a busy computer the clock on the wall would say which tests came when it was busiest.
    """

    lines: dict[str, set[Line]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)

    def noticing(self, path: str, line: int, at_import: bool) -> list[str]:
        """Tests that may notice a change of the statement there; those that take least time and run least code first.

        What runs at import (constants, defaults) is for tests that pass any of the file, or for all where none does,
        and for all quick tests beside them: what a class declares is checked without a line of it. Tests that are made
        for the file come before others. Of more than ``LONGEST`` lets take part, the first: what only others would
        notice counts as survived.
        """
        own = self._own.get(path, set())
        if at_import:
            near = [*(self._passing.get(path) or self.lines)]
            quick_s = QUICK * self._all_s
            near += [test for test in self.lines.keys() - near if file_of(test) in own and self.seconds[test] < quick_s]
        else:
            near = [test for test in self._passing.get(path, ()) if (path, line) in self.lines[test]]
        return self._affordable(sorted(self._quickest(near), key=lambda test: file_of(test) not in own))

    @cached_property
    def _passing(self) -> dict[str, list[str]]:
        """By file of the code: tests that pass any of it."""
        passing = defaultdict[str, list[str]](list)
        for test, ran in self.lines.items():
            for path in {path for path, _ in ran}:
                passing[path].append(test)
        return passing

    @cached_property
    def _own(self) -> dict[str, set[str]]:
        """By file of the code: files of tests that pass most of it and little else."""
        all_ran, here = Counter[str](), defaultdict[str, Counter[str]](Counter)
        for file, (path, _) in {(file_of(test), line) for test, ran in self.lines.items() for line in ran}:
            all_ran[file] += 1
            here[path][file] += 1
        return {path: _made_for(passed, all_ran) for path, passed in here.items()}

    def _affordable(self, tests: list[str]) -> list[str]:
        until = accumulate((self.seconds[test] for test in tests), initial=0.0)
        return [test for test, begins_s in zip(tests, until, strict=False) if begins_s < LONGEST * self._all_s]

    @cached_property
    def _all_s(self) -> float:
        return sum(self.seconds.values())

    def _quickest(self, tests: Iterable[str]) -> list[str]:
        """Of several cases of one test the second counts as twice as long, and so on: other tests notice other things.

        Tenths of a second are what two runs of a test may differ by.
        """
        cases: Counter[str] = Counter()
        rank: dict[str, tuple[float, int, str]] = {}
        for test in sorted(tests, key=lambda test: (self.seconds[test], test)):
            cases[test.partition("[")[0]] += 1
            weight_s = self.seconds[test] * cases[test.partition("[")[0]]
            rank[test] = (round(weight_s, 1), len(self.lines[test]), test)
        return sorted(rank, key=rank.__getitem__)


def _made_for(passed: Mapping[str, int], all_ran: Mapping[str, int]) -> set[str]:
    shares = {file: number**2 / all_ran[file] for file, number in passed.items()}
    return {file for file, share in shares.items() if share > 0.5 * max(shares.values())}


def file_of(test: str) -> str:
    """The file of a test."""
    return test.partition("::")[0]


class Observer:
    """A pytest plugin that notes which probes each test passes, its fixtures included, of one worker's files."""

    def __init__(self, ran: Mapping[str, dict[int, int]], worker: int, workers: int) -> None:
        self.tests = Coverage()
        self._ran = ran
        self._worker, self._workers = worker, workers

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """A file's tests stay together: they share what they set up."""
        files = list(dict.fromkeys(file_of(item.nodeid) for item in items))
        mine = set(files[self._worker :: self._workers])
        items[:] = [item for item in items if file_of(item.nodeid) in mine]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Everything of one test."""
        for lines in self._ran.values():
            lines.clear()
        began_s = time.process_time()
        try:
            return (yield)
        finally:
            self.tests.seconds[item.nodeid] = time.process_time() - began_s
            self.tests.lines[item.nodeid] = {(path, line) for path, lines in self._ran.items() for line in lines}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """A test that fails without any mutant tells nothing."""
        if report.failed:
            self.tests.failed.append(report.nodeid)
