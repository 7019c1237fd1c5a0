"""`python -m api.http.jobs.worker`: the process that computes one job.

Its order comes as the first line of standard input, what it finds goes out as lines; where the input ends the service
is gone, and so is this. What libraries print goes to standard error.
"""

import contextlib
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import NamedTuple, TextIO

from api.http.jobs.kinds import KINDS
from api.http.jobs.places import Places
from api.http.jobs.wire import CANCEL_S, Order, Told, Word
from api.http.models import RequestBody
from controller.commissioning.stoppable import stop_for_lost
from controller.operation import Cancelled, Operation, Progress
from rig.apart import stand_back
from rig.config.wiring import Wiring
from rig.errors import NO_ROOM, RigError, SafetyStop
from rig.plugins import blaming
from rig.results.base import SavedResult

FIRST_TO_END = "1000"  # proc(5): the most there is
# A stop by the service's signal (as by systemd) is an end in order; of what was asked to end it is the last word.
ENDED = 1


class Desk(NamedTuple):
    """What a function works with beside its parameters: where, on which bench, and who does what only a person can."""

    places: Places
    wiring: Wiring
    ask: Callable[[str], None]
    """Asks a person to do something, and returns when it is done; raises Cancelled where it was cancelled."""
    hands: str = ""
    stop_word: str = ""


class Pipes:
    """The two pipes."""

    def __init__(self, incoming: TextIO, outgoing: TextIO) -> None:
        self._incoming, self._outgoing = incoming, outgoing
        self._lock, self._done = threading.Lock(), queue.SimpleQueue[bool]()
        self.operation: Operation | None = None
        self.stop_word = ""

    def tell(self, message: Told) -> None:
        """In one piece."""
        with self._lock:
            self._outgoing.write(message.model_dump_json(exclude_defaults=True) + "\n")
            self._outgoing.flush()

    def listen(self) -> None:
        """Until the service is gone, which ends this process."""
        for line in self._incoming:
            word = Word.model_validate_json(line)
            if word.type == "cancel" and self.operation:
                self.operation.cancel()
            self._done.put(word.type == "done")
        self._done.put(False)
        if self.stop_word:  # what moves is braked, and its devices are closed in order
            stop_for_lost(Path(self.stop_word))
            time.sleep(CANCEL_S)
        os._exit(ENDED)

    def ask(self, request: str) -> None:
        """A person is asked to do something; returns when it is done."""
        self.tell(Told(type="ask", text=request))
        if not self._done.get():
            raise Cancelled(f"cancelled before: {request}")


def compute(order: Order, pipes: Pipes) -> None:
    """The work of ``order``, told from beginning to end."""
    kind = KINDS[order.kind]
    pipes.stop_word = order.stop_word
    operation = pipes.operation = Operation(order.kind)
    operation.watch = _watch(pipes.tell)
    desk = Desk(order.places, Wiring.model_validate_json(order.wiring), pipes.ask, order.hands, order.stop_word)
    try:
        asked = kind.params.model_validate(order.params)
        with blaming():
            found = function_at(order.work)(operation, asked, desk)
    except RigError as error:
        code = error.code if isinstance(error, SafetyStop) else ""
        pipes.tell(Told(type="error", name=type(error).__name__, text=str(error), code=code))
    except OSError as error:  # most often a session that was removed meanwhile
        name = "DiskFull" if error.errno in NO_ROOM else "DataError"
        pipes.tell(Told(type="error", name=name, text=f"{error.filename}: {error.strerror or error}"))
    else:
        pipes.tell(Told(type="result", text=found.model_dump_json()))


def function_at(name: str) -> Callable[[Operation, RequestBody, Desk], SavedResult]:
    """The function that ``module:name`` stands for; only the module of the job asked for is loaded."""
    module, _, function = name.partition(":")
    found: Callable[[Operation, RequestBody, Desk], SavedResult] = vars(import_module(module))[function]
    return found


def _watch(tell: Callable[[Told], None]) -> Callable[[Progress], None]:
    told = 0

    def watch(now: Progress) -> None:
        nonlocal told
        for sentence in now.log[told:]:
            tell(Told(type="say", text=sentence))
        told = len(now.log)
        tell(Told(type="step", text=now.message, done=now.done / now.total))

    return watch


def main() -> None:
    """Reads the order, does it, ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    outgoing = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    pipes = Pipes(sys.stdin, outgoing)
    order = Order.model_validate_json(sys.stdin.readline())
    if not order.stop_word:  # a drive waits for nobody
        stand_back()  # whatever the service's own is
        with contextlib.suppress(OSError):  # of which memory is taken first, not of loop, recorder or service
            Path("/proc/self/oom_score_adj").write_text(FIRST_TO_END)
    threading.Thread(target=pipes.listen, name="service", daemon=True).start()
    compute(order, pipes)


if __name__ == "__main__":
    main()
