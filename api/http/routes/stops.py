"""Stops, and the way back after them."""

from fastapi import APIRouter

from api.http import views
from api.http.access.rights import OPERATE, STOP
from api.http.idempotency import KeyHeader, refuse_without_key
from api.http.models import Done, RecoverRequest
from api.http.problems import responses
from api.http.routes.common import LeaseHeader
from api.http.service import Service
from controller.recovery.situation import Consent
from controller.stop.word import StopOutcome, StopReason
from rig.results.bench import ResetResult


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""
    _stops(router, service)

    @router.post(
        "/estop/reset",
        dependencies=[OPERATE],
        summary="Acknowledges a stop; moves nothing",
        responses=responses("409 busy", "409 cause-not-cleared", "503 disconnected", "503 device"),
    )
    def reset(lease: LeaseHeader = "") -> Done:
        service.control.check(lease)
        service.reset()
        return _done(service, "acknowledged")

    @router.post(
        "/recover",
        dependencies=[OPERATE],
        summary="After a crash, a fault or a stop: says what happened, and does what is agreed to",
        responses=responses("400 idempotency-key", "409 busy", "409 not-recovered", "503 disconnected"),
    )
    def recover(request: RecoverRequest, lease: LeaseHeader = "", key: KeyHeader = "") -> ResetResult:
        service.control.check(lease)
        refuse_without_key(key)
        return service.recover(Consent(request.clear, request.retract, request.home), lease)


def _stops(router: APIRouter, service: Service) -> None:
    told = responses("503 disconnected", "503 device", "504 not-confirmed")
    software = "Software emergency stop: the drive's own quick stop"

    @router.post("/estop", dependencies=[STOP], summary=software, responses=told)
    async def emergency_stop() -> Done:
        return _stopped(service, await service.stop(StopReason.EMERGENCY))

    @router.post("/pain", dependencies=[STOP], summary="The subject's stop: retracts at safe speed", responses=told)
    async def pain() -> Done:
        return _stopped(service, await service.stop(StopReason.PAIN))


def _done(service: Service, detail: str) -> Done:
    return Done(done=True, mode=views.rig(service).mode, detail=detail)


def _stopped(service: Service, answer: StopOutcome) -> Done:
    return _done(service, answer.text).model_copy(update={"id": answer.id})
