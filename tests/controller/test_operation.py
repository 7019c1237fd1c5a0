"""How far work is, how long the rest takes, what it said, and how it ended."""

import pytest

from controller.operation import Cancelled, Operation, Progress
from rig.errors import DataError, SafetyStop


class Clock:
    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def test_the_time_left_is_what_the_rest_takes_at_the_pace_so_far() -> None:
    clock = Clock()
    operation = Operation("capture", total=4, unit="trials", now_s=clock)
    assert operation.progress.time_left_s is None
    clock.now_s += 10.0
    operation.advance(1, "second")
    assert operation.progress.time_left_s == pytest.approx(30.0)
    clock.now_s += 12.0
    assert operation.progress.time_left_s == pytest.approx(18.0)
    operation.advance(2, "third")
    assert operation.progress.time_left_s == pytest.approx(22.0)
    clock.now_s += 60.0
    assert operation.progress.time_left_s == pytest.approx(0.0, abs=0.0)
    operation.run(lambda: None)
    assert operation.progress.time_left_s is None


def test_the_time_left_of_what_is_planned_is_that_of_its_plan() -> None:
    clock = Clock()
    operation = Operation("track", total=2, unit="runs", now_s=clock)
    operation.expect(30.0)
    assert operation.progress.time_left_s == pytest.approx(30.0)
    clock.now_s += 20.0
    operation.advance(1, "second")
    assert operation.progress.time_left_s == pytest.approx(10.0)
    clock.now_s += 20.0
    assert operation.progress.time_left_s == pytest.approx(0.0, abs=0.0)
    operation.run(lambda: None)
    assert operation.progress.time_left_s is None


def test_the_log_is_watched_as_it_grows() -> None:
    operation, seen = Operation("capture"), list[Progress]()
    operation.watch = seen.append
    operation.say("one", "two")
    operation.say("three")
    assert [now.log for now in seen] == [("one", "two"), ("one", "two", "three")]


def test_what_work_returns_is_its_result() -> None:
    operation = Operation("fit")
    assert operation.run(lambda: 5) == 5
    assert (operation.progress.state, operation.progress.message, operation.progress.result) == ("succeeded", "done", 5)


def raising(error: BaseException) -> None:
    raise error


@pytest.mark.parametrize(
    ("error", "state", "message"),
    [
        (SafetyStop("stopped: pain stop"), "stopped", "stopped: pain stop"),
        (KeyboardInterrupt(), "stopped", "interrupted"),
        (DataError("no trial"), "failed", "no trial"),
        (ValueError("odd"), "failed", "the job met an error of its own: ValueError: odd"),
    ],
)
def test_how_work_ended_is_told_and_raised(error: BaseException, state: str, message: str) -> None:
    operation = Operation("fit")
    with pytest.raises(type(error)):
        operation.run(lambda: raising(error))
    assert (operation.progress.state, operation.progress.message) == (state, message)


def test_a_computation_that_is_cancelled_ends_before_its_next_step() -> None:
    operation, done = Operation("diagnose", total=3, unit="causes"), list[str]()

    def work() -> None:
        for step in ("first", "second", "third"):
            operation.step(step, len(done))
            done.append(step)
            if step == "second":
                operation.cancel()

    with pytest.raises(Cancelled, match="diagnose was cancelled before: third"):
        operation.run(work)
    assert done == ["first", "second"]
    assert operation.progress.state == "stopped"
    assert operation.progress.done == 1
