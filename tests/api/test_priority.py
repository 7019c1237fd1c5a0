"""Threads of the service: what works for an answer gets what the process' first thread has."""

import os
import threading
from collections.abc import Callable

import pytest

from api.http.priority import following, lead

NICEST = 19


def niceness(endpoint: Callable[[], None]) -> int:
    """Of a thread that began less favoured, after ``endpoint`` was answered in it."""
    found: list[int] = []

    def answering() -> None:
        os.setpriority(os.PRIO_PROCESS, 0, os.getpriority(os.PRIO_PROCESS, os.getpid()) + 3)
        endpoint()
        found.append(os.getpriority(os.PRIO_PROCESS, 0))

    thread = threading.Thread(target=answering)
    thread.start()
    thread.join()
    return found[0]


def plain() -> None:
    pass


def test_a_thread_that_answers_is_as_nice_as_the_first_of_its_process() -> None:
    first = os.getpriority(os.PRIO_PROCESS, os.getpid())
    if first + 3 > NICEST:
        pytest.skip(f"nice +3 is not possible at nice {first}")
    assert niceness(plain) == first + 3  # planted: an endpoint that nothing is done for
    if not os.geteuid():
        assert niceness(following(plain)) == first


def test_an_endpoint_of_the_event_loop_stays_as_it_is() -> None:
    async def answered() -> None:
        pass

    assert following(answered) is answered


def test_on_a_single_core_nothing_goes_before_the_recorder(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda _pid, policy, _param: asked.append(policy))
    for cores in ({0}, {0, 1}):
        monkeypatch.setattr(os, "sched_getaffinity", lambda _pid, cores=cores: cores)
        lead()
    assert asked == [os.SCHED_FIFO | os.SCHED_RESET_ON_FORK]
