"""The supervisor's end of the channel to the loop: one thread reads, any thread may ask and wait for its own answer."""

import threading
import time
from collections.abc import Callable
from select import select
from socket import socket
from typing import TypeVar

from controller.loop.messages import (
    FROM_LOOP,
    Finished,
    LoopFailed,
    Outcome,
    Ready,
    Run,
    Status,
    StatusSaid,
    Stopped,
    Survey,
    Surveyed,
)
from controller.recovery.situation import Situation
from rig.channel import Answer, Channel, Message, Received, refuse_oversized
from rig.errors import DeviceError, SafetyStop, UsageError

ANSWER_TIMEOUT_S = 5.0  # five times the longest pause that a loop may be configured to survive (`loop.overrun_ms`)
LISTEN_S = 0.5  # messages wake the listener at once; only hanging up waits for this
# Answers are looked for at once by whoever asked; what nobody came for makes room.
KEPT = 64

Found = TypeVar("Found")


class LoopClient:
    """What the loop has said, and questions to it. ``why_gone`` says how its process ended."""

    def __init__(self, end: socket, why_gone: Callable[[], str]) -> None:
        self._channel = Channel(end, FROM_LOOP)
        self._why_gone = why_gone
        self._sending = threading.Lock()
        self._changed = threading.Condition()
        self._answers: dict[int, Answer] = {}
        self._outcomes: dict[int, Outcome] = {}
        self._situations: dict[int, Situation] = {}
        self._ready: Ready | None = None
        self._failed: LoopFailed | None = None
        self._status: Status = {}
        self._stops: list[Stopped] = []
        self._gone = False
        self._reader = threading.Thread(target=self._listen, name="loop-reader", daemon=True)
        self._reader.start()

    @property
    def gone(self) -> bool:
        """Whether the loop has hung up."""
        return self._gone

    @property
    def status(self) -> Status:
        """The newest status; empty before the first."""
        with self._changed:
            return self._status

    @property
    def incidents(self) -> list[Stopped]:
        """What has stopped motion so far, oldest first."""
        with self._changed:
            return list(self._stops)

    def ready(self, timeout_s: float) -> Ready:
        """What the loop found; raises with its own sentence where a device is not right, or someone stopped it."""
        return self._wait(lambda: self._ready, "did not start", timeout_s)

    def tell(self, message: Message) -> int:
        """Sends ``message`` and returns its id; raises DeviceError where the loop does not take it."""
        if self._gone:
            raise DeviceError("the bench is not running")
        with self._sending:
            number = self._channel.send(message)
        if not number:
            raise DeviceError("the loop takes no messages; stop and restart the bench")
        self._push()
        return number

    def ask(self, message: Message, what: str, timeout_s: float = 0.0) -> int:
        """As ``tell``, then waits until the loop has done it; raises UsageError in the loop's words where it refuses.

        SafetyStop instead, where it refuses because a stop is in force. ``timeout_s`` 0: what any answer may take.
        """
        number = self.tell(message)
        wait_s = timeout_s or ANSWER_TIMEOUT_S
        answer = self._wait(lambda: self._answers.pop(number, None), f"did not answer {what}", wait_s)
        if answer.refused:
            raise (SafetyStop if answer.stopped else UsageError)(answer.refused)
        return number

    def run(self, program: Run, timeout_s: float) -> Outcome:
        """The outcome of this very program; raises as ``ask`` where the loop refuses it."""
        refuse_oversized(program, f"program {program.program.name}")
        number = self.ask(program, "a program")
        return self._wait(lambda: self._outcomes.pop(number, None), "did not end its program", timeout_s)

    def survey(self) -> Situation:
        """How things stand, for recovery; raises UsageError while anything moves."""
        number = self.ask(Survey(), "a survey")
        return self._wait(lambda: self._situations.pop(number, None), "did not say how things stand", ANSWER_TIMEOUT_S)

    def wait_until(self, condition: Callable[[Status], bool], timeout_s: float) -> bool:
        """Waits for a status that fulfils ``condition``; whether it came, or True where the loop is gone."""
        with self._changed:
            return self._changed.wait_for(lambda: self._gone or condition(self._status), timeout_s)

    def close(self) -> None:
        """Hangs up."""
        self._channel.lost = True
        self._reader.join(2 * LISTEN_S)
        self._channel.close()

    def _wait(self, look: Callable[[], Found | None], failed: str, timeout_s: float) -> Found:
        deadline = time.monotonic() + timeout_s
        with self._changed:
            while (found := look()) is None:
                self._refuse_gone()
                left_s = deadline - time.monotonic()
                if left_s <= 0:
                    raise DeviceError(f"the loop {failed} within {timeout_s:g} s; stop and restart the bench")
                self._changed.wait(left_s)
        return found

    def _refuse_gone(self) -> None:
        if self._failed:
            raise (SafetyStop if self._failed.stopped else DeviceError)(self._failed.text)
        if self._gone:
            raise DeviceError(f"the loop's process ended unasked ({self._why_gone()})")

    def _push(self) -> None:
        """Waits until what is queued has gone; only a large program does not go at once."""
        deadline = time.monotonic() + ANSWER_TIMEOUT_S
        while not self._flushed():
            if time.monotonic() > deadline:
                raise DeviceError(f"the loop takes no messages for {ANSWER_TIMEOUT_S:g} s; stop and restart the bench")
            select([], [self._channel], [], 0.05)

    def _flushed(self) -> bool:
        with self._sending:
            return self._channel.flush() or self._channel.lost

    def _listen(self) -> None:
        while not self._gone:
            select([self._channel], [], [], LISTEN_S)
            with self._sending:
                received = self._channel.receive_all()
            with self._changed:
                for item in received:
                    self._file(item)
                self._gone = self._channel.lost
                self._changed.notify_all()

    def _file(self, received: Received) -> None:
        match received.message:
            case StatusSaid(status=status):
                self._status = status
            case Answer(to=number) as answer:
                _keep(self._answers, number, answer)
            case Surveyed(to=number, situation=situation):
                _keep(self._situations, number, situation)
            case Finished(program=number, outcome=outcome):
                _keep(self._outcomes, number, outcome)
            case Stopped() as stopped:
                self._stops.append(stopped)
            case Ready() as ready:
                self._ready = ready
            case LoopFailed() as failed:
                self._failed = failed


def _keep(kept: dict[int, Found], number: int, item: Found) -> None:
    kept[number] = item
    while len(kept) > KEPT:
        del kept[next(iter(kept))]
