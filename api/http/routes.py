"""The routes of the service, version 1. State is data, stops need nothing, motion is a job."""

import time
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Header, Response
from fastapi.responses import FileResponse, StreamingResponse

import rig
from api.http import views
from api.http.live import Broadcast
from api.http.models import (
    CaptureRequest,
    ControlView,
    Done,
    Info,
    JobView,
    LeaseRequest,
    LeaseView,
    Name,
    ProtocolView,
    RecoverRequest,
    RetractRequest,
    RigView,
    SessionView,
    TrackRequest,
)
from api.http.problems import RequestRefused, responses
from api.http.service import Service
from controller.recovery.situation import Consent
from controller.stop.word import StopOutcome, StopReason
from rig.results.bench import ResetResult

PREFIX = "/api/v1"
MEDIA_TYPES = {".mcap": "application/octet-stream", ".json": "application/json", ".html": "text/html"}

LeaseHeader = Annotated[str, Header(alias="X-Control-Lease", description="lease_id of the lease in force")]


def build(service: Service) -> APIRouter:
    """All routes over ``service``."""
    router = APIRouter(prefix=PREFIX)
    _state(router, service)
    _control(router, service)
    _stops(router, service)
    _recovery(router, service)
    _jobs(router, service)
    _recordings(router, service)
    return router


def _state(router: APIRouter, service: Service) -> None:
    broadcast = Broadcast(lambda: views.rig(service).model_dump_json())

    @router.get("/info", summary="Who this service is")
    def info() -> Info:
        return Info(
            software=f"tissue-rig {rig.__version__}",
            service_id=service.id,
            monotonic_ns=time.monotonic_ns(),
            sessions_folder=str(service.sessions),
            stop_port=service.stop_port,
        )

    @router.get("/rig", summary="The bench as of now")
    def status() -> RigView:
        return views.rig(service)

    @router.post("/rig/connect", summary="Starts loop and devices where they are not running", responses=responses(409))
    def connect(lease: LeaseHeader = "") -> RigView:
        service.control.check(lease)
        if service.running:
            raise RequestRefused(409, "busy", "a job is under way")
        service.connect()
        return views.rig(service)

    @router.get(
        "/live",
        summary="The bench twenty times a second as server-sent events; a slow reader gets the newest",
        response_class=StreamingResponse,
        responses={200: {"content": {"text/event-stream": {"schema": {"type": "string"}}}}},
    )
    async def live() -> StreamingResponse:
        return StreamingResponse(broadcast.stream(), media_type="text/event-stream")

    @router.get("/protocols", summary="Protocols that can be started")
    def protocols() -> list[ProtocolView]:
        return views.protocols(service)


def _control(router: APIRouter, service: Service) -> None:
    @router.get("/control/lease", summary="Who is in control")
    def shown() -> ControlView:
        return views.control(service)

    @router.post("/control/lease", summary="Takes control, for as long as it is renewed", responses=responses(409))
    def take(request: LeaseRequest) -> LeaseView:
        return views.lease(service, service.control.take(request.holder, request.ttl_s))

    @router.put("/control/lease", summary="Renews the lease", responses=responses(409))
    def renew(lease: LeaseHeader = "") -> LeaseView:
        return views.lease(service, service.control.renew(lease))

    @router.delete("/control/lease", summary="Gives control back; what moves is stopped", responses=responses(409))
    def release(lease: LeaseHeader = "") -> ControlView:
        service.control.release(lease)
        return views.control(service)


def _stops(router: APIRouter, service: Service) -> None:
    @router.post("/estop", summary="Software emergency stop: the drive's own quick stop", responses=responses(503, 504))
    async def emergency_stop() -> Done:
        return _stopped(service, await service.stop(StopReason.EMERGENCY))

    @router.post("/pain", summary="The subject's stop: retracts at safe speed", responses=responses(503, 504))
    async def pain() -> Done:
        return _stopped(service, await service.stop(StopReason.PAIN))

    @router.post("/estop/reset", summary="Acknowledges a stop; moves nothing", responses=responses(409, 503))
    def reset(lease: LeaseHeader = "") -> Done:
        service.control.check(lease)
        service.reset()
        return _done(service, "acknowledged")


def _recovery(router: APIRouter, service: Service) -> None:
    @router.post(
        "/recover",
        summary="After a crash, a fault or a stop: says what happened, and does what is agreed to",
        responses=responses(409, 503),
    )
    def recover(request: RecoverRequest, lease: LeaseHeader = "") -> ResetResult:
        service.control.check(lease)
        return service.recover(Consent(request.clear, request.retract, request.home))


def _done(service: Service, detail: str) -> Done:
    return Done(done=True, mode=views.rig(service).mode, detail=detail)


def _stopped(service: Service, answer: StopOutcome) -> Done:
    return _done(service, answer.text).model_copy(update={"id": answer.id})


def _jobs(router: APIRouter, service: Service) -> None:
    @router.post(
        "/jobs", status_code=202, summary="Starts a capture or a tracking run", responses=responses(404, 409, 503)
    )
    def start(
        request: CaptureRequest | TrackRequest | RetractRequest, response: Response, lease: LeaseHeader = ""
    ) -> JobView:
        service.control.check(lease)
        if isinstance(request, CaptureRequest):
            job = service.capture(lease, request.protocol, request.session)
        elif isinstance(request, RetractRequest):
            job = service.retract(lease)
        else:
            job = service.track(lease, request.session, request.forces_N, request.seconds)
        response.headers["Location"] = f"{PREFIX}/jobs/{job.id}"
        return views.job(job)

    @router.get("/jobs", summary="All jobs since the service started, oldest first")
    def jobs() -> list[JobView]:
        return [views.job(job) for job in service.jobs.values()]

    @router.get("/jobs/{identifier}", summary="One job", responses=responses(404))
    def job(identifier: str) -> JobView:
        return views.job(service.job(identifier))

    @router.post("/jobs/{identifier}/stop", summary="Stops this job and retracts", responses=responses(404, 503))
    def stop(identifier: str) -> JobView:
        return views.job(service.stop_job(identifier))


def _recordings(router: APIRouter, service: Service) -> None:
    @router.get("/recordings", summary="Sessions with their recordings, newest first")
    def recordings() -> list[SessionView]:
        return views.sessions(service)

    @router.get(
        "/recordings/{session}/{file}",
        summary="One file of a session; ranges are served",
        response_class=FileResponse,
        responses={200: {"content": {"application/octet-stream": {}}}, **responses(404)},
    )
    def download(session: Name, file: Name) -> FileResponse:
        path = service.session(session) / file
        # A link may lead out of the session, to what nobody meant to serve.
        if not path.is_file() or path.is_symlink():
            raise RequestRefused(404, "no-such-recording", f"session {session} has no file {file}")
        return FileResponse(path, media_type=_media_type(path), filename=f"{session}-{file}")


def _media_type(path: Path) -> str:
    return MEDIA_TYPES.get(path.suffix, "application/octet-stream")
