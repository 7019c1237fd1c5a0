"""What takes too long is ended, and whoever had the alarm before has it again."""

import signal
import threading
import time

import pytest

from rig.deadline import within


def test_what_takes_too_long_is_ended() -> None:
    began_s = time.monotonic()
    with pytest.raises(TimeoutError, match=r"^not done within 0.05 s$"), within(0.05):
        time.sleep(60)
    assert time.monotonic() - began_s < 10


def test_what_is_done_in_time_hears_nothing_and_the_alarm_is_its_owners_again() -> None:
    rung: list[int] = []
    before = signal.signal(signal.SIGALRM, lambda *_: rung.append(1))
    left_s = signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with within(0.1):
            pass
        time.sleep(0.15)
        assert rung == []
        time.sleep(0.5)
        assert rung == [1]
    finally:
        signal.signal(signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, *left_s)


def test_in_another_thread_there_is_no_limit() -> None:
    """Only the main thread hears signals."""
    done: list[bool] = []

    def slow() -> None:
        with within(0.01):
            time.sleep(0.05)
        done.append(True)

    thread = threading.Thread(target=slow)
    thread.start()
    thread.join()
    assert done == [True]
