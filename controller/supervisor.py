"""Starts and supervises the loop and the recorder, each a process of its own; what the command line and HTTP drive.

A supervisor that dies leaves a loop that retracts and ends, and a recorder that closes its file.
"""

import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from socket import socket

from controller.claims import Claim, take
from controller.inputs.client import InputsProcess, started_inputs
from controller.loop.client import ANSWER_TIMEOUT_S, LoopClient
from controller.loop.messages import Heartbeat, Note, Outcome, Ready, Recover, Reset, Run, Shutdown, Status, Stopped
from controller.loop.steps import Program
from controller.recovery.conversation import recover
from controller.recovery.situation import Consent, Situation
from controller.safety.table import Action
from controller.stop.client import StopProcess
from controller.stop.word import Requester, StopReason
from rig.channel import Message, pair
from rig.config.wiring import Wiring
from rig.errors import DeviceError, SafetyStop, UsageError
from rig.recording.client import RecorderClient
from rig.recording.ring import new_path, remove_abandoned
from rig.results.bench import Act, ResetResult

LOOP_MODULE = "controller.loop.process"
# Homing is the longest part of a start and of an act: 3 s over 60 mm at 20 mm/s, and much more on a slower axis.
START_TIMEOUT_S = 60.0
ACT_TIMEOUT_S = 60.0
LEAVE_TIMEOUT_S = 15.0  # to retract over 60 mm at 20 mm/s (3 s) and to close devices (4 s), twice
NOT_IN_CONTROL = "whoever started this is not in control any more: nothing more of it moves"
WAITING = "the bench was started for recovery"
# In order, or with a failure it reported; a loop that was killed left the axis where it was.
ENDED_BY_ITSELF = (0, 1)
# A device is degraded after a second of bad samples and ok with the first good one; more is no passing disturbance.
READY_TIMEOUT_S = 3.0
# Renewals within one lease, so that two may be late.
LEASE_SHARE = 4
UNASKED_LEASE_S = 3.0
# Two statuses of the loop: the one that is known may be from before what was just asked.
TOLD_S = 0.1


