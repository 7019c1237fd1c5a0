"""The stop process beside a calibration of the axis, which moves without a loop."""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import NamedTuple, TypeVar

from controller.stop.client import StopProcess
from controller.stop.start import StartGuard
from controller.stop.word import Lane, Requester, Responder, StopReason, StopWord
from rig.config.wiring import Wiring
from rig.recording.ring import new_path

T = TypeVar("T")


class Stoppable(NamedTuple):
    """What brakes the axis, and where a press is heard (POST /estop, /pain and /stop on 127.0.0.1).

    ``port`` is 0 where somebody else has the stop process, and tells it.
    """

    guard: StartGuard
    port: int


@contextmanager
def stoppable(wiring: Wiring, word: Path | None = None) -> Iterator[Stoppable]:
    """Stop process, page, foot switch; raises DeviceError where they do not start, and nothing moves.

    ``word`` is the stop word of whoever has started the stop process already.
    """
    with ExitStack() as held:
        port = 0
        if word is None:
            process = held.enter_context(closing(StopProcess(wiring, new_path().with_suffix(".stop"))))
            word, port = process.path, process.port
        responder = Responder(held.enter_context(closing(StopWord.open(word))))
        responder.attach(os.getpid())
        yield Stoppable(held.enter_context(StartGuard(responder)), port)


def stop_for_lost(word: Path) -> None:
    """Asks for a stop in the lane of whoever started the stop process, and is gone."""
    with closing(StopWord.open(word)) as page:
        Requester(page, Lane.SUPERVISOR).request(StopReason.STOP)


def awaited(act: Callable[[], T], meanwhile: Callable[[], object]) -> T:
    """What ``act`` returns, which may take a person minutes; ``meanwhile`` is called all the time, and may end it."""
    found: list[T] = []
    errors: list[BaseException] = []

    def work() -> None:
        try:
            found.append(act())
        except BaseException as error:
            errors.append(error)

    # A daemon: after Ctrl-C or a stop nobody waits for a question that is still open.
    waiting = threading.Thread(target=work, daemon=True)
    waiting.start()
    while waiting.is_alive():
        meanwhile()
    if errors:
        raise errors[0]
    return found[0]
