"""A source with a thread: bounded, counted, its errors said where it is polled, and closed in time."""

import itertools
import select
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.threaded_source import ThreadedSource
from rig.errors import DeviceError

LONG_S = 5.0


def readable(source: ThreadedSource[int]) -> bool:
    return bool(select.select([source.fileno()], [], [], 0)[0])


def test_what_a_callback_puts_is_taken_once_with_its_time() -> None:
    clock = itertools.count(100)
    source = ThreadedSource[int]("acme", now=lambda: next(clock))
    assert not readable(source)
    for item in (7, 8):
        source.put(item)
    assert readable(source)
    assert [tuple(arrived) for arrived in source.take()] == [(7, 100), (8, 101)]
    assert (source.take(), readable(source)) == ([], False)
    assert source.close()


def test_a_full_queue_loses_its_oldest_and_counts_them() -> None:
    source = ThreadedSource[int]("acme", capacity=3)
    for item in range(5):
        source.put(item)
    assert ([arrived.item for arrived in source.take()], source.dropped) == ([2, 3, 4], 2)
    source.close()


def test_a_read_that_blocks_keeps_nobody_waiting() -> None:
    given, go_on = iter([[1, 2], [], [3]]), threading.Semaphore(0)

    def read() -> list[int]:
        go_on.acquire(timeout=0.05)
        return next(given, [])

    source = ThreadedSource("acme", read)
    source.start()
    source.start()  # twice is once
    begun_s = time.monotonic()
    assert source.take() == []
    assert time.monotonic() - begun_s < LONG_S
    found: list[int] = []
    for _ in range(3):
        go_on.release()
    while len(found) < 3:
        assert select.select([source.fileno()], [], [], LONG_S)[0], found
        found += [arrived.item for arrived in source.take()]
    assert found == [1, 2, 3]
    assert source.close()


def test_what_the_sdk_raises_is_raised_after_what_came_before_it() -> None:
    def read() -> Iterator[int]:
        yield 1
        raise ValueError("overrun of the board")

    source = ThreadedSource("acme", read)
    source.start()
    assert select.select([source.fileno()], [], [], LONG_S)[0]
    while threading.active_count() > 1 and source._thread and source._thread.is_alive():
        time.sleep(0.001)
    assert [arrived.item for arrived in source.take()] == [1]
    for _ in range(2):  # and it stays so
        with pytest.raises(DeviceError, match="acme: its reading ended: ValueError: overrun of the board; check"):
            source.take()
    assert source.close()


def test_a_failure_that_a_callback_tells_is_said_as_it_is() -> None:
    source = ThreadedSource[int]("acme")
    source.fail(DeviceError("unplugged"))
    source.fail(DeviceError("later"))
    assert readable(source)
    with pytest.raises(DeviceError, match="acme: its reading ended: unplugged; check power"):
        source.take()
    source.close()


def test_a_thread_that_does_not_come_back_is_left_in_time_and_said() -> None:
    stuck = threading.Event()
    source = ThreadedSource("acme", lambda: [1] if stuck.wait(LONG_S) else [], close_s=0.05)
    source.start()
    begun_s = time.monotonic()
    assert not source.close()
    assert time.monotonic() - begun_s < LONG_S / 2
    stuck.set()  # what it then gives is thrown away
    assert source._thread
    source._thread.join(LONG_S)
    assert not source._items
    with pytest.raises(DeviceError, match="this end closed it"):
        source.take()


def test_it_may_be_closed_twice_and_gives_its_descriptor_back() -> None:
    before = sum(1 for _ in Path("/proc/self/fd").iterdir())
    source = ThreadedSource[int]("acme")
    assert source.close() and source.close()
    source.put(1)
    source.fail(ValueError())
    assert sum(1 for _ in Path("/proc/self/fd").iterdir()) == before


def test_producers_and_consumer_together_lose_nothing_uncounted() -> None:
    source = ThreadedSource[int]("acme", capacity=50)

    def put() -> None:
        for _ in range(5000):
            source.put(1)

    producers = [threading.Thread(target=put) for _ in range(3)]
    for producer in producers:
        producer.start()
    taken = 0
    while any(producer.is_alive() for producer in producers) or readable(source):
        taken += len(source.take())
    assert taken + source.dropped == 15_000
    source.close()
