"""The stop process beside a calibration of the axis, which moves without a loop."""

import os
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import NamedTuple

from controller.stop.client import StopProcess
from controller.stop.start import StartGuard
from controller.stop.word import Responder, StopWord
from rig.config.wiring import Wiring
from rig.recording.ring import new_path


class Stoppable(NamedTuple):
    """What brakes the axis, and where a press is heard (POST /estop, /pain and /stop on 127.0.0.1)."""

    guard: StartGuard
    port: int


@contextmanager
def stoppable(wiring: Wiring) -> Iterator[Stoppable]:
    """Stop process, page, foot switch; raises DeviceError where they do not start, and nothing moves."""
    with (
        closing(StopProcess(wiring, new_path().with_suffix(".stop"))) as process,
        closing(StopWord.open(process.path)) as page,
    ):
        responder = Responder(page)
        responder.attach(os.getpid())
        with StartGuard(responder) as guard:
            yield Stoppable(guard, process.port)
