"""The service's side of a computation: a process that may be cancelled or die without taking anything along."""

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path

import rig.errors
from api.http.jobs.wire import CANCEL_S, Order, Told, Word
from controller.operation import Cancelled, Operation
from rig.apart import how_ended, last_line
from rig.errors import RigError, SafetyStop

MODULE = "api.http.jobs.worker"


class Crashed(RigError):
    """The process of a computation ended without a word."""


class Computation:
    """One order, computed by a process of its own. ``run`` once; ``cancel`` and ``done`` from any thread."""

    def __init__(self, order: Order, asked: Callable[[str], None]) -> None:
        """``asked`` is called where a person is to do something."""
        self._order, self._asked = order, asked
        self._process: subprocess.Popen[str] | None = None
        self._lock, self._cancelled = threading.Lock(), False

    def run(self, operation: Operation) -> str:
        """The result as JSON; raises what the process said it failed of, Cancelled, or Crashed."""
        with tempfile.TemporaryDirectory(prefix="rig-job-") as scratch, tempfile.TemporaryFile("w+") as complaints:
            with self._lock:
                if self._cancelled:
                    raise Cancelled(f"{self._order.kind} was cancelled before it began")
                self._process = process = _started(Path(scratch), complaints.fileno())
            try:
                self._send(self._order.model_dump_json())
                end = self._follow(process, operation)
            finally:
                _end(process)
            return self._judged(end, process.returncode, complaints.fileno())

    def _follow(self, process: "subprocess.Popen[str]", operation: Operation) -> Told | None:
        """Its messages until the last; None where there was no last."""
        assert process.stdout
        for line in process.stdout:
            told = Told.model_validate_json(line)
            match told.type:
                case "step":
                    operation.advance(told.done, told.text)
                case "say":
                    operation.say(told.text)
                case "ask":
                    self._asked(told.text)
                case _:
                    return told
        return None

    def _judged(self, end: Told | None, code: int, complaints: int) -> str:
        if end and end.type == "result":
            return end.text
        if end:
            raise _error(end)
        if self._cancelled:
            raise Cancelled(f"{self._order.kind} was cancelled")
        raise Crashed(f"the process of this {self._order.kind} {how_ended(code)}; {_last_line(complaints)}")

    def cancel(self) -> None:
        """Asks it to end soon, and sees that it does."""
        with self._lock:
            self._cancelled, process = True, self._process
        if process:
            self._send(Word(type="cancel").model_dump_json())
            killer = threading.Timer(CANCEL_S, _kill, [process])
            killer.daemon = True
            killer.start()

    def done(self) -> None:
        """What was asked of a person has been done."""
        self._send(Word(type="done").model_dump_json())

    def _send(self, line: str) -> None:
        assert self._process and self._process.stdin
        with self._lock, contextlib.suppress(OSError, ValueError):  # it has ended
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()


def _started(scratch: Path, complaints: int) -> "subprocess.Popen[str]":
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    return subprocess.Popen(
        [sys.executable, "-m", MODULE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=complaints, text=True,
        encoding="utf-8", start_new_session=True, env=os.environ | threads | {"TMPDIR": str(scratch)},
    )  # fmt: skip


def _end(process: "subprocess.Popen[str]") -> None:
    """Whatever it is doing: nobody hears it any more. Closing its input ends it by itself."""
    assert process.stdin and process.stdout
    with contextlib.suppress(OSError):
        process.stdin.close()
    process.stdout.close()
    try:
        process.wait(CANCEL_S)
    except subprocess.TimeoutExpired:
        _kill(process)
        process.wait()


def _kill(process: "subprocess.Popen[str]") -> None:
    """With all that it started."""
    if process.poll() is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def _error(told: Told) -> RigError:
    if told.name == "SafetyStop":
        return SafetyStop(told.text, told.code)
    if told.name == "Cancelled":
        return Cancelled(told.text)
    kind = vars(rig.errors).get(told.name, RigError)
    found = kind(told.text)
    assert isinstance(found, RigError)
    return found


def _last_line(complaints: int) -> str:
    with open(complaints, encoding="utf-8", errors="replace", closefd=False) as file:
        file.seek(0)
        said = last_line(file.read())
    return f"its last words: {said}" if said else "it said nothing; start it again"
