"""The runner itself, on a small project with known gaps in its tests, run as the command runs it."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from benchmarks.mutation import trials
from benchmarks.mutation.__main__ import ROOT
from benchmarks.mutation.trials import LEAST_CPU_S, SLOWEST, Budget

GUARD = '''"""Too much force stops."""
LIMIT_N = 15.0


def stops(force_N):
    return force_N > LIMIT_N


def within(force_N, low_N, high_N):
    return min(max(force_N, low_N), high_N)
'''
ENDLESS = """

def count(limit):
    number = 0
    while number < limit:
        number += 1
    return number
"""
TESTS = """from planted import guard


def test_stops():
    assert guard.stops(15.1) and not guard.stops(15.0)


def test_within():
    assert [guard.within(force_N, 1, 2) for force_N in (0, 1.5, 3)] == [1, 1.5, 2]
"""
COUNTS = """

def test_counts():
    assert guard.count(3) == 3 and guard.count(0) == 0
"""
AT_LIMIT = "stops: force_N > LIMIT_N -> force_N >= LIMIT_N"


def project(folder: Path, guard: str, tests: str, *survivors: str) -> None:
    (folder / "planted").mkdir()
    (folder / "planted" / "__init__.py").write_text("")
    (folder / "planted" / "guard.py").write_text(guard)
    (folder / "test_guard.py").write_text(tests)
    lists(folder, *survivors)


def lists(folder: Path, *survivors: str) -> None:
    (folder / "survivors.toml").write_text(
        '["planted/guard.py"]\n' + "".join(f'"{name}" = "planted"\n' for name in survivors)
    )


def run(folder: Path) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "benchmarks.mutation", "--root", str(folder), "--only", "planted/guard.py",
               "--survivors", str(folder / "survivors.toml"), "--json", str(folder / "verdicts.json"),
               "--jobs", "1", "--tests=test_guard.py"]  # fmt: skip
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)


def verdicts(folder: Path) -> dict[str, dict[str, Any]]:
    return {row["mutant"]: row for row in json.loads((folder / "verdicts.json").read_text())}


def test_complete_tests_kill_all_an_endless_loop_is_ended_and_a_list_that_says_too_much_refused(tmp_path: Path) -> None:
    project(tmp_path, GUARD + ENDLESS, TESTS + COUNTS, AT_LIMIT, "stops: gone")
    done = run(tmp_path)
    found = verdicts(tmp_path)
    assert json.loads(done.stdout.splitlines()[-1]) == {
        "mutants": len(found), "killed": len(found), "share": 1.0, "modules": {"planted/guard.py": [len(found)] * 2}
    }  # fmt: skip
    assert found[AT_LIMIT]["by"] == "test_guard.py::test_stops"
    assert found["module: 15.0 -> 16.0"]["by"] == "test_guard.py::test_stops"
    assert found["count: number += 1 -> number -= 1"]["by"] == "out of time in test_guard.py::test_counts"
    assert f"planted/guard.py:6: listed, but killed by test_guard.py::test_stops: {AT_LIMIT}" in done.stdout
    assert "planted/guard.py: listed, but no mutant: stops: gone" in done.stdout
    assert done.returncode == 1


def test_a_gap_in_the_tests_is_reported_until_it_is_listed(tmp_path: Path) -> None:
    project(tmp_path, GUARD, TESTS.replace("guard.stops(15.0)", "guard.stops(0.0)"))
    done = run(tmp_path)
    assert done.returncode == 1
    assert f"planted/guard.py:6: survived and is not listed: {AT_LIMIT}" in done.stdout
    assert [row["mutant"] for row in verdicts(tmp_path).values() if not row["killed"]] == [AT_LIMIT]
    lists(tmp_path, AT_LIMIT)
    assert run(tmp_path).returncode == 0


def test_what_brings_a_mutated_module_with_it_is_left_to_the_trial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Imported before the trial began, the unchanged module stood in the mutant's place, and each mutant survived."""
    (tmp_path / "mutated_here.py").write_text("")
    (tmp_path / "brings_it.py").write_text("import mutated_here")
    (tmp_path / "needed_by_all.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(trials, "FRESH", {"mutated_here"})
    trials.warm(["needed_by_all", "brings_it"])
    assert {"needed_by_all", "brings_it", "mutated_here"} & sys.modules.keys() == {"needed_by_all"}


def test_a_fixture_that_a_file_shares_may_take_its_time_whichever_test_comes_first() -> None:
    budget = Budget(["f.py::a"], {"f.py::a": 0.01, "f.py::makes_it": 2.0, "g.py::b": 9.0}, told=-1)
    assert budget.cpu_s("f.py::a") == LEAST_CPU_S + SLOWEST * 0.01 + 2.0 * 2.0
    assert budget.cpu_s("only_a_mutant_has.py::c") == LEAST_CPU_S + SLOWEST


@pytest.mark.extra
def test_a_file_with_too_many_gaps_fails_although_all_are_listed(tmp_path: Path) -> None:
    project(tmp_path, GUARD, TESTS[: TESTS.index("def test_within")])
    run(tmp_path)
    survived = [row["mutant"] for row in verdicts(tmp_path).values() if not row["killed"]]
    lists(tmp_path, *survived)
    done = run(tmp_path)
    assert len(survived) > 1
    assert done.returncode == 1
    assert "mutants are killed, fewer than 90%" in done.stdout
    assert "survived and is not listed" not in done.stdout


def test_tests_that_fail_without_a_mutant_are_named_and_nothing_is_counted(tmp_path: Path) -> None:
    project(tmp_path, GUARD, TESTS.replace("15.1", "14.9"))
    done = run(tmp_path)
    assert done.returncode == 1
    assert "without any mutant tests fail: test_guard.py::test_stops" in done.stderr
    assert '"mutants"' not in done.stdout
