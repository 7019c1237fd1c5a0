"""What the routes call: one bench, at most one job, stops that never wait for either."""

import asyncio
import contextlib
import threading
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from api.http.lease import LeaseRegistry
from api.http.problems import RequestRefused
from api.operations import motion
from api.operations.motion import TrackPlan
from controller.experiments import capture as experiment
from controller.experiments import tracked
from controller.operation import Operation, Progress
from controller.recovery.situation import Consent
from controller.stop.word import NOT_CONFIRMED, StopOutcome, StopReason
from controller.supervisor import Supervisor
from rig.config.protocol import Indentation
from rig.config.table import load
from rig.config.wiring import Wiring
from rig.errors import RigError, UsageError
from rig.results.bench import ResetResult
from rig.tissue.model import load_model

MODEL = Path("fit") / "model.json"
# As long as the stop process itself waits for the loop.
CONFIRM_S = 0.5
LOOK_S = 0.001


@dataclass(frozen=True)
class Job:
    """A piece of work in a thread of its own; it runs on whether or not anyone looks."""

    id: str
    kind: str
    lease: str
    operation: Operation

    @property
    def progress(self) -> Progress:
        """How it stands."""
        return self.operation.progress


class Service:
    """The bench behind the routes. Every method is safe from any thread."""

    def __init__(self, wiring: Wiring, sessions: Path, protocols: Path, address: str = "") -> None:
        """``address`` is where it listens, for commands beside it."""
        self.address = address
        self.wiring, self.sessions, self.protocols = wiring, sessions, protocols
        self.id = uuid.uuid4().hex
        self.reason = "not connected yet"
        self.settled = threading.Event()
        """Set once the first attempt to connect has ended, well or not."""
        self.bench: Supervisor | None = None
        self.control = LeaseRegistry()
        self.jobs: dict[str, Job] = {}
        self._coming: Supervisor | None = None
        self._starting = threading.Lock()

    @property
    def stop_port(self) -> int:
        """Where the stop process listens; 0 while there is none."""
        bench = self._coming or self.bench
        return bench.stop_port if bench else 0

    def connect(self) -> None:
        """Starts loop and recorder; what fails is kept as ``reason`` and shown, the service goes on."""
        with self._starting:
            if self.bench and self.bench.alive:
                return
            self._start_bench(waiting=False)

    def _start_bench(self, waiting: bool) -> None:
        """A new loop; ``waiting``: for recovery, so that nothing moves at its start."""
        self.disconnect()
        bench = Supervisor(self.wiring, waiting=waiting, address=self.address)
        bench.attended = self.attended
        try:
            bench.prepare()
            self.reason = "the bench is starting: devices are opened and the axis is homed"
            self._coming = bench
            bench.start()
        except RigError as error:
            self.reason = str(error)
        else:
            self.bench, self.reason = bench, ""
        finally:
            self._coming = None
            self.settled.set()

    def recover(self, consent: Consent) -> ResetResult:
        """The way back after a crash, a fault or a stop, as far as ``consent`` goes; a dead loop is replaced."""
        with self._starting:
            if self.running:
                raise RequestRefused(409, "busy", "a job is under way; stop it, then recover")
            if not (self.bench and self.bench.alive):
                self._start_bench(waiting=True)
            bench = self.the_bench()
            try:
                return bench.recover(consent)
            except RigError as error:
                raise RequestRefused(409, "not-recovered", str(error)) from error

    def disconnect(self) -> None:
        """Ends loop and recorder."""
        if self.bench:
            self.bench.close()
        self.bench = None

    @property
    def running(self) -> Job | None:
        """The job under way."""
        return next((job for job in self.jobs.values() if job.progress.state == "running"), None)

    def attended(self) -> bool:
        """Whether whoever started what is under way still is in control; the loop stops motion where this stays no."""
        job = self.running
        return job is None or self.control.holds(job.lease)

    def the_bench(self) -> Supervisor:
        """The bench, or RequestRefused with why there is none."""
        if self.bench is None:
            raise RequestRefused(503, "disconnected", f"the bench is not connected: {self.reason}")
        if not self.bench.alive:
            raise RequestRefused(503, "disconnected", "the loop's process is gone; connect again")
        return self.bench

    def plan(self, name: str) -> Indentation:
        """The protocol called ``name``."""
        path = self.protocols / f"{name}.toml"
        if not path.is_file():
            raise RequestRefused(404, "no-such-protocol", f"no protocol {name} in {self.protocols}")
        return load(Indentation, path)

    def capture(self, lease: str, protocol: str, session: str) -> Job:
        """Starts a capture; checks protocol, limits and folder first."""
        plan, bench, folder = self.plan(protocol), self.the_bench(), self.sessions / session
        experiment.check(plan, self.wiring)
        if folder.exists():
            raise RequestRefused(409, "session-exists", f"session {session} exists; recordings are never overwritten")
        operation = motion.capture_operation(plan)
        return self._start("capture", lease, operation, lambda: motion.capture(operation, bench, plan, folder))

    def track(self, lease: str, session: str, forces_N: list[float], seconds: float) -> Job:
        """Starts force tracking with the model of ``session``."""
        bench, folder = self.the_bench(), self.session(session)
        file = folder / MODEL
        if not file.is_file():
            raise RequestRefused(
                409, "no-model", f"session {session} has no fitted model; run `rig fit {folder}` first"
            )
        wanted = TrackPlan(tracked.plan(forces_N, seconds, load_model(file), self.wiring), str(MODEL))
        operation = Operation("track", total=1, unit="runs")
        return self._start("track", lease, operation, lambda: motion.track(operation, bench, wanted, folder))

    def retract(self, lease: str) -> Job:
        """Moves the tip out of wherever a stop left it."""
        bench, operation = self.the_bench(), Operation("retract", total=1, unit="moves")
        return self._start("retract", lease, operation, lambda: motion.retract(operation, bench))

    def _start(self, kind: str, lease: str, operation: Operation, work: Callable[[], object]) -> Job:
        with self._starting:
            busy = self.running
            if busy:
                raise RequestRefused(409, "busy", f"{busy.progress.name} is under way (job {busy.id}); stop it or wait")
            job = Job(uuid.uuid4().hex[:12], kind, lease, operation)
            self.jobs[job.id] = job
        threading.Thread(target=_work, args=(operation, work), name=f"job-{job.id}", daemon=True).start()
        return job

    def job(self, identifier: str) -> Job:
        """The job called ``identifier``."""
        if identifier not in self.jobs:
            raise RequestRefused(404, "no-such-job", f"no job {identifier} since this service started")
        return self.jobs[identifier]

    def session(self, name: str) -> Path:
        """The folder of session ``name``."""
        folder = self.sessions / name
        if not folder.is_dir() or folder.resolve().parent != self.sessions.resolve():
            raise RequestRefused(404, "no-such-session", f"no session {name} in {self.sessions}")
        return folder

    def stop_job(self, identifier: str) -> Job:
        """Soft stop of that job and no other; a job that has ended stays as it is."""
        job = self.job(identifier)
        if job.progress.state == "running":
            job.operation.cancel()
            self.the_bench().stop()
        return job

    async def stop(self, kind: StopReason) -> StopOutcome:
        """Asks the loop itself to stop and returns what it did; raises 504 where it has not confirmed that in time."""
        bench = self.stoppable()
        request = bench.stops.request(kind)
        for job in list(self.jobs.values()):
            job.operation.cancel()
        deadline = time.monotonic() + CONFIRM_S
        while (answer := bench.stops.answer(request)) is None and time.monotonic() < deadline:
            await asyncio.sleep(LOOK_S)
        if answer is None or not answer.confirmed:
            why = answer.text if answer else "the loop does not answer"
            raise RequestRefused(504, "not-confirmed", f"{NOT_CONFIRMED} ({why})")
        return answer

    def stoppable(self) -> Supervisor:
        """The bench, also one that is just starting and homes; RequestRefused where there is none."""
        return self._coming or self.the_bench()

    def reset(self) -> None:
        """Acknowledges a stop; never restarts motion."""
        bench = self.the_bench()
        if self.running:
            raise RequestRefused(409, "busy", "a job is still ending; wait for it, then reset")
        try:
            bench.reset()
        except UsageError as error:
            raise RequestRefused(409, "cause-not-cleared", str(error)) from error


def _work(operation: Operation, work: Callable[[], object]) -> None:
    """In a job's thread, which has nobody above it: how the work failed is shown as the job's."""
    with contextlib.suppress(RigError):
        operation.run(work)
