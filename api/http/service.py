"""What the routes call: one bench, at most one job that uses it, stops that never wait for either."""

import asyncio
import contextlib
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

from api.http.access.access import Access
from api.http.jobs.board import JobBoard
from api.http.jobs.job import Job
from api.http.lease import LeaseRegistry
from api.http.problems import NotDone, RequestRefused
from api.http.stops.process import AwayStops
from api.http.streams.events import EventLog
from api.http.turn import Turn
from api.operations.doctor import reports_of
from controller.loop.messages import DeviceView
from controller.recovery.situation import Consent
from controller.stop.word import NOT_CONFIRMED, StopOutcome, StopReason
from controller.supervisor import Supervisor
from rig.channels import BY_NAME
from rig.config.protocol import Indentation
from rig.config.subject import Subject
from rig.config.table import load
from rig.config.wiring import Wiring
from rig.errors import RigError, UsageError
from rig.recording.slots import Slots
from rig.results.bench import DeviceReport, ResetResult

# As long as the stop process itself waits for the loop.
CONFIRM_S = 0.5
LOOK_S = 0.001
# Most stops are confirmed within two cycles of the loop; to wait for them here is shorter than a turn of the service.
PROMPT_S = 0.003


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
        self.events = EventLog()
        self.control = LeaseRegistry(told=partial(self.events.publish, "control"))
        self.access = Access()
        self.jobs = JobBoard(sessions, protocols, self.events)
        self.works: dict[str, str] = {}
        """Functions that do a kind of job otherwise than usual: on a mock bench, which is nobody's here."""
        self.hands = ""
        """Where the mock bench takes orders, for what a person would do at it."""
        self.onlookers: list[Callable[[Slots], None]] = []
        """Called with all samples as they lie in the ring."""
        self.away: AwayStops | None = None
        """Takes stops from other computers, where any may use the service."""
        self._coming: Supervisor | None = None
        self.starting = Turn(lambda: self.control)

    @property
    def stop_port(self) -> int:
        """Where the stop process listens; 0 while there is none."""
        bench = self._coming or self.bench
        return bench.stop_port if bench else 0

    @property
    def moves(self) -> bool:
        """Whether something uses the bench: a job, a start or a recovery, which home."""
        return self.starting.taken or self.running is not None

    def stop_taken_over(self) -> None:
        """Ends a homing, which hears nothing else, after a takeover; a job ends by itself, as nobody attends it."""
        bench = self._coming or self.bench
        if self.starting.lease and self.running is None and bench:
            with contextlib.suppress(RigError):  # it has just ended
                bench.stop()

    def connect(self, lease: str = "") -> None:
        """Starts loop and recorder; what fails is kept as ``reason`` and shown, the service goes on."""
        with self.starting.under(lease):
            if self.bench and self.bench.alive:
                return
            self._start_bench(waiting=False)

    def _start_bench(self, waiting: bool) -> None:
        """A new loop; ``waiting``: for recovery, so that nothing moves at its start."""
        self.disconnect()
        bench = Supervisor(self.wiring, waiting=waiting, address=self.address)
        bench.attended = self.attended
        try:
            self.reason = "the bench is starting: devices are opened and the axis is homed"
            self._hear(bench)
            bench.start()
        except RigError as error:
            self.reason = str(error)
        else:
            self.bench, self.reason = bench, ""
        finally:
            self._coming = None
            self.settled.set()

    def _hear(self, bench: Supervisor) -> None:
        """From now on stops are for ``bench``."""
        bench.prepare()
        if self.away:
            self.away.follow(bench.stop_path)
        self._coming = bench

    def recover(self, consent: Consent, lease: str = "") -> ResetResult:
        """The way back after a crash, a fault or a stop, as far as ``consent`` goes; a dead loop is replaced."""
        with self.starting.under(lease):
            if self.running:
                raise RequestRefused(409, "busy", "a job is under way; stop it, then recover")
            if not (self.bench and self.bench.alive):
                self._start_bench(waiting=True)
            bench = self.the_bench()
            try:
                return bench.recover(consent)
            except RigError as error:
                raise NotDone(409, "not-recovered", str(error)) from error

    def disconnect(self) -> None:
        """Ends loop and recorder."""
        if self.bench:
            self.bench.close()
        self.bench = None

    @contextlib.contextmanager
    def released(self, why: str) -> Iterator[None]:
        """Another process has the devices meanwhile; a person connects again, as that homes."""
        with self.starting:
            self.disconnect()
            self.reason = why
        try:
            yield
        finally:
            self.reason = "the devices are free again: see that nothing is in the tip's way, then connect"

    @contextlib.contextmanager
    def stopping(self, bench: Supervisor) -> Iterator[None]:
        """Stops go through ``bench`` to another process; nothing of it but the stop process is started."""
        self._hear(bench)
        try:
            yield
        finally:
            self._coming = None
            bench.close()

    @property
    def running(self) -> Job | None:
        """The job that uses the bench."""
        return self.jobs.moving

    def attended(self) -> bool:
        """Whether whoever started what is under way still is in control; the loop stops motion where this stays no."""
        job = self.running
        return self.control.holds(job.lease) if job else self.starting.attended

    def the_bench(self) -> Supervisor:
        """The bench, or RequestRefused with why there is none."""
        if self.bench is None:
            raise RequestRefused(503, "disconnected", f"the bench is not connected: {self.reason}")
        if not self.bench.alive:
            raise RequestRefused(503, "disconnected", "the loop's process is gone; connect again")
        return self.bench

    def use_subject(self, subject: Subject, lease: str = "") -> None:
        """Whose recordings follow; the loop, which holds the force below the threshold, is started anew for another."""
        with self.starting.under(lease):
            self.jobs.refuse_busy()
            before, bench = self.wiring, self.bench
            if bench and bench.alive:
                self.refuse_stopped()
            self.wiring = before.model_copy(update={"subject": subject})
            if bench and bench.alive and self.wiring.force_limit_N != before.force_limit_N:
                self._start_bench(waiting=False)
            elif bench:
                bench.wiring = self.wiring
        self.events.publish("control", "subject-changed", f"subject {subject.id}, {subject.site}")

    def refuse_stopped(self) -> None:
        """Raises RequestRefused where a stop is in force: what was started then would leave an empty session."""
        bench = self.the_bench()
        latched = bench.status.get("latched")
        if latched:
            text = f"the bench is stopped: {latched['text']}; acknowledge that (POST /api/v1/estop/reset), then start"
            raise RequestRefused(409, "stopped", text)

    def seen_devices(self) -> tuple[DeviceReport, ...] | None:
        """As the loop sees them; None where no loop runs, and they may be looked at."""
        bench = self.bench
        if bench is None or not bench.alive:
            return None
        return reports_of(self.devices(bench), bench.status.get("rates_Hz", {}))

    def lost(self) -> Mapping[str, str]:
        """Why each stream is lost that is, by its topic: all of them where no loop runs."""
        bench = self.bench
        if bench is None or not bench.alive:
            return dict.fromkeys(BY_NAME, self.reason or "the loop's process is gone; connect again")
        return bench.status.get("lost", {})

    def devices(self, bench: Supervisor) -> dict[str, DeviceView]:
        """Who each device is, and how it is."""
        states = bench.status.get("devices", {})
        inputs: dict[str, DeviceView] = {name: {"product": one.product} for name, one in bench.wiring.input.items()}
        known = {**bench.ready.devices, **inputs}
        return {role: {**identity, **states.get(role, {})} for role, identity in known.items()}

    def plan(self, name: str) -> Indentation:
        """The protocol called ``name``."""
        return load(Indentation, self.jobs.places("").protocol(name))

    def session(self, name: str) -> Path:
        """The folder of session ``name``."""
        return self.jobs.places("").folder(name)

    def stop_softly(self) -> None:
        """The operator's stop, which retracts."""
        self.the_bench().stop()

    async def stop(self, kind: StopReason) -> StopOutcome:
        """Asks the loop itself to stop and returns what it did; raises 504 where it has not confirmed that in time."""
        job = self.running
        try:
            bench = self.stoppable()
            request = bench.stops.request(kind)
            if job:
                job.stopped()
            deadline = time.monotonic() + CONFIRM_S
            answer = bench.stops.confirmed(request, PROMPT_S)
            while answer is None and time.monotonic() < deadline:
                await asyncio.sleep(LOOK_S)
                answer = bench.stops.answer(request)
        finally:
            if job:
                job.give_up()
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
