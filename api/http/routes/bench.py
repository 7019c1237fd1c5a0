"""Who this service is, and its bench as of now."""

import time

from fastapi import APIRouter, Request, Response

import rig
from api.http import views
from api.http.access.rights import CALLER, OPERATE, PUBLIC, READ
from api.http.capabilities import capabilities_of
from api.http.idempotency import KeyHeader, refuse_without_key
from api.http.models import Info, RigView
from api.http.problems import RequestRefused, responses
from api.http.routes.common import LeaseHeader
from api.http.service import Service


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""
    capabilities = capabilities_of(service.wiring)

    @router.get("/info", dependencies=[PUBLIC], response_model=Info, summary="Who this service is, and what it can do")
    async def info(request: Request) -> Response:
        found = Info(
            software=f"tissue-rig {rig.__version__}",
            service_id=service.id,
            monotonic_ns=time.monotonic_ns(),
            sessions_folder=str(service.sessions) if request.scope[CALLER] else "",
            stop_port=service.stop_port,
            away_stops=service.away.address(request.url.hostname or "") if service.away else "",
            capabilities=capabilities,
        )
        return Response(found.model_dump_json(), media_type="application/json")

    # Asked for most often: in the event loop, which it takes less of than a thread would, and written once.
    @router.get("/rig", dependencies=[READ], response_model=RigView, summary="The bench as of now")
    async def status() -> Response:
        return Response(views.rig(service).model_dump_json(), media_type="application/json")

    @router.post(
        "/rig/connect",
        dependencies=[OPERATE],
        summary="Starts loop and devices where they are not running",
        responses=responses("400 idempotency-key", "409 busy"),
    )
    def connect(lease: LeaseHeader = "", key: KeyHeader = "") -> RigView:
        service.control.check(lease)
        refuse_without_key(key)
        if service.running:
            raise RequestRefused(409, "busy", "a job is under way")
        service.connect(lease)
        return views.rig(service)
