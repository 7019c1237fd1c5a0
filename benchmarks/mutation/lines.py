"""Which test runs which line of the mutated files, and how long each test takes: one traced run of all of them."""

import sys
import time
from collections.abc import Generator, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, TypeAlias

import pytest

Line: TypeAlias = tuple[str, int]


@dataclass
class Tests:
    """What was found out: lines run and seconds taken, by test, and what failed."""

    lines: dict[str, set[Line]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)

    def noticing(self, path: str, first_line: int, last_line: int, at_import: bool) -> list[str]:
        """Tests that may notice a change of these lines, those that take least time and run least code first.

        What runs at import (constants, defaults) may be used anywhere: first come tests of the same file, then all.
        """
        changed = {(path, line) for line in range(first_line, last_line + 1)}
        near = self._quickest(test for test, lines in self.lines.items() if lines & changed)
        if not at_import:
            return near
        same = self._quickest(test for test, lines in self.lines.items() if any(at == path for at, _ in lines))
        return list(dict.fromkeys([*near, *same, *self._quickest(self.lines)]))

    def _quickest(self, tests: Iterable[str]) -> list[str]:
        return sorted(tests, key=lambda test: (round(self.seconds[test], 1), len(self.lines[test])))


class Tracer:
    """A pytest plugin that traces each test's call, fixtures included, through the files given."""

    def __init__(self, files: Mapping[str, str]) -> None:
        self.tests = Tests()
        self._files, self._here = files, set[Line]()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Everything of one test."""
        self._here = self.tests.lines[item.nodeid] = set()
        began = time.perf_counter()
        sys.settrace(self._enter)
        try:
            return (yield)
        finally:
            sys.settrace(None)
            self.tests.seconds[item.nodeid] = time.perf_counter() - began

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """A test that fails without any mutant tells nothing."""
        if report.failed:
            self.tests.failed.append(report.nodeid)

    def _enter(self, frame: FrameType, event: str, argument: object) -> Any:  # noqa: ARG002
        path = self._files.get(frame.f_code.co_filename)
        if path is None:
            return None
        here = self._here
        here.add((path, frame.f_code.co_firstlineno))

        def line(inner: FrameType, event: str, argument: object) -> Any:  # noqa: ARG001
            here.add((path, inner.f_lineno))
            return line

        return line


def traced(arguments: Iterable[str], root: Path, paths: Iterable[str]) -> Tests:
    """Runs pytest in this process with the tracer."""
    tracer = Tracer({str(root / path): path for path in paths})
    pytest.main(["-q", *arguments], plugins=[tracer])
    return tracer.tests