class Supervisor:
    """A running bench: ``with Supervisor(wiring) as bench: bench.run(program)``."""

    def __init__(
        self, wiring: Wiring, loop_module: str = LOOP_MODULE, waiting: bool = False, address: str = ""
    ) -> None:
        """``loop_module`` is what the loop's process runs: this program's own, or one that prepares something first.

        ``waiting``: nothing is homed at the start, and only the axis need be there, for recovery. ``address`` is where
        others reach whoever uses this bench.
        """
        self._waiting, self._address = waiting, address
        self._claim: Claim | None = None
        self.wiring = wiring
        self._loop_module = loop_module
        self._ring_path = new_path()
        self._stop: StopProcess | None = None
        self._inputs: InputsProcess | None = None
        self._client: LoopClient | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self.recorder: RecorderClient | None = None
        self.ready = Ready()
        self.attended: Callable[[], bool] = lambda: True
        """Whether the operator is there; as soon as this says no, motion ends."""
        self._closing = threading.Event()

    def __enter__(self) -> "Supervisor":
        self.start()
        try:
            self.refuse_held()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def prepare(self) -> None:
        """Starts the stop process alone, which ``start`` does by itself: from now on a stop counts."""
        if self._stop is None:
            self._stop = StopProcess(self.wiring, self.stop_path)

    def start(self) -> None:
        """Starts the stop process, loop and recorder; raises with the loop's own sentence where a device is not right.

        DeviceError then, or SafetyStop where someone stopped it before it was up.
        """
        try:
            self._start()
        except BaseException:
            self.close()
            raise

    def _start(self) -> None:
        remove_abandoned()
        self._claim = take(self.wiring, self._address)
        self.prepare()
        self._inputs = started_inputs(self.wiring, self._ring_path)
        self._client = LoopClient(self._start_loop(self._claim), self._exit_text)
        self.ready = self._client.ready(START_TIMEOUT_S)
        self.recorder = RecorderClient(self._ring_path)
        threading.Thread(target=self._keep_lease, name="lease", daemon=True).start()
        self.await_ready()

    def _start_loop(self, claim: Claim) -> socket:
        """Its process; returns our end of the channel to it."""
        assert self._stop
        held = claim.unfinished or (WAITING if self._waiting else "")
        mine, theirs = pair()
        command = [sys.executable, "-m", self._loop_module]
        paths = [str(self._ring_path), str(theirs.fileno()), str(self._stop.path)]
        arguments = [self.wiring.model_dump_json(), *paths, held]
        self._process = subprocess.Popen(
            command + arguments,
            pass_fds=[theirs.fileno(), *claim.fds],
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            env=process_environment(),
        )
        theirs.close()
        return mine

    def _keep_lease(self) -> None:
        # Also where the loop asks for no sign of life: whether the operator attends is still to be said.
        period_s = (self.wiring.loop.lease_s or UNASKED_LEASE_S) / LEASE_SHARE
        while not self._closing.wait(period_s):
            try:
                self._tell(Heartbeat(attending=self.attended()))
            except DeviceError:  # a loop that hears nothing for a while may hear again
                if not self.alive:
                    return

    def _exit_text(self) -> str:
        code = self._process.wait(5) if self._process else None
        return f"exit code {code}" if code is None or code >= 0 else f"killed by signal {-code}"

    def _loop(self) -> LoopClient:
        if self._client is None:
            raise DeviceError("the bench is not running")
        return self._client

    def _tell(self, message: Message) -> None:
        self._loop().tell(message)

    @property
    def status(self) -> Status:
        """The loop's newest status; empty before the first."""
        return self._client.status if self._client else {}

    @property
    def incidents(self) -> list[Stopped]:
        """What has stopped motion so far, oldest first."""
        return self._client.incidents if self._client else []

    @property
    def alive(self) -> bool:
        """Whether the loop's process is there."""
        client = self._client
        return self._process is not None and self._process.poll() is None and client is not None and not client.gone

    @property
    def loop_pid(self) -> int:
        """Process number of the loop."""
        if self._process is None:
            raise DeviceError("the bench is not running")
        return self._process.pid

    def run(self, program: Program, timeout_s: float) -> Outcome:
        """Executes ``program`` to its end, however it ends; raises UsageError where the loop refuses it.

        SafetyStop where whoever started it is not in control any more: under a lease that is over nothing begins, also
        where the loop has not heard of it yet. One that has not ended in time is stopped, and DeviceError raised; how
        it ended is then nobody's any more.
        """
        self.await_ready()
        self.refuse_held()
        self._refuse_unattended()
        try:
            return self._loop().run(Run(program=program), timeout_s)
        except DeviceError:
            if self.alive:
                self.stop()
            raise

    def _refuse_unattended(self) -> None:
        if not self.attended():
            raise SafetyStop(NOT_IN_CONTROL, "operator_silent")

    def await_ready(self, timeout_s: float = READY_TIMEOUT_S) -> bool:
        """Whether every device is ok within that time, or a stop is in force; what the loop says in the end counts."""
        return self._loop().wait_until(lambda status: bool(status.get("ready") or status.get("latched")), timeout_s)

    def wait_at_rest(self, timeout_s: float = 30.0) -> None:
        """Waits until nothing moves any more."""
        self._closing.wait(TOLD_S)
        self._loop().wait_until(lambda status: not status.get("busy"), timeout_s)

    @property
    def stops(self) -> Requester:
        """This process' own way to the stop word: ask, and see what the loop did about it."""
        if self._stop is None:
            raise DeviceError("the bench is not running")
        return self._stop.requester

    @property
    def loop_is_to_come(self) -> bool:
        """Whether the stop process is there and the loop not yet: a stop now forbids its start."""
        return self._stop is not None and self._process is None

    @property
    def ring_path(self) -> Path:
        """Where the loop publishes its samples, for whoever looks on beside the recorder."""
        return self._ring_path

    @property
    def stop_path(self) -> Path:
        """Where the stop word is."""
        return self._ring_path.with_suffix(".stop")

    @property
    def stop_port(self) -> int:
        """Port on 127.0.0.1 at which the stop process takes POST /estop, /pain and /stop; 0 where there is none."""
        return self._stop.port if self._stop else 0

    def stop(self, why: StopReason = StopReason.STOP) -> None:
        """Soft stop, by the operator where nothing else is said: retract, then stay."""
        self.stops.request(why)

    def pain(self) -> None:
        """The subject's stop: retract, then stay."""
        self.stops.request(StopReason.PAIN)

    def estop(self) -> None:
        """Immediate stop by the drive's own ramp."""
        self.stops.request(StopReason.EMERGENCY)

    def reset(self) -> None:
        """Acknowledges a stop and waits until the loop's status shows it; raises where the cause is still there."""
        loop = self._loop()
        loop.ask(Reset(), "a reset")
        self._closing.wait(TOLD_S)
        if not loop.wait_until(lambda status: not status.get("latched"), ANSWER_TIMEOUT_S):
            raise DeviceError(f"the loop did not leave its safe state within {ANSWER_TIMEOUT_S:g} s after the reset")

    @property
    def held(self) -> str:
        """Why nothing moves before recovery; empty where it may."""
        latched = self.status.get("latched") or {}
        return str(latched["text"]) if latched.get("code") == "recovery" else ""

    def refuse_held(self) -> None:
        """Raises DeviceError where the bench waits for recovery and was not started for it."""
        if self.held and not self._waiting:
            raise DeviceError(f"{self.held}; run `rig reset`, which says what happened and brings the tip out")

    def survey(self) -> Situation:
        """How things stand, for recovery; raises UsageError while anything moves."""
        return self._loop().survey()

    def act(self, act: Act) -> None:
        """One act of recovery, to its end; raises DeviceError where it does not succeed, SafetyStop as ``run``."""
        self._refuse_unattended()
        try:
            self._loop().ask(Recover(act=act), act, ACT_TIMEOUT_S)
        except UsageError as refusal:
            raise DeviceError(str(refusal)) from refusal
        self.wait_at_rest(ACT_TIMEOUT_S)

    def recover(self, consent: Consent) -> ResetResult:
        """The way back to a bench that can be used, as far as ``consent`` goes."""
        found = recover(self, consent)
        if self._claim and not found.open:
            self._claim.finished = True
        return found

    def await_device(self, role: str, timeout_s: float) -> bool:
        """Whether the device is, or comes back, within that time."""
        away = ("connecting", "lost", "reconnecting")
        return self._loop().wait_until(
            lambda status: status.get("devices", {}).get(role, {}).get("state", "lost") not in away, timeout_s
        )

    def note(self, code: str, text: str) -> None:
        """Writes a note into the event stream."""
        self._tell(Note(code=code, text=text))

    def close(self) -> None:
        """Ends loop and recorder in order; may be called twice."""
        self._closing.set()
        latched = self.status.get("latched") or {}
        stopped_at_once = latched.get("action") == Action.IMMEDIATE.name
        if self.alive:
            try:
                self.stop()
                self._tell(Shutdown())
            except DeviceError:
                pass
        tip_left_in = self._killed() or stopped_at_once
        if self._client:
            self._client.close()
            self._client = None
        if self.recorder:
            self.recorder.quit()
            self.recorder = None
        if self._inputs:
            self._inputs.close()
            self._inputs = None
        if self._stop:
            self._stop.close()
            self._stop = None
        self._give_back(tip_left_in)
        # A killed loop leaves its ring behind.
        self._ring_path.unlink(missing_ok=True)

    def _give_back(self, tip_left_in: bool) -> None:
        if self._claim is None:
            return
        if tip_left_in:
            self._claim.leave_note()
        self._claim.release()
        self._claim = None

    def _killed(self) -> bool:
        """Waits for the loop's end; whether it was ended, now or before, where it stood."""
        if self._process is None:
            return False
        try:
            self._process.wait(LEAVE_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        return self._process.poll() not in ENDED_BY_ITSELF


def stop_error(outcome: Outcome) -> SafetyStop:
    """The error that ends a command whose program was stopped."""
    return SafetyStop(f"stopped: {outcome.cause}", outcome.outcome)


def process_environment() -> dict[str, str]:
    """Environment of child processes: one thread a numerics library, so that none disturbs the loop."""
    return os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
