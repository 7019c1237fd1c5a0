"""What takes long has its place in a list, and each commit runs a quarter of it."""

import ast
from itertools import chain
from pathlib import Path

import pytest

from mock_devices.testing.commands import ROOT
from tests.long import SHARE, is_drawn, listed

pytest_plugins = ["pytester"]
NAMES = [f"tests/some/test_{name}.py::test_it[{at}]" for name in ("one", "other") for at in range(300)]


def nowhere(named: str) -> bool:
    """Whether no file has a test of that name."""
    path, _, name = named.partition("::")
    file = ROOT / path
    return not file.exists() or name not in {
        node.name for node in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(node, ast.FunctionDef)
    }


def test_every_test_in_the_list_is_there() -> None:
    assert listed()
    assert not [named for named in sorted(listed()) if nowhere(named)]
    assert nowhere("tests/test_long.py::test_that_was_renamed")
    assert nowhere("tests/test_removed.py::test_every_test_in_the_list_is_there")


def test_as_many_draws_as_there_are_shares_run_each_test_once_and_none_much_more_than_another() -> None:
    drawn = [[name for name in NAMES if is_drawn(name, seed)] for seed in range(7, 7 + SHARE)]
    assert sorted(chain.from_iterable(drawn)) == sorted(NAMES)
    assert all(len(part) > len(NAMES) / SHARE / 2 for part in drawn)


@pytest.mark.parametrize(
    ("options", "run"),
    [
        ((), {"short", "always", "long[0]", "long[1]", "long[2]"}),
        (("-m", "not long"), {"short", "always"}),
        (("-m", "long"), {"long[0]", "long[1]", "long[2]"}),
    ],
)
def test_what_is_listed_is_selected_by_its_marker(
    pytester: pytest.Pytester, options: tuple[str, ...], run: set[str]
) -> None:
    made(pytester)
    assert passed(pytester, *options) == {f"test_made.py::test_{name}" for name in run}


def test_a_draw_leaves_out_the_same_whatever_the_worker(pytester: pytest.Pytester) -> None:
    made(pytester)
    drawn = [passed(pytester, "--draw", str(seed)) for seed in range(SHARE)]
    always = "test_made.py::test_always"
    assert all(always in part for part in drawn)
    assert sorted(chain.from_iterable(part - {always} for part in drawn)) == sorted(passed(pytester) - {always})
    assert passed(pytester, "--draw", "1", "-n", "2") == drawn[1]


def made(pytester: pytest.Pytester) -> Path:
    """A short test, one that every draw keeps, and one of three parameters that is listed."""
    pytester.makeini("[pytest]\nmarkers =\n  long\n  every_commit\n")
    pytester.makeconftest(
        f"import sys\nsys.path.insert(0, {str(ROOT)!r})\nfrom tests.long import LongTests\n"
        "def pytest_addoption(parser):\n    parser.addoption('--draw', type=int)\n"
        "def pytest_configure(config):\n    config.pluginmanager.register(LongTests(['test_made.py::test_long']))\n"
    )
    return pytester.makepyfile(
        test_made="import pytest\ndef test_short(): pass\n@pytest.mark.every_commit\ndef test_always(): pass\n"
        "@pytest.mark.parametrize('at', range(3))\ndef test_long(at): pass\n"
    )


def passed(pytester: pytest.Pytester, *options: str) -> set[str]:
    """What ran."""
    answer = pytester.runpytest_subprocess("-v", "-p", "no:cacheprovider", *options)
    lines = [line for line in answer.outlines if "PASSED" in line]
    return {next(word for word in line.split() if word.startswith("test_made.py")) for line in lines}
