"""One job from its start to its end, in the states that the interface names."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime

from pydantic import JsonValue

from api.http.jobs.kept import works_on
from api.http.jobs.process import Crashed
from api.http.jobs.states import ENDS, JobEnd, JobState, Verb
from api.http.problems import DISK_FULL, RequestRefused
from controller.operation import Cancelled, Operation, Progress
from controller.safety.table import BY_PERSON
from rig.errors import BadTrial, CheckFailed, DataError, DeviceError, DiskFull, RigError, SafetyStop, UsageError

# The first class that fits an error names it for programs.
CODES: Mapping[type[BaseException], str] = {
    DiskFull: DISK_FULL, Cancelled: "cancelled", Crashed: "crashed", DataError: "data", UsageError: "refused",
    DeviceError: "device", CheckFailed: "check-failed", BadTrial: "bad-trial", RigError: "failed",
    BaseException: "error",
}  # fmt: skip
PAUSED_STOP = "stopped by the operator while it was paused"


@dataclass(frozen=True)
class JobRequest:
    """What was asked for, and by whom; ``params`` as JSON. ``lease`` is that of whatever moves the bench."""

    id: str
    kind: str
    params: dict[str, JsonValue]
    by: str
    session: str | None = None
    moves: bool = False
    pausable: bool = False


@dataclass
class Times:
    """When, as ISO 8601; ``started_ns`` is for the dates of files."""

    created: str
    started: str | None = None
    ended: str | None = None
    started_ns: int = 0


@dataclass(frozen=True)
class Wrong:
    """Why a job did not succeed."""

    code: str
    detail: str


def stamp() -> str:
    """Now, fine enough that of two jobs one is the later."""
    return datetime.now(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")


@dataclass(eq=False)
class Job:
    """A job under way. Every method is safe from any thread; ``changed`` is called after each change of state."""

    asked: JobRequest
    operation: Operation
    changed: Callable[["Job"], None]
    lease: str = ""
    seq: int = 0
    """Grows with every job."""
    interrupt: Callable[[], None] = lambda: None
    """Ends what is under way: stops the bench, or the process that computes."""
    give_up: Callable[[], None] = lambda: None
    """Ends a process that waits for a person and hears of no stop."""
    go_on: Callable[[], None] = lambda: None
    """What a person was asked for has been done."""
    state: JobState = "queued"
    wrong: Wrong | None = None
    request: str = ""
    """What a person is asked to do."""
    times: Times = field(default_factory=lambda: Times(stamp()))
    _turn: threading.Condition = field(default_factory=threading.Condition)

    @property
    def id(self) -> str:
        """Its name in addresses."""
        return self.asked.id

    @property
    def progress(self) -> Progress:
        """How it stands."""
        return self.operation.progress

    def works_on(self, session: str) -> bool:
        """Whether it needs that session: as its own, as one of several, or for a model."""
        return works_on(vars(self.asked), (session,))

    @property
    def ended(self) -> bool:
        """Whether nothing more of it comes."""
        return self.state in ENDS

    @property
    def can(self) -> tuple[Verb, ...]:
        """What it may be asked for now."""
        match self.state:
            case "queued" | "pausing":
                return ("cancel",)
            case "running":
                return ("cancel", "pause") if self.asked.pausable else ("cancel",)
            case "paused":
                return ("cancel", "resume")
        return ()

    def become(self, state: JobState) -> None:
        """Enters a state, which is told; an ended job stays as it is."""
        with self._turn:
            if self.ended or self.state == state or (self.state == "cancelling" and state not in ENDS):
                return
            self.state = state
            self._turn.notify_all()
        self.changed(self)

    def cancel(self) -> None:
        """Asks it to end; raises RequestRefused where it has ended otherwise."""
        with self._turn:
            if self.state in ("cancelled", "cancelling"):
                return
            self._refuse_ended("cancelled")
            before, self.state = self.state, "cancelling"
            self.operation.cancel()
            self._turn.notify_all()
        self.changed(self)
        if before != "paused" or self.request:
            self.interrupt()

    def stopped(self) -> None:
        """The bench was stopped: it ends by that, and where it waited it goes on no more."""
        self.operation.cancel()
        self.become("cancelling")

    def pause(self) -> None:
        """Asks it to wait where it next can."""
        with self._turn:
            if self.state in ("pausing", "paused"):
                return
            self._refuse("pause")
            self.state = "pausing"
        self.changed(self)

    def resume(self, lease: str) -> None:
        """Lets it go on, under the lease of whoever says so."""
        with self._turn:
            if self.state == "running":
                return
            if self.state == "pausing":
                self.state = "running"
            else:
                self._refuse("resume")
                self.state, self.lease = "running", lease
            asked, self.request = self.request, ""
            self._turn.notify_all()
        self.changed(self)
        if asked:
            self.go_on()

    def _refuse(self, verb: Verb) -> None:
        if verb not in self.can:
            self._refuse_ended(f"{verb}d")
            text = (
                f"{self.asked.kind} is {self.state} and cannot be {verb}d; it can: {', '.join(self.can) or 'nothing'}"
            )
            raise _refused(self.state, text)

    def _refuse_ended(self, done: str) -> None:
        if self.ended:
            raise ended_already(self.id, self.state, done)

    def ask(self, request: str) -> None:
        """A person is to do something; the job waits."""
        self.request = request
        self.become("paused")

    def wait_if_paused(self, now: Progress) -> None:
        """In the thread that works, where the tip is out; raises SafetyStop where it was cancelled meanwhile."""
        with self._turn:
            if now.state != "running" or self.state != "pausing":
                return
            self.state = "paused"
        self.changed(self)
        with self._turn:
            self._turn.wait_for(lambda: self.state != "paused")
        if self.operation.cancelled:
            raise SafetyStop(PAUSED_STOP, "operator_stop")

    def finish(self, error: BaseException | None) -> None:
        """How it ended, in the words of ``error``."""
        self.times.ended = stamp()
        self.wrong = wrong_of(error)
        self.become(end_of(error, self.operation.cancelled))


def ended_already(identifier: str, state: str, done: str) -> RequestRefused:
    """Nothing can be ``done`` with it any more."""
    return _refused(state, f"job {identifier} has {state} and cannot be {done} any more")


def _refused(state: str, text: str) -> RequestRefused:
    return RequestRefused(409, "job-state", text, {"state": state})


def end_of(error: BaseException | None, cancelled: bool = False) -> JobEnd:
    """A person's stop is a cancellation; what the bench or the data stopped is a failure."""
    match error:
        case None:
            return "succeeded"
        case Cancelled() | KeyboardInterrupt():
            return "cancelled"
        case SafetyStop() if error.code in BY_PERSON or (cancelled and not error.code):
            return "cancelled"
    return "failed"


def wrong_of(error: BaseException | None) -> Wrong | None:
    """For programs and for people."""
    if error is None:
        return None
    text = str(error) if isinstance(error, RigError) else f"the job met an error of its own: {error!r}"
    detail = text.encode(errors="replace").decode()  # names on a disk need be no text
    if isinstance(error, SafetyStop):
        return Wrong(error.code or "safety-stop", detail)
    return Wrong(next(code for kind, code in CODES.items() if isinstance(error, kind)), detail)
