"""Starts and supervises the loop and the recorder, each a process of its own; what the command line and HTTP drive.

One thread reads what the loop says; everything else happens in the caller's thread. A supervisor that dies leaves a
loop that retracts and ends, and a recorder that closes its file.
"""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from select import select
from typing import Any

from controller.link import Link, Message, pair
from controller.steps import Program
from rig.config.wiring import Wiring
from rig.errors import DeviceError, SafetyStop, UsageError
from rig.recording.client import RecorderClient
from rig.recording.ring import new_path

LOOP_MODULE = "controller.loop_process"
START_TIMEOUT_S = 60.0
LEAVE_TIMEOUT_S = 15.0
ANSWER_TIMEOUT_S = 5.0
# Renewals within one lease, so that two may be late.
LEASE_SHARE = 4
UNASKED_LEASE_S = 3.0


@dataclass(frozen=True)
class Ready:
    """What the loop found when it started."""

    devices: Mapping[str, Mapping[str, Any]]
    realtime: Mapping[str, str]


@dataclass(frozen=True)
class Outcome:
    """How a program ended."""

    outcome: str
    cause: str
    peak_force_N: float
    surface_mm: float | None
    zero_N: float | None

    @property
    def stopped(self) -> bool:
        """Whether a limit, a person or a fault ended it."""
        return bool(self.cause)


@dataclass
class _Mail:
    """What the loop has said, shared between its reader and the caller."""

    changed: threading.Condition = field(default_factory=threading.Condition)
    status: Message = field(default_factory=dict)
    answers: list[Message] = field(default_factory=list)
    incidents: list[Message] = field(default_factory=list)
    failed: str = ""
    gone: bool = False


