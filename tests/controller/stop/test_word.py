"""The stop word: every request is taken once, answered by its id, and none covers another."""

import errno
import os
import threading
import time
import timeit
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.stop.word import (
    DEEDS,
    Deed,
    Keypad,
    Lane,
    Requester,
    Responder,
    StopOutcome,
    StopReason,
    StopRequest,
    StopWord,
)
from rig.errors import DeviceError
from tests.controller.descriptors import open_files


@pytest.fixture
def page(tmp_path: Path) -> Iterator[StopWord]:
    page = StopWord.create(tmp_path / "a.stop")
    yield page
    page.close(unlink=True)


def test_a_request_is_taken_until_it_is_answered_and_the_answer_has_its_id_and_time(page: StopWord) -> None:
    asking, loop = Requester(page, Lane.SUPERVISOR), Responder(page)
    assert loop.take(1) == ()
    request = asking.request(StopReason.PAIN)
    assert asking.answer(request) is None
    assert loop.take(2) == loop.take(3) == (request,)
    loop.answer(Deed.RETRACTING, 4)
    assert asking.answer(request) == StopOutcome(request.id, Deed.RETRACTING, 4)
    assert loop.take(5) == ()


def test_a_second_press_is_a_request_of_its_own(page: StopWord) -> None:
    asking, loop = Requester(page, Lane.STOP_PROCESS), Responder(page)
    first = asking.request(StopReason.PAIN)
    loop.take(1)
    loop.answer(Deed.RETRACTING, 1)
    second = asking.request(StopReason.PAIN)
    assert second.id > first.id
    assert asking.answer(second) is None
    assert loop.take(2) == (second,)
    loop.answer(Deed.HELD, 2)
    assert asking.answer(second) == StopOutcome(second.id, Deed.HELD, 2)


def test_a_pain_stop_in_the_same_cycle_does_not_cover_an_emergency_stop(page: StopWord) -> None:
    asking, loop = Requester(page, Lane.STOP_PROCESS), Responder(page)
    emergency, pain = asking.request(StopReason.EMERGENCY), asking.request(StopReason.PAIN)
    assert set(loop.take(1)) == {emergency, pain}


def test_the_lanes_do_not_disturb_each_other(page: StopWord) -> None:
    one, two, loop = Requester(page, Lane.STOP_PROCESS), Requester(page, Lane.SUPERVISOR), Responder(page)
    stop, pain = one.request(StopReason.STOP), two.request(StopReason.PAIN)
    assert set(loop.take(1)) == {stop, pain}
    assert two.answer(StopRequest(1, StopReason.STOP)) is None
    loop.answer(Deed.HELD, 1)
    assert one.answer(stop)
    assert two.answer(pain)
    assert one.answer(StopRequest(1, StopReason.PAIN)) is None


def test_each_who_asks_counts_for_itself(page: StopWord) -> None:
    asking = [Requester(page, lane) for lane in (Lane.STOP_PROCESS, Lane.SUPERVISOR, Lane.AWAY)]
    asked = [one.request(StopReason.STOP) for one in asking]
    assert [request.id for request in asked] == [1, 1, 1]
    loop = Responder(page)
    assert loop.take(1) == (*asked,)
    loop.answer(Deed.HELD, 1)
    assert all(one.answer(request) for one, request in zip(asking, asked, strict=True))


def test_what_was_asked_before_the_loop_came_counts(page: StopWord) -> None:
    request = Requester(page, Lane.SUPERVISOR).request(StopReason.EMERGENCY)
    assert Responder(page).take(1) == (request,)


def test_a_loop_that_takes_over_does_not_repeat_what_was_answered(page: StopWord) -> None:
    asking, loop = Requester(page, Lane.SUPERVISOR), Responder(page)
    asking.request(StopReason.STOP)
    loop.take(1)
    loop.answer(Deed.HELD, 1)
    assert Responder(page).take(2) == ()


def test_a_stop_process_that_takes_over_goes_on_counting(page: StopWord) -> None:
    first = Requester(page, Lane.STOP_PROCESS).request(StopReason.STOP)
    assert Requester(page, Lane.STOP_PROCESS).request(StopReason.STOP).id == first.id + 1


@given(st.lists(st.tuples(st.sampled_from(Lane), st.sampled_from(StopReason), st.booleans()), max_size=40))
def test_whenever_the_loop_looks_every_kind_asked_is_taken_and_answered(
    steps: list[tuple[Lane, StopReason, bool]],
) -> None:
    path = Path(f"/dev/shm/test-{time.monotonic_ns()}.stop")
    page = StopWord.create(path)
    asking, loop = {lane: Requester(page, lane) for lane in Lane}, Responder(page)
    asked: list[tuple[Lane, StopRequest]] = []
    for now, (lane, kind, look) in enumerate(steps):
        asked.append((lane, asking[lane].request(kind)))
        if look:
            taken = loop.take(now)
            assert asked[-1][1] in taken
            loop.answer(Deed.HELD, now)
            assert all(asking[lane].answer(request) for lane, request in asked)
    page.close(unlink=True)


