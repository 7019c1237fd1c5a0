"""Sessions: looked at, taken away in every format, and erased in two steps."""

import asyncio
import shutil
import tempfile
from collections.abc import Coroutine
from pathlib import Path
from typing import Literal

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from api.catalogue.erasing import put_aside
from api.http import views
from api.http.access.rights import ADMIN, READ
from api.http.downloads import FileAsOfNow, files_at
from api.http.erasing import Confirm, SessionErasure, state_of, to_confirm
from api.http.jobs.kept import EXPORTS, forget_old
from api.http.jobs.kinds import ExportJob
from api.http.jobs.params import ExportParams
from api.http.jobs.start import start
from api.http.jobs.views import FileView, listed_files, media_type
from api.http.models import SessionView
from api.http.problems import DISK_FULL, RequestRefused, responses
from api.http.room import refuse_full, size_of
from api.http.service import Service
from rig.recording.files import whole_file

Format = Literal["csv", "parquet", "hdf5", "mat", "mcap"]
NAMES = {"csv": "csv", "parquet": "parquet", "hdf5": "session.h5", "mat": "session.mat"}
FOLDERS = ("csv", "parquet")
LOOK_S = 0.1
PATIENCE_S = 20.0  # programs and proxies give up after 30 s
RETRY_S = 5
# Whoever may only look leaves room in the queue of computations for those who measure.
MOST_UNDER_WAY = 8


class SessionFiles(SessionView):
    """A session with everything in its folder, also what was found in it."""

    files: list[FileView]
    files_left_out: int = Field(default=0, description="how many more the folder has")


class ExportUnderWay(BaseModel):
    """The file is being made, or waits for other computations; the same request gets it later."""

    session: str
    form: Format
    retry_after_s: int


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""
    _looks(router, service)
    _exports(router, service)
    _erasure(router, service)


def _looks(router: APIRouter, service: Service) -> None:
    @router.get(
        "/sessions/{session}",
        dependencies=[READ],
        summary="One session, with all its files",
        responses=responses("404 no-such-session"),
    )
    def one(session: str) -> SessionFiles:
        folder = service.session(session)
        files, more = listed_files(folder, session)
        return SessionFiles(**vars(views.session(folder)), files=files, files_left_out=more)


def _exports(router: APIRouter, service: Service) -> None:
    under_way: dict[Path, asyncio.Task[None]] = {}

    @files_at(
        router,
        "/sessions/{session}/export/{form}",
        READ,
        {
            202: {"model": ExportUnderWay},
            **responses("404 no-such-session", "409 link", "409 failed", "429 queue-full", "507 disk-full"),
        },
        "A session in another format as one file, made when it is first asked for; HEAD and ranges are served",
    )
    async def export(session: str, form: Format) -> Response:
        # In a thread: a session may have thousands of files, and no stop waits for a look at them.
        state = await asyncio.to_thread(state_of, service.session(session))
        whole = form in FOLDERS or form == "mcap"
        file = service.jobs.folder / EXPORTS / f"{state}.{f'{form}.zip' if whole else NAMES[form]}"
        if not file.is_file():
            making = _made(service, session, form, file)
            if not await _awaited(under_way, file, making):
                later = ExportUnderWay(session=session, form=form, retry_after_s=RETRY_S)
                return Response(later.model_dump_json(), 202, {"Retry-After": str(RETRY_S)}, "application/json")
        name = f"{session}-{form}{''.join(file.suffixes[-1:])}"
        return FileAsOfNow(file, media_type=media_type(file.name), filename=name)


async def _awaited(under_way: dict[Path, asyncio.Task[None]], file: Path, making: Coroutine[None, None, None]) -> bool:
    """Whether it is there; it is made once, however many ask and however soon they go."""
    if file in under_way:
        making.close()
    elif len(under_way) >= MOST_UNDER_WAY:
        making.close()
        raise RequestRefused(429, "queue-full", f"{MOST_UNDER_WAY} exports are under way already; wait for one to end")
    else:
        under_way[file] = asyncio.create_task(making)
        under_way[file].add_done_callback(lambda _: under_way.pop(file))
    task = under_way[file]
    done, _ = await asyncio.wait({task}, timeout=PATIENCE_S)
    for ended in done:
        ended.result()
    return bool(done)


async def _made(service: Service, session: str, form: Format, file: Path) -> None:
    """By a job, as everything that takes long."""
    file.parent.mkdir(parents=True, exist_ok=True)
    await asyncio.to_thread(forget_old, file.parent)
    if form == "mcap":
        folder = await asyncio.to_thread(service.jobs.places("").session, session)
        await asyncio.to_thread(_zipped, folder, file)
        return
    body = ExportJob(kind="export", params=ExportParams(session=session, formats=[form]))
    job = await asyncio.to_thread(start, service, body, "export")
    while not job.ended:
        await asyncio.sleep(LOOK_S)
    if job.wrong:
        raise RequestRefused(507 if job.wrong.code == DISK_FULL else 409, job.wrong.code, job.wrong.detail)
    made = service.jobs.files(job.id) / NAMES[form]
    await asyncio.to_thread(_zipped if form in FOLDERS else _copied, made, file)


def _zipped(folder: Path, file: Path) -> None:
    refuse_full(file.parent, size_of(folder))
    with tempfile.TemporaryDirectory(prefix=".", dir=file.parent) as scratch:
        Path(shutil.make_archive(f"{scratch}/whole", "zip", folder)).replace(file)


def _copied(made: Path, file: Path) -> None:
    refuse_full(file.parent, made.stat().st_size)
    with whole_file(file) as scratch:
        shutil.copyfile(made, scratch)


def _erasure(router: APIRouter, service: Service) -> None:
    @router.delete(
        "/sessions/{session}",
        dependencies=[ADMIN],
        summary="First says what would be erased, with 202; with what that says as `confirm` it is erased",
        responses={202: {"model": SessionErasure}, **responses("404 no-such-session", "409 busy", "409 stale")},
    )
    def erase(session: str, response: Response, confirm: Confirm = "") -> SessionErasure:
        folder = service.session(session)
        if any(job.works_on(session) for job in service.jobs.active):
            raise RequestRefused(409, "busy", f"a job works on session {session}; cancel it or wait")
        token = to_confirm(f"session {session}", folder, confirm, response)
        files = [path for path in folder.rglob("*") if path.is_file()]
        size = sum(path.lstat().st_size for path in files)
        found = SessionErasure(session=session, done=not token, files=len(files), bytes=size, confirm=token)
        if not token:
            with put_aside(service.sessions, [session]):
                service.jobs.erase([session])
        return found
