"""All jobs of a service: at most one that uses the bench, computations one after another, and what has ended."""

import contextlib
import threading
import time
import traceback
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path

from pydantic import JsonValue

from api.http.jobs.job import Job, JobRequest, ended_already, stamp
from api.http.jobs.kept import beside, erase_kept
from api.http.jobs.kinds import Kind
from api.http.jobs.places import Places
from api.http.jobs.store import JobStore
from api.http.jobs.views import JobView, files_of, summary, view
from api.http.models import JobSummary, RequestBody
from api.http.problems import RequestRefused
from api.http.streams.events import EventLog
from controller.operation import Cancelled, Operation
from rig.errors import RigError

# Nobody waits for more computations than a night's.
MOST_WAITING = 50
NOTE, WARNING = 10, 20


class JobBoard:
    """Starts, lists and ends jobs. Safe from any thread."""

    def __init__(self, sessions: Path, protocols: Path, events: EventLog) -> None:
        self._sessions, self._protocols, self._events = sessions, protocols, events
        self.folder = beside(sessions, "jobs")
        self._store = JobStore(self.folder)
        self.uploads = beside(sessions, "uploads")
        self._lock = threading.RLock()
        self._live: dict[str, Job] = {}
        self._ended: dict[str, JobSummary] | None = None
        self._waiting: list[tuple[Job, Callable[[], object]]] = []

    def places(self, identifier: str) -> Places:
        """Where one job reads and writes."""
        return Places(self._sessions, self._protocols, self.uploads, self._store.files(identifier))

    @property
    def moving(self) -> Job | None:
        """The job that uses the bench."""
        with self._lock:
            return next((job for job in self._live.values() if job.asked.moves), None)

    @property
    def active(self) -> list[Job]:
        """All that have not ended, oldest first."""
        with self._lock:
            return list(self._live.values())

    def new(self, kind: Kind, params: RequestBody, by: str, session: str | None, operation: Operation) -> Job:
        """A job that is not on the board yet."""
        asked = JobRequest(
            uuid.uuid4().hex[:12], kind.name, params.model_dump(mode="json"), by, session, kind.moves, kind.pausable
        )
        return Job(asked, operation, self._changed)

    def refuse_busy(self) -> None:
        """Raises RequestRefused where a job uses the bench."""
        busy = self.moving
        if busy:
            text = f"{busy.progress.name} is under way (job {busy.id}); cancel it or wait"
            raise RequestRefused(409, "busy", text)

    def start_moving(self, job: Job, work: Callable[[], object]) -> Job:
        """Begins at once, in a thread of its own; raises RequestRefused where another uses the bench."""
        with self._lock:
            self.refuse_busy()
            self._enter(job)
        if job.asked.pausable:
            job.operation.watch = job.wait_if_paused
        self._begin(job, work)
        return job

    def start_computing(self, job: Job, work: Callable[[], object]) -> Job:
        """Begins when its turn comes."""
        with self._lock:
            if len(self._waiting) >= MOST_WAITING:
                text = f"{MOST_WAITING} computations wait already; cancel one, or wait"
                raise RequestRefused(429, "queue-full", text)
            self._enter(job)
            self._waiting.append((job, work))
        self._next()
        return job

    def _enter(self, job: Job) -> None:
        known = [one.seq for one in self._known().values()] + [one.seq for one in self._live.values()]
        job.seq = 1 + max(known, default=0)
        self._store.hold(job.id)
        self._live[job.id] = job
        self._changed(job)

    def _next(self) -> None:
        """Begins the oldest that waits, where nothing else computes."""
        with self._lock:
            waiting = {job.id for job, _ in self._waiting}
            computing = any(not job.asked.moves and job.id not in waiting for job in self._live.values())
            if computing or not self._waiting:
                return
            job, work = self._waiting.pop(0)
        self._begin(job, work)

    def _begin(self, job: Job, work: Callable[[], object]) -> None:
        job.times.started, job.times.started_ns = stamp(), time.time_ns()
        job.become("running")
        threading.Thread(target=self._run, args=(job, work), name=f"job-{job.id}", daemon=True).start()

    def _run(self, job: Job, work: Callable[[], object]) -> None:
        """Has nobody above it: how the work failed is shown as the job's."""
        error: BaseException | None = None
        try:
            job.operation.run(work)
        except RigError as refused:
            error = refused
        except BaseException as odd:
            traceback.print_exc()
            error = odd
        self._finish(job, error)

    def _finish(self, job: Job, error: BaseException | None) -> None:
        try:
            job.finish(error)
        finally:
            self._next()

    def _changed(self, job: Job) -> None:
        """Keeps it, and tells everybody."""
        with self._lock:
            self._store.keep(self._view(job))
            self._publish(job)
            if job.ended:
                self._live.pop(job.id, None)
                self._store.let_go(job.id)
                known = self._known()
                known[job.id] = summary(job)
                self._store.prune(known)

    def _publish(self, job: Job) -> None:
        level = WARNING if job.state == "failed" else NOTE
        data: dict[str, JsonValue] = {
            "id": job.id, "kind": job.asked.kind, "state": job.state, "session": job.asked.session,
        }  # fmt: skip
        text = f"{job.progress.name} {job.state}" + (f": {job.wrong.detail}" if job.wrong else "")
        self._events.publish("job", f"job-{job.state}", text, level, data=data)

    def _view(self, job: Job) -> JobView:
        session = None if job.asked.session is None else self._sessions / job.asked.session
        with contextlib.suppress(OSError):  # somebody removes a folder meanwhile
            return view(job, files_of(job, session, self._store.files(job.id)) if job.ended else [])
        return view(job, [])

    def _known(self) -> dict[str, JobSummary]:
        changed = self._store.changed()
        if self._ended is None:
            self._ended = self._store.load()
        elif changed:  # a subject was erased from the command line
            self._ended = {name: job for name, job in self._ended.items() if self._store.folder(name).is_dir()}
        return self._ended

    def find(self, identifier: str) -> Job | None:
        """A job under way."""
        with self._lock:
            return self._live.get(identifier)

    def shown(self, identifier: str) -> bytes:
        """The view of a job as JSON; raises RequestRefused where there is none."""
        with self._lock:
            job = self._live.get(identifier)
            if job:
                return self._view(job).model_dump_json().encode()
            found = self._store.record(identifier) if identifier in self._known() else None
        if found is None:
            raise _unknown(identifier)
        return found

    def files(self, identifier: str) -> Path:
        """The folder of a job's own files."""
        with self._lock:
            if identifier not in self._live and identifier not in self._known():
                raise _unknown(identifier)
        return self._store.files(identifier)

    def erase(self, sessions: Sequence[str]) -> None:
        """Whatever has ended and was made of these sessions, with its files and all exports."""
        with self._lock:
            erase_kept(self._sessions, sessions)
            self._ended = None

    def cancel(self, identifier: str) -> None:
        """Ends this job and no other; one that waits ends at once."""
        job = self._alive(identifier, "cancelled")
        if job is None:
            return
        job.cancel()
        with self._lock:
            waits = [entry for entry in self._waiting if entry[0] is job]
            self._waiting = [entry for entry in self._waiting if entry[0] is not job]
        if waits:
            self._finish(job, Cancelled(f"{job.asked.kind} was cancelled before it began"))

    def alive(self, identifier: str) -> Job:
        """A job under way; raises RequestRefused with its state where it has ended."""
        job = self._alive(identifier, "changed")
        if job is None:
            raise ended_already(identifier, "cancelled", "changed")
        return job

    def _alive(self, identifier: str, done: str) -> Job | None:
        """None where it was cancelled before."""
        with self._lock:
            job, known = self._live.get(identifier), self._known().get(identifier)
        if job:
            return job
        if known is None:
            raise _unknown(identifier)
        if known.state != "cancelled":
            raise ended_already(identifier, known.state, done)
        return None

    def listed(self) -> list[JobSummary]:
        """All there are."""
        with self._lock:
            return list({**self._known(), **{job.id: summary(job) for job in self._live.values()}}.values())

    def close(self) -> None:
        """The service ends: whatever computes is ended with it, what waits first, so that none of it begins."""
        for job in reversed(self.active):
            if not job.asked.moves:
                with contextlib.suppress(RigError):
                    self.cancel(job.id)


def _unknown(identifier: str) -> RequestRefused:
    return RequestRefused(404, "no-such-job", f"no job {identifier[:80]!r}; /jobs lists those there are")