REASONS = ("STOP", "PAIN", "EMERGENCY", "KEYPAD_LOST", "RECORDING_LOST")


def test_each_reason_is_a_request_apart_and_each_deed_arrives_as_itself(page: StopWord) -> None:
    asking, loop = Requester(page, Lane.STOP_PROCESS), Responder(page)
    asked = [asking.request(reason) for reason in StopReason.__members__.values()]
    assert [request.kind.name for request in loop.take(1)] == list(REASONS)
    for name, deed in Deed.__members__.items():
        loop.take(1)
        loop.answer(deed, 2)
        outcomes = [asking.answer(request) for request in asked]
        assert [outcome and outcome.deed.name for outcome in outcomes] == [name] * len(REASONS)
        asked = [asking.request(reason) for reason in StopReason]


def test_it_reaches_another_mapping_of_the_file_and_only_a_page_of_ours_is_opened(
    page: StopWord, tmp_path: Path
) -> None:
    other = StopWord.open(page.path)
    request = Requester(page, Lane.SUPERVISOR).request(StopReason.STOP)
    assert Responder(other).take(7) == (request,)
    assert page.loop_beat_ns == 7
    other.serve(12)
    other.show_keypad(Keypad.LOST)
    assert (page.server_pid, page.keypad) == (12, Keypad.LOST)
    other.close()
    (tmp_path / "b.stop").write_bytes(bytes(4096))
    for path, sentence in ((tmp_path / "b.stop", "not a stop word"), (tmp_path / "c.stop", "no stop word: No such")):
        with pytest.raises(DeviceError, match=sentence):
            StopWord.open(path)
    with pytest.raises(DeviceError, match="cannot be created: File exists"):
        StopWord.create(page.path)
    assert page.path.stat().st_mode & 0o777 == 0o600


def test_a_page_keeps_no_descriptor_and_is_given_back_once(tmp_path: Path) -> None:
    path, before = tmp_path / "d.stop", open_files()
    page = StopWord.create(path)
    other = StopWord.open(path)
    assert (page.path, other.path) == (path, path)
    other.close()
    assert path.exists(), "others keep it"
    for _ in range(2):
        page.close(unlink=True)
        assert not path.exists()
    assert open_files() <= before
    with pytest.raises(DeviceError, match="the bench is not running"):
        Requester(page, Lane.SUPERVISOR).request(StopReason.STOP)


def test_where_there_is_no_memory_nothing_is_left_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    before = open_files()
    with pytest.raises(DeviceError, match="no memory for the stop word: No space left on device; free some"):
        StopWord.create(tmp_path / "e.stop")
    assert list(tmp_path.iterdir()) == []
    assert open_files() <= before


def test_the_loop_knows_when_the_stop_process_looked_last(page: StopWord) -> None:
    page.beat(1_000_000_000)
    assert Responder(page).server_silent_s(3_500_000_000) == pytest.approx(2.5)


def test_a_thread_waits_for_its_answer_and_no_longer_than_it_said(page: StopWord) -> None:
    asking, loop = Requester(page, Lane.SUPERVISOR), Responder(page)
    request = asking.request(StopReason.PAIN)
    began = time.monotonic()
    assert asking.confirmed(request, 0.05) is None
    assert time.monotonic() - began >= 0.05

    def answer_it() -> None:
        loop.take(1)
        loop.answer(Deed.BRAKED, 1)

    answering = threading.Timer(0.02, answer_it)
    answering.start()
    answer = asking.confirmed(request, 10.0)
    answering.join()
    assert answer == StopOutcome(request.id, Deed.BRAKED, 1)


def test_every_deed_has_words_and_only_an_axis_that_does_not_answer_is_unconfirmed() -> None:
    assert len({DEEDS[deed] for deed in Deed.__members__.values()}) == 6
    assert [deed for deed in Deed if not StopOutcome(1, deed, 1).confirmed] == [Deed.AXIS_LOST]
    assert StopOutcome(1, Deed.BRAKED, 1).text == "braked"


def test_a_look_without_a_request_costs_the_loop_less_than_two_microseconds(page: StopWord) -> None:
    loop = Responder(page)
    best_s = min(timeit.repeat(lambda: loop.take(1), number=2000, repeat=20)) / 2000
    assert best_s < 2e-6
