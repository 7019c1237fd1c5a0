"""A mock on a real wire, played in a thread in real time: for clients of others, which wait for what they ask."""

import contextlib
import select
import threading
import time
from collections.abc import Callable, Iterator

from mock_devices.interfaces import ProtocolMock

LONGEST_WAIT_S = 0.02


@contextlib.contextmanager
def played(mock: ProtocolMock, advance: Callable[[int], None] = lambda _: None) -> Iterator[None]:
    """``advance`` brings the physics up to a time [ns]; what fails in the thread is raised at the end."""
    ended = threading.Event()
    failed: list[BaseException] = []

    def play() -> None:
        try:
            while not ended.is_set():
                play_once(mock, advance)
        except BaseException as error:
            failed.append(error)

    thread = threading.Thread(target=play)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        mock.close()
    if failed:
        raise failed[0]


def play_once(mock: ProtocolMock, advance: Callable[[int], None]) -> None:
    """Waits for bytes or for what is due, and lets the mock act."""
    left_s = (mock.due_ns - time.monotonic_ns()) * 1e-9
    ready, _, _ = select.select(mock.filenos(), [], [], min(max(left_s, 0.0), LONGEST_WAIT_S))
    while mock.due_ns <= time.monotonic_ns():
        advance(mock.due_ns)
        mock.tick(mock.due_ns)
    if ready:
        advance(time.monotonic_ns())
        mock.receive(time.monotonic_ns())
