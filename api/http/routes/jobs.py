"""Jobs: what takes longer than an answer, for everything that the command line can do."""

from collections.abc import Mapping
from typing import Annotated

from fastapi import APIRouter, Body, Request, Response

from api.http.access.rights import CALLER, OPERATE, READ, STOP, Right
from api.http.access.scopes import Scope
from api.http.downloads import FileAsOfNow, files_at
from api.http.guard import lacking
from api.http.idempotency import KeyHeader, refuse_without_key
from api.http.jobs.examples import EXAMPLES
from api.http.jobs.kinds import KINDS, AnyJob
from api.http.jobs.places import regular_file
from api.http.jobs.start import start
from api.http.jobs.states import JobState
from api.http.jobs.store import place
from api.http.jobs.views import JobView, media_type
from api.http.listing import Listing, listing
from api.http.models import JobSummary
from api.http.problems import RequestRefused, responses
from api.http.routes.common import PREFIX, LeaseHeader, PageQuery, WhoAsks, Word
from api.http.service import Service

JSON = "application/json"
REFUSED = responses(
    "400 idempotency-key", "404 no-such-session", "404 no-such-model", "404 no-such-upload", "404 no-such-protocol",
    "404 no-such-recording", "409 busy", "409 stopped", "409 session-exists", "409 link", "422 refused",
    "429 queue-full", "503 disconnected", "507 disk-full",
)  # fmt: skip


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""
    _lists(router, service)
    _verbs(router, service)

    @router.post(
        "/jobs",
        dependencies=[OPERATE],
        status_code=202,
        response_model=JobView,
        summary="Starts a job; one that uses the bench asks for the lease and an Idempotency-Key",
        responses=REFUSED,
    )
    def begin(
        request: Annotated[AnyJob, Body(openapi_examples=EXAMPLES)],
        caller: WhoAsks,
        lease: LeaseHeader = "",
        key: KeyHeader = "",
    ) -> Response:
        if KINDS[request.kind].moves:
            service.control.check(lease)
            refuse_without_key(key)
        job = start(service, request, caller.name, lease)
        return Response(service.jobs.shown(job.id), 202, {"Location": f"{PREFIX}/jobs/{job.id}"}, JSON)


def _lists(router: APIRouter, service: Service) -> None:
    @router.get("/jobs", dependencies=[READ], summary="Jobs, newest first")
    def jobs(
        page: PageQuery, kind: Word = "", state: JobState | None = None, session: Word = "", moves: bool | None = None
    ) -> Listing[JobSummary]:
        wanted: Mapping[str, str | bool | None] = {"kind": kind, "state": state, "session": session, "moves": moves}
        return listing("jobs", service.jobs.listed(), page, place, newest_first=True, **wanted)

    @router.get(
        "/jobs/{identifier}",
        dependencies=[READ],
        response_model=JobView,
        summary="One job",
        responses=responses("404 no-such-job"),
    )
    def job(identifier: str) -> Response:
        return Response(service.jobs.shown(identifier), media_type=JSON)

    @files_at(
        router,
        "/jobs/{identifier}/files/{path:path}",
        READ,
        responses("404 no-such-job", "404 no-such-file"),
        "A file of a job's own; HEAD and ranges are served",
    )
    def download(identifier: str, path: str) -> FileAsOfNow:
        found = regular_file(service.jobs.files(identifier), path)
        if found is None:
            raise RequestRefused(404, "no-such-file", f"job {identifier} has no file {path[:200]!r}")
        return FileAsOfNow(found, media_type=media_type(found.name), filename=found.name)


def _verbs(router: APIRouter, service: Service) -> None:
    said = responses("404 no-such-job", "409 job-state", "503 disconnected", "503 device")

    def shown(identifier: str) -> Response:
        return Response(service.jobs.shown(identifier), media_type=JSON)

    @router.post(
        "/jobs/{identifier}/cancel",
        dependencies=[STOP],
        response_model=JobView,
        summary="Ends this job and no other; what moves is stopped and retracts, all else asks for the scope operate",
        responses={204: {"description": "the same, of which whoever has no credential is told nothing"}, **said},
    )
    def cancel(identifier: str, request: Request) -> Response:
        job = service.jobs.find(identifier)
        refused = None if job is None or job.asked.moves else lacking(Right(Scope.OPERATE), request.scope)
        if refused:
            return refused
        service.jobs.cancel(identifier)
        return shown(identifier) if request.scope[CALLER] else Response(status_code=204)

    @router.post(
        "/jobs/{identifier}/pause",
        dependencies=[OPERATE],
        response_model=JobView,
        summary="Lets a capture wait before its next trial, with the tip out",
        responses=said,
    )
    def pause(identifier: str, lease: LeaseHeader = "") -> Response:
        service.control.check(lease)
        service.jobs.alive(identifier).pause()
        return shown(identifier)

    @router.post(
        "/jobs/{identifier}/resume",
        dependencies=[OPERATE],
        response_model=JobView,
        summary="Lets a paused job go on; in a calibration it says that what was asked for is done",
        responses={**said, **responses("400 idempotency-key")},
    )
    def resume(identifier: str, lease: LeaseHeader = "", key: KeyHeader = "") -> Response:
        service.control.check(lease)
        refuse_without_key(key)
        service.jobs.alive(identifier).resume(lease)
        return shown(identifier)
