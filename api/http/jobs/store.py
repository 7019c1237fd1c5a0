"""Jobs on disk, beside the folder of sessions: what has ended outlasts the service, what had not is told so."""

import contextlib
import fcntl
import json
import os
import shutil
from pathlib import Path

from api.catalogue.pages import Place
from api.http.access.secrets import steady_s
from api.http.jobs.job import stamp
from api.http.jobs.kept import KEPT_S, RECORD
from api.http.jobs.views import FILES, JobView
from api.http.models import JobProblem, JobSummary
from api.http.shared_file import FileState, file_state
from rig.errors import RigError
from rig.recording.files import make_folder, write_text

LOCK = "lock"
# A busy month of a lab; each has a record of some kilobytes.
MOST_JOBS = 500
INTERRUPTED = "the service ended while this was under way; look at what it left, and start it again if it is wanted"


class JobStore:
    """Folder ``root`` with one folder a job. Used under the board's lock."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self._locks: dict[str, int] = {}
        self._now_s = steady_s()
        self._ended_s: dict[str, float] = {}
        """When those ended that this service has seen."""
        self._looked: FileState | None = None
        self._unwritten: dict[str, bytes] = {}
        """What the disk did not take."""

    def folder(self, identifier: str) -> Path:
        """That of one job."""
        return self.root / identifier

    def files(self, identifier: str) -> Path:
        """Its own files."""
        return self.folder(identifier) / FILES

    def hold(self, identifier: str) -> None:
        """From now until ``keep_ended`` the job is this service's: the lock ends with the process at the latest."""
        make_folder(self.folder(identifier))
        fd = os.open(self.folder(identifier) / LOCK, os.O_RDWR | os.O_CREAT, 0o600)
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._locks[identifier] = fd

    def keep(self, view: JobView) -> None:
        """Writes it as it stands; a disk that takes nothing stops no job, and what it stands for is known meanwhile."""
        text = view.model_dump_json()
        self._unwritten[view.id] = text.encode()
        with contextlib.suppress(RigError, OSError):
            make_folder(self.folder(view.id))
            write_text(self.folder(view.id) / RECORD, text)
            del self._unwritten[view.id]

    def let_go(self, identifier: str) -> None:
        """The job has ended."""
        self._ended_s[identifier] = self._now_s()
        fd = self._locks.pop(identifier, None)
        if fd is not None:
            os.close(fd)
            with contextlib.suppress(OSError):  # without its holder a lock that stays is none
                (self.folder(identifier) / LOCK).unlink(missing_ok=True)

    def record(self, identifier: str) -> bytes | None:
        """The view of a job as JSON; None where there is none."""
        if identifier in self._unwritten:
            return self._unwritten[identifier]
        with contextlib.suppress(OSError):
            return (self.folder(identifier) / RECORD).read_bytes()
        return None

    def load(self) -> dict[str, JobSummary]:
        """All jobs that no other service has under way, by id."""
        if not self.root.is_dir():
            return {}
        found = (self._loaded(folder) for folder in self.root.iterdir() if (folder / RECORD).is_file())
        return {each.id: each for each in found if each is not None}

    def changed(self) -> bool:
        """Whether folders of jobs came or went since this was asked last, by whatever program."""
        before, self._looked = self._looked, file_state(self.root)
        return self._looked != before

    def _loaded(self, folder: Path) -> JobSummary | None:
        lock = folder / LOCK
        if lock.exists() and not _abandoned(lock):
            return None
        try:
            facts = json.loads((folder / RECORD).read_bytes())
            summary = JobSummary.model_validate(facts)
            if summary.ended is None:
                summary = _interrupted(summary)
                write_text(folder / RECORD, json.dumps({**facts, **summary.model_dump(mode="json")}))
            lock.unlink(missing_ok=True)
        except (OSError, ValueError, RigError):  # a record that was not written by this program
            return None
        return summary

    def prune(self, jobs: dict[str, JobSummary]) -> None:
        """Forgets the oldest beyond what is kept, and their files sooner."""
        newest = sorted(jobs.values(), key=place, reverse=True)
        for job in newest[MOST_JOBS:]:
            del jobs[job.id]
            self._unwritten.pop(job.id, None)
            shutil.rmtree(self.folder(job.id), ignore_errors=True)
        for job in newest[:MOST_JOBS]:
            folder = self.files(job.id)
            with contextlib.suppress(OSError):
                if self._now_s() - self._ended_s.get(job.id, folder.stat().st_mtime) > KEPT_S:
                    shutil.rmtree(folder, ignore_errors=True)


def place(job: JobSummary) -> Place:
    """In the order in which they were asked for, whatever the clock said."""
    return f"{job.seq:012} {job.created}", job.id


def _abandoned(lock: Path) -> bool:
    with contextlib.suppress(OSError), lock.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def _interrupted(job: JobSummary) -> JobSummary:
    problem = JobProblem(code="interrupted", detail=INTERRUPTED)
    ended: dict[str, object] = {
        "state": "interrupted",
        "ended": stamp(),
        "message": INTERRUPTED,
        "can": [],
        "time_left_s": None,
    }
    return job.model_copy(update={**ended, "problem": problem})
