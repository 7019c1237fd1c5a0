"""Jobs as what goes over the wire, and is kept of those that have ended."""

import contextlib
import mimetypes
import os
from collections.abc import Iterator
from pathlib import Path
from typing import cast
from urllib.parse import quote

from pydantic import BaseModel, Field, JsonValue

from api.http.jobs.job import Job
from api.http.jobs.kinds import AnyResult
from api.http.jobs.places import is_text
from api.http.models import JobProblem, JobSummary

FILES = "files"
# More than the largest kind of result has; a script that made others finds them in the folder.
MOST_FILES = 500
# All that is served; what else a file may be is sent as bytes.
FILE_TYPES = (
    "application/octet-stream", "application/json", "text/html", "text/csv", "text/plain", "image/svg+xml", "image/png",
    "application/zip", "application/x-hdf5", "application/vnd.apache.parquet",
)  # fmt: skip
TYPES = {".mcap": "application/octet-stream", ".parquet": "application/vnd.apache.parquet", ".h5": "application/x-hdf5"}


class FileView(BaseModel):
    """A file that a job has written."""

    name: str = Field(description="below the session, or files/... of the job itself")
    href: str
    bytes: int
    media_type: str


class JobView(JobSummary):
    """A piece of work with all it says."""

    params: dict[str, JsonValue]
    log: list[str] = Field(description="what it said so far, a sentence each")
    result: AnyResult | None = Field(
        default=None, description="once it has succeeded: what --json of the command holds"
    )
    files: list[FileView] = Field(default=[], description="what it has written")


def summary(job: Job) -> JobSummary:
    """For lists and for the bench."""
    return JobSummary.model_validate(_facts(job))


def _facts(job: Job) -> dict[str, object]:
    now, asked, times, wrong = job.progress, job.asked, job.times, job.wrong
    done = now.total if job.state == "succeeded" else now.done
    said = job.request or (wrong.detail if wrong else now.message)
    return {
        "id": job.id, "kind": asked.kind, "name": now.name, "state": job.state, "seq": job.seq, "moves": asked.moves,
        "by": asked.by, "session": asked.session, "created": times.created, "started": times.started,
        "ended": times.ended, "done": done, "total": now.total, "unit": now.unit, "message": said, "can": list(job.can),
        "time_left_s": None if job.ended else now.time_left_s,
        "problem": JobProblem(code=wrong.code, detail=wrong.detail) if wrong else None,
    }  # fmt: skip


def view(job: Job, files: list[FileView]) -> JobView:
    """All of it."""
    now = job.progress
    result = cast(AnyResult | None, now.result if job.state == "succeeded" else None)
    more = {"params": job.asked.params, "log": list(now.log), "files": files}
    return JobView.model_validate({**_facts(job), **more, "result": result})


def files_of(job: Job, session: Path | None, own: Path) -> list[FileView]:
    """What was written since the job began, in its session and in its own folder."""
    found: list[FileView] = []
    if session is not None and session.is_dir():
        found += _listed(session, f"/api/v1/recordings/{quote(session.name, safe='')}/", "", job.times.started_ns)
    if own.is_dir():
        found += _listed(own, f"/api/v1/jobs/{job.id}/{FILES}/", f"{FILES}/", 0)
    return found[:MOST_FILES]


def listed_files(session: Path, name: str) -> tuple[list[FileView], int]:
    """The files of a session, and how many more there are than are listed."""
    found = _listed(session, f"/api/v1/recordings/{quote(name, safe='')}/", "", 0)
    return found[:MOST_FILES], max(len(found) - MOST_FILES, 0)


def _listed(folder: Path, href: str, prefix: str, since_ns: int) -> list[FileView]:
    found = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    paths = sorted(path for path in found if is_text(path.relative_to(folder).as_posix()))
    return [
        FileView(
            name=prefix + name, href=href + quote(name), bytes=found.st_size, media_type=media_type(name),
        )
        for path in paths
        for found in _looks(path)
        for name in (path.relative_to(folder).as_posix(),)
        if found.st_mtime_ns >= since_ns and not path.name.startswith(".")
    ]  # fmt: skip


def _looks(path: Path) -> Iterator[os.stat_result]:
    """One, or none of what was removed meanwhile."""
    with contextlib.suppress(FileNotFoundError):
        yield path.stat()


def media_type(name: str) -> str:
    """As a browser wants it."""
    found = TYPES.get(Path(name).suffix) or mimetypes.guess_type(name)[0]
    return found if found in FILE_TYPES else FILE_TYPES[0]
