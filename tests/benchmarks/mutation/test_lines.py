"""Probes change nothing of what the code does and name every statement that ran."""

import ast
from typing import Any

from benchmarks.mutation.lines import RAN, Coverage, with_probes

SOURCE = '''
def sign(x):
    """A docstring."""
    if x > 0:
        return 1
    elif x < 0:
        return -1
    try:
        y = 1 / x
    except ZeroDivisionError:
        y = 0
    finally:
        done = True
    match y:
        case 0:
            return [
                0,
            ][0]
'''


def ran(x: int) -> tuple[object, list[int]]:
    names: dict[str, Any] = {RAN: {}}
    exec(compile(with_probes(ast.parse(SOURCE)), "sign", "exec"), names)
    return names["sign"](x), sorted(names[RAN])


def test_each_statement_that_ran_is_named_by_its_first_line() -> None:
    assert ran(5) == (1, [3, 4, 5])
    assert ran(-5) == (-1, [3, 4, 6, 7])
    assert ran(0) == (0, [3, 4, 6, 8, 9, 11, 13, 14, 16])


def test_a_change_in_a_function_is_for_the_tests_that_run_it_and_a_constant_for_those_of_its_file() -> None:
    tests = Coverage(
        lines={
            "own": {("a.py", 1), ("a.py", 2)},
            "near": {("a.py", 1), ("b.py", 1), ("b.py", 2)},
            "other": {("b.py", 1)},
        },
        seconds={"own": 0.04, "near": 0.01, "other": 2.0},
    )
    assert tests.noticing("a.py", 1, at_import=False) == ["own", "near"]
    assert tests.noticing("a.py", 2, at_import=False) == ["own"]
    assert tests.noticing("a.py", 7, at_import=True) == ["own", "near"]
    assert tests.noticing("c.py", 7, at_import=True) == ["own", "near", "other"], "of all, as far as time goes"


def test_a_second_case_of_a_test_comes_after_others_and_what_takes_too_long_not_at_all() -> None:
    seconds = {"a[1]": 0.1, "a[2]": 0.1, "a[3]": 0.1, "b": 0.1, "c": 7.0, "d": 7.1}
    tests = Coverage(lines={test: {("a.py", 1)} for test in seconds}, seconds=seconds)
    # Twice 0.1 s, 2 times 0.1 and 3 times 0.1 s; c begins after 0.4 s of the 0.9 s there are, d after 7.4 s.
    assert tests.noticing("a.py", 1, at_import=False) == ["a[1]", "b", "a[2]", "a[3]", "c"]
    slow = Coverage(lines=tests.lines, seconds={test: 3 * seconds_taken for test, seconds_taken in seconds.items()})
    assert slow.noticing("a.py", 1, at_import=False) == tests.noticing("a.py", 1, at_import=False)


def test_a_declaration_is_also_for_quick_tests_beside_those_that_run_its_file() -> None:
    tests = Coverage(
        lines={"f.py::runs": {("a.py", 1)}} | {test: set() for test in ("f.py::declares", "f.py::slow", "g.py::other")},
        seconds={"f.py::runs": 0.5, "f.py::declares": 0.001, "f.py::slow": 0.3, "g.py::other": 30.0},
    )
    assert tests.noticing("a.py", 7, at_import=True) == ["f.py::declares", "f.py::runs"]
    assert tests.noticing("a.py", 1, at_import=False) == ["f.py::runs"]