class Supervisor:
    """A running bench: ``with Supervisor(wiring) as bench: bench.run(program)``."""

    def __init__(self, wiring: Wiring, loop_module: str = LOOP_MODULE) -> None:
        """``loop_module`` is what the loop's process runs: this program's own, or one that prepares something first."""
        self.wiring = wiring
        self._loop_module = loop_module
        self._mail = _Mail()
        self._ring_path = new_path()
        self._link: Link | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._reader: threading.Thread | None = None
        self._sending = threading.Lock()
        self.recorder: RecorderClient | None = None
        self.ready = Ready({}, {})
        self.attended: Callable[[], bool] = lambda: True
        """Whether the operator is there; as soon as this says no, motion ends."""
        self._closing = threading.Event()

    def __enter__(self) -> "Supervisor":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self) -> None:
        """Starts loop and recorder; raises DeviceError with the loop's own sentence where a device is not right."""
        mine, theirs = pair()
        self._link = Link(mine)
        command = [sys.executable, "-m", self._loop_module]
        arguments = [self.wiring.model_dump_json(), str(self._ring_path), str(theirs.fileno())]
        self._process = subprocess.Popen(
            command + arguments,
            pass_fds=[theirs.fileno()],
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            env=process_environment(),
        )
        theirs.close()
        self._reader = threading.Thread(target=self._listen, name="loop-reader", daemon=True)
        self._reader.start()
        try:
            answer = self._answer("ready", START_TIMEOUT_S)
            self.ready = Ready(answer["devices"], answer["realtime"])
            self.recorder = RecorderClient(self._ring_path)
            threading.Thread(target=self._keep_lease, name="lease", daemon=True).start()
        except BaseException:
            self.close()
            raise

    def _keep_lease(self) -> None:
        # Also where the loop asks for no sign of life: whether the operator attends is still to be said.
        period_s = (self.wiring.loop.lease_s or UNASKED_LEASE_S) / LEASE_SHARE
        while not self._closing.wait(period_s):
            try:
                self._tell({"do": "lease" if self.attended() else "unattended"})
            except DeviceError:
                return

    def _listen(self) -> None:
        link = self._link
        assert link
        while not link.lost:
            select([link], [], [], 0.5)
            message = link.receive()
            while message is not None:
                self._file(message)
                message = link.receive()
        with self._mail.changed:
            self._mail.gone = True
            self._mail.changed.notify_all()

    def _file(self, message: Message) -> None:
        mail = self._mail
        with mail.changed:
            if "status" in message:
                mail.status = message["status"]
            elif "incident" in message:
                mail.incidents.append(message["incident"])
            elif "failed" in message:
                mail.failed = message["failed"]
            else:
                mail.answers.append(message)
            mail.changed.notify_all()

    def _answer(self, kind: str, timeout_s: float) -> Any:
        """The next answer of ``kind``; a refusal raises UsageError, a lost loop DeviceError."""
        deadline = time.monotonic() + timeout_s
        mail = self._mail
        with mail.changed:
            while True:
                for message in mail.answers:
                    if kind in message or "refused" in message:
                        mail.answers.remove(message)
                        if kind in message:
                            return message[kind]
                        raise UsageError(message["refused"]["text"])
                if mail.failed or mail.gone:
                    raise DeviceError(mail.failed or f"the loop's process ended unasked ({self._exit_text()})")
                left_s = deadline - time.monotonic()
                if left_s <= 0:
                    raise DeviceError(f"the loop gave no '{kind}' within {timeout_s:g} s; stop and restart the bench")
                mail.changed.wait(left_s)

    def _exit_text(self) -> str:
        code = self._process.wait(5) if self._process else None
        return f"exit code {code}" if code is None or code >= 0 else f"killed by signal {-code}"

    def _tell(self, message: Message) -> None:
        if self._link is None or self._mail.gone:
            raise DeviceError("the bench is not running")
        with self._sending:
            self._link.send(message)

    @property
    def status(self) -> Message:
        """The loop's newest status; empty before the first."""
        with self._mail.changed:
            return self._mail.status

    @property
    def incidents(self) -> list[Message]:
        """What has stopped motion so far, oldest first."""
        with self._mail.changed:
            return list(self._mail.incidents)

    @property
    def alive(self) -> bool:
        """Whether the loop's process is there."""
        return self._process is not None and self._process.poll() is None and not self._mail.gone

    @property
    def loop_pid(self) -> int:
        """Process number of the loop."""
        if self._process is None:
            raise DeviceError("the bench is not running")
        return self._process.pid

    def run(self, program: Program, timeout_s: float) -> Outcome:
        """Executes ``program`` to its end, however it ends; raises UsageError where the loop refuses it."""
        self._tell({"do": "program", "program": program.model_dump(mode="json")})
        return Outcome(**self._answer("finished", timeout_s))

    def wait_at_rest(self, timeout_s: float = 30.0) -> None:
        """Waits until nothing moves any more."""
        deadline = time.monotonic() + timeout_s
        with self._mail.changed:
            self._mail.changed.wait(0.1)
            while self._mail.status.get("busy") and not self._mail.gone and time.monotonic() < deadline:
                self._mail.changed.wait(0.2)

    def stop(self) -> None:
        """Soft stop by the operator: retract, then stay."""
        self._tell({"do": "stop"})

    def pain(self) -> None:
        """The subject's stop: retract, then stay."""
        self._tell({"do": "pain"})

    def estop(self) -> None:
        """Immediate stop by the drive's own ramp."""
        self._tell({"do": "estop"})

    def reset(self) -> None:
        """Acknowledges a stop and waits until the loop's status shows it; raises where the cause is still there."""
        self._tell({"do": "reset"})
        self._answer("reset", ANSWER_TIMEOUT_S)
        mail = self._mail
        with mail.changed:
            if not mail.changed.wait_for(lambda: mail.gone or not mail.status.get("latched"), ANSWER_TIMEOUT_S):
                raise DeviceError(
                    f"the loop did not leave its safe state within {ANSWER_TIMEOUT_S:g} s after the reset"
                )

    def note(self, code: str, text: str) -> None:
        """Writes a note into the event stream."""
        self._tell({"do": "note", "code": code, "text": text})

    def close(self) -> None:
        """Ends loop and recorder in order; may be called twice."""
        self._closing.set()
        if self.alive:
            try:
                self._tell({"do": "stop"})
                self._tell({"do": "shutdown"})
            except DeviceError:
                pass
        self._await_exit()
        if self._link:
            self._link.lost = True
        if self._reader:
            self._reader.join(2)
        if self.recorder:
            self.recorder.quit()
            self.recorder = None
        # A killed loop leaves its ring behind.
        self._ring_path.unlink(missing_ok=True)
        if self._link:
            self._link.close()
            self._link = None

    def _await_exit(self) -> None:
        if self._process is None:
            return
        try:
            self._process.wait(LEAVE_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def stopped(outcome: Outcome) -> SafetyStop:
    """The error that ends a command whose program was stopped."""
    return SafetyStop(f"stopped: {outcome.cause}")


def process_environment() -> dict[str, str]:
    """Environment of child processes: one thread a numerics library, so that none disturbs the loop."""
    return os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
