"""The inputs' own process: ``python -m controller.inputs.process WIRING_JSON RING_PATH``.

It owns every input of the configuration, each in a thread, and publishes their rows and states in a ring that the loop
looks into: whatever a driver here waits for, or whatever of them dies, holds up nothing that moves. It ends when its
standard input is closed.
"""

import contextlib
import select
import signal
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from controller.devices.states import DeviceStatus
from controller.inputs.runner import InputRunner
from controller.inputs.states import INPUT_STATE, SAY_EVERY_S, packed
from rig.config.products.input_role import brought_by
from rig.config.wiring import Wiring
from rig.input_streams import input_streams
from rig.recording.ring import RingWriter

# Three seconds of a stream of 500 Hz, which the loop takes in by the millisecond.
SLOTS = 2048


class Runner(Protocol):
    """One input, as far as this process asks."""

    @property
    def status(self) -> DeviceStatus:
        """As it is now."""


class Publisher:
    """The ring, for threads one after another."""

    def __init__(self, ring: RingWriter) -> None:
        self._ring, self._lock = ring, threading.Lock()
        self._said = 0

    def put(self, stream_id: int, body: bytes) -> None:
        """One row."""
        with self._lock:
            self._ring.put(stream_id, body)

    def say(self, runners: Sequence[Runner], now_ns: int) -> None:
        """The state of each."""
        for number, runner in enumerate(runners):
            status = runner.status
            self.put(INPUT_STATE.id, packed(self._said, now_ns, number, str(status.state), status.detail))
            self._said += 1


def run(wiring: Wiring, ring: RingWriter, until: int) -> None:
    """Serves the inputs until descriptor ``until`` is closed at its other end."""
    publisher = Publisher(ring)
    streams = input_streams(brought_by(wiring.input))
    runners = [
        InputRunner(product, stream, publisher.put)
        for product, stream in zip(wiring.input.values(), streams, strict=True)
    ]
    with contextlib.ExitStack() as started:
        for runner in runners:
            started.callback(runner.close)
            runner.begin()
        while not select.select([until], [], [], SAY_EVERY_S)[0]:
            publisher.say(runners, time.monotonic_ns())


def main(arguments: Sequence[str]) -> int:
    """The process; 0 after an orderly end."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # Its supervisor closes standard input, also by dying; until then a needed input is there.
        signal.signal(number, signal.SIG_IGN)
    ring = RingWriter.create(Path(arguments[1]), SLOTS)
    try:
        run(Wiring.model_validate_json(arguments[0]), ring, sys.stdin.fileno())
    finally:
        ring.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
