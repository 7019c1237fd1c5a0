"""The benchmark of capture times says no to every figure that is not good enough."""

import json
from dataclasses import replace
from typing import Any

import pytest

from benchmarks import clock
from benchmarks.clock import RUNS, Row, missed, row, truths_ns
from rig.channels import ForceSample

MS = 1_000_000
GOOD = [Row(product, load, 2000, 1990, 0, 0, 0.05, 0.12, 0.3, 1.0, 1.1, 0.9) for product, load in RUNS]


def test_good_figures_are_let_pass() -> None:
    assert missed(GOOD) == []
    assert {load for _, load in RUNS} == {"idle", "loaded"} and len({product for product, _ in RUNS}) == 2


@pytest.mark.parametrize("number", range(len(RUNS)))
@pytest.mark.parametrize(
    ("bad", "sentence"),
    [
        ({"error_p99": 0.2}, "99 of 100 capture times off by up to 0.2 ms, not below 0.2 ms"),
        ({"error_p99": float("nan")}, "99 of 100 capture times off by up to nan ms"),
        ({"samples": 1799}, "1799 of 2000 samples came"),
        ({"unmatched": 1}, "1 samples that the bench never took"),
        ({"not_increasing": 1}, "1 capture times do not rise"),
    ],
)
def test_each_bad_figure_of_each_run_is_told(number: int, bad: dict[str, Any], sentence: str) -> None:
    rows = [replace(each, **bad) if each is GOOD[number] else each for each in GOOD]
    (said,) = missed(rows)
    assert said.startswith(f"{RUNS[number][0]}, {RUNS[number][1]}: {sentence}")


@pytest.mark.parametrize("number", range(len(RUNS)))
def test_a_run_that_was_left_out_is_told(number: int) -> None:
    (said,) = missed([each for each in GOOD if each is not GOOD[number]])
    assert said == f"{RUNS[number][0]}, {RUNS[number][1]}: was not measured"


def sample(capture_ms: float, arrival_ms: float, device_us: int) -> ForceSample:
    return ForceSample(0, round(capture_ms * MS), round(arrival_ms * MS), device_us, *(0.0,) * 7, 0, 1)


def test_errors_are_those_against_the_own_times_of_the_bench() -> None:
    taken = [(1, 10 * MS), (2, 11 * MS), (3, 12 * MS)]
    samples = [sample(10.1, 11.0, 1), sample(10.9, 12.0, 2), sample(10.9, 12.5, 9)]
    found = row("bota-sensone", "idle", 3, samples, truths_ns("bota-sensone", samples, taken))
    assert (found.samples, found.unmatched, found.not_increasing) == (3, 1, 1)
    assert found.error_max == pytest.approx(0.1) and found.arrival_p50 == pytest.approx(1.0)


@pytest.mark.parametrize(("bad", "code"), [({}, 0), ({"error_p99": 0.3}, 1)])
def test_the_command_ends_with_1_and_an_object(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], bad: dict[str, Any], code: int
) -> None:
    made = iter([replace(GOOD[0], **bad), *GOOD[1:]])

    class Here:
        def __enter__(self) -> "Here":
            return self

        def __exit__(self, *_: object) -> None:
            """Nothing to end."""

        def submit(self, *_: object) -> "Here":
            return self

        def result(self) -> Row:
            return next(made)

    monkeypatch.setattr(clock, "alone", Here)
    monkeypatch.setattr(clock, "busy", lambda _: Here())
    monkeypatch.setattr("sys.argv", ["clock"])
    assert clock.main() == code
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert last["ok"] is (code == 0) and len(last["missed"]) == code and len(last["runs"]) == len(RUNS)
