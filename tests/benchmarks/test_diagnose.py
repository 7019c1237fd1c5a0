"""The benchmark of the diagnosis: its sessions are what it says, and each goal that is missed is told."""

import json

import numpy as np
import pytest

from benchmarks.diagnose import CASES, SECONDS, Case, Took, bench_of, cycles_of, missed, summary
from benchmarks.hidden.truth import trajectory


def took(name: str, cpu_s: float) -> Took:
    return Took(cpu_s, 300.0, CASES[name].causes)


GOOD = {"one": took("one", 9.0), "three": took("three", 29.0), "hundred": took("hundred", 35.0)}


def test_trials_take_eight_seconds_at_a_kilohertz_and_press_seven_millimetres() -> None:
    bench, cycles = cycles_of(Case(2, (), 0.0))
    for cycle in cycles:
        assert len(cycle.time_s) == pytest.approx(1000 * SECONDS, abs=5)
        assert np.median(np.diff(cycle.time_s)) == pytest.approx(1e-3)
        assert cycle.axis_mm.max() == pytest.approx(bench.surface + 7.0, abs=0.05)


def test_every_speed_is_held_as_long_as_it_takes() -> None:
    assert len(trajectory(bench_of(15, np.random.default_rng(1)))) == pytest.approx(4000 * SECONDS, abs=2)


def test_what_meets_its_goals_is_said_to() -> None:
    assert missed(GOOD) == []
    assert json.loads(summary(GOOD, 5.0))["met"] is True


@pytest.mark.parametrize(
    ("name", "worse", "told"),
    [
        ("one", took("one", 10.1), "one: 10.1 s"),
        ("three", took("three", 31.0), "three: 31.0 s"),
        ("hundred", took("hundred", 36.5), "hundred: 4.1 times"),
        ("one", Took(9.0, 300.0, ("backlash",)), "one: backlash was named"),
        ("three", Took(9.0, 300.0, ()), "three: nothing was named"),
    ],
)
def test_each_goal_that_is_missed_is_told(name: str, worse: Took, told: str) -> None:
    [line] = missed(GOOD | {name: worse})
    assert line.startswith(told)
    assert json.loads(summary(GOOD | {name: worse}, 5.0))["met"] is False
