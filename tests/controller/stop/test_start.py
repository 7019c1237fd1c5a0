"""Stops while the bench starts: taken at any moment, answered with what was done, and no motion afterwards."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from controller.safety.table import BY_PERSON
from controller.stop.start import SENTENCE, StartGuard
from controller.stop.word import Deed, Lane, Requester, Responder, StopReason, StopWord
from rig.errors import DeviceError, SafetyStop

PATIENCE_S = 10.0


@pytest.fixture
def page(tmp_path: Path) -> Iterator[StopWord]:
    page = StopWord.create(tmp_path / "a.stop")
    yield page
    page.close(unlink=True)


def homing(guard: StartGuard) -> None:
    """Moves until it is interrupted, as a driver does."""
    deadline = time.monotonic() + PATIENCE_S
    while not guard.interrupted():
        assert time.monotonic() < deadline
        time.sleep(0.001)
    raise SafetyStop("the axis was braked")


def test_a_stop_before_anything_moves_is_answered_and_nothing_moves(page: StopWord) -> None:
    asking = Requester(page, Lane.STOP_PROCESS)
    moved = []
    with StartGuard(Responder(page)) as guard:
        # Who presses at the stop process is told after half a second that nothing is confirmed.
        answer = asking.confirmed(asking.request(StopReason.PAIN), 0.5)
        with pytest.raises(SafetyStop, match=SENTENCE) as stop, guard.moving():
            moved.append(True)
    assert answer is not None
    assert (answer.deed, moved) == (Deed.START_ENDED, [])
    assert stop.value.code in BY_PERSON


def test_a_stop_from_before_the_start_counts(page: StopWord) -> None:
    asking = Requester(page, Lane.SUPERVISOR)
    request = asking.request(StopReason.EMERGENCY)
    with StartGuard(Responder(page)) as guard, pytest.raises(SafetyStop), guard.moving():
        raise AssertionError("it moved")
    answer = asking.answer(request)
    assert answer is not None
    assert answer.deed is Deed.START_ENDED


def test_a_stop_while_the_axis_homes_is_answered_once_it_is_braked(page: StopWord) -> None:
    asking = Requester(page, Lane.SUPERVISOR)
    with StartGuard(Responder(page)) as guard:
        with pytest.raises(SafetyStop, match="braked") as stop, guard.moving():
            request = asking.request(StopReason.STOP)
            assert asking.confirmed(request, 0.05) is None
            homing(guard)
        answer = asking.answer(request)
    assert answer is not None
    assert answer.deed is Deed.START_BRAKED
    assert stop.value.code in BY_PERSON, "a job that ends so was cancelled, and has not failed"


def test_a_stop_of_the_axis_own_is_nobodys(page: StopWord) -> None:
    with StartGuard(Responder(page)) as guard, pytest.raises(SafetyStop) as stop, guard.moving():
        raise SafetyStop("the end switch was met", "workspace")
    assert (stop.value.code, str(stop.value)) == ("workspace", "the end switch was met")


def test_a_stop_that_a_lost_axis_cannot_follow_is_not_confirmed(page: StopWord) -> None:
    asking = Requester(page, Lane.SUPERVISOR)
    with StartGuard(Responder(page)) as guard:
        with pytest.raises(DeviceError), guard.moving():
            request = asking.request(StopReason.STOP)
            until_seen(guard)
            raise DeviceError("the drive does not answer")
        answer = asking.answer(request)
    assert answer is not None
    assert not answer.confirmed


def until_seen(guard: StartGuard) -> None:
    with pytest.raises(SafetyStop):
        homing(guard)


def test_a_stop_as_homing_ends_ends_the_start(page: StopWord) -> None:
    asking = Requester(page, Lane.SUPERVISOR)
    with StartGuard(Responder(page)) as guard:
        with pytest.raises(SafetyStop, match=SENTENCE), guard.moving():
            request = asking.request(StopReason.STOP)
            until_seen(guard)
        answer = asking.answer(request)
    assert answer is not None
    assert answer.deed is Deed.START_ENDED


def test_without_a_stop_it_starts_and_what_comes_later_is_left_to_the_loop(page: StopWord) -> None:
    asking, responder = Requester(page, Lane.SUPERVISOR), Responder(page)
    with StartGuard(responder) as guard, guard.moving():
        assert not guard.interrupted()
    request = asking.request(StopReason.STOP)
    assert asking.confirmed(request, 0.05) is None
    assert responder.take(1) == (request,)


def test_the_look_out_is_a_daemon_that_ends_with_the_start(page: StopWord) -> None:
    with StartGuard(Responder(page)) as guard:
        thread = guard._thread
        assert (thread.name, thread.daemon, thread.is_alive()) == ("stop-word", True, True)
    assert not thread.is_alive()


def test_a_stop_after_the_axis_has_homed_is_answered_while_the_bench_still_starts(page: StopWord) -> None:
    asking = Requester(page, Lane.SUPERVISOR)
    with StartGuard(Responder(page)) as guard:
        with guard.moving():
            pass
        request = asking.request(StopReason.PAIN)
        guard.look()
        answer = asking.answer(request)
    assert answer and answer.deed is Deed.START_ENDED
