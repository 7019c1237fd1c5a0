"""Mutants of functions, tried in place: everything is imported and collected once, and each trial is a fork of that.

The fork gives the function its mutated code (``__code__``), which holds wherever the function was imported to or is
bound, and runs the tests that pass through the changed statement. What runs at import cannot be tried this way.
"""

import ast
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from types import CodeType, FunctionType, ModuleType

import pytest

from benchmarks.mutation.trials import KILLED, OPTIONS, SURVIVED, Budget, Trial, limited, longest_s


def function_of(module: ModuleType, scope: str) -> FunctionType | None:
    """The outermost function around ``scope`` (``Class.method``, ``function.inner``); None where there is none."""
    held: object = module
    for name in scope.split("."):
        held = _plain(vars(held).get(name)) if isinstance(held, ModuleType | type) else None
        if isinstance(held, FunctionType):
            return held if held.__module__ == module.__name__ else None
    return None


def _plain(held: object) -> object:
    """The function behind a property, class method or decorator that says what it wraps."""
    if isinstance(held, property):
        held = held.fget
    elif isinstance(held, staticmethod | classmethod):
        held = held.__func__
    elif isinstance(held, cached_property):
        held = held.func
    while not isinstance(held, type) and hasattr(held, "__wrapped__"):
        held = held.__wrapped__
    return held


def codes_in(code: CodeType) -> Iterator[CodeType]:
    """All code objects within ``code``."""
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield part
            yield from codes_in(part)


def patch(function: FunctionType, tree: ast.Module, path: str) -> bool:
    """Gives ``function`` the code it has in ``tree``; False where the two do not fit."""
    name = function.__qualname__
    found = [code for code in codes_in(compile(tree, path, "exec")) if code.co_qualname == name]
    if len(found) != 1 or found[0].co_freevars != function.__code__.co_freevars:
        return False
    function.__code__ = found[0]
    return True


class Collected:
    """A pytest plugin: once all tests are collected, ``campaign`` is called with ``begin`` instead of running them."""

    def __init__(self, campaign: Callable[["Collected"], None], seconds: Mapping[str, float]) -> None:
        self._campaign, self._seconds = campaign, seconds
        self._items: dict[str, pytest.Item] = {}

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Tries the mutants; that no test ran here is no failure."""
        self._items = {item.nodeid: item for item in session.items}
        self._campaign(self)
        return True

    def begin(self, function: FunctionType, tree: ast.Module, path: str, tests: Sequence[str]) -> Trial:
        """Starts a trial in a fork of this process."""
        told, tell = os.pipe()
        pid = os.fork()
        if pid == 0:
            os.setpgid(0, 0)
            limited()
            os._exit(self._run(Budget(tests, self._seconds, tell), lambda: patch(function, tree, path), tests))
        os.close(tell)
        return Trial(pid, told, time.monotonic(), longest_s(tests, self._seconds))

    def _run(self, budget: Budget, change: Callable[[], bool], tests: Sequence[str]) -> int:
        items = [self._items[test] for test in tests if test in self._items]
        if not items:
            return SURVIVED
        items[0].config.pluginmanager.register(budget)
        try:
            change()
            for item, following in zip(items, [*items[1:], None], strict=True):
                item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
                if budget.failed:
                    return KILLED
        except BaseException as error:
            os.write(budget.told, f"{type(error).__name__}: {error}".encode())
            return KILLED
        return SURVIVED


def collect(arguments: Sequence[str], campaign: Callable[[Collected], None], seconds: Mapping[str, float]) -> None:
    """Collects the tests and calls ``campaign``; without pytest's capturing, which is for one process."""
    pytest.main([*OPTIONS, "-s", *arguments], plugins=[Collected(campaign, seconds)])
