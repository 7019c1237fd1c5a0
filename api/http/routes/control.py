"""The lease: who may move the bench."""

from fastapi import APIRouter

from api.http import views
from api.http.access.rights import OPERATE, READ
from api.http.access.scopes import Scope
from api.http.models import ControlView, LeaseRequest, LeaseView, TakeoverRequest
from api.http.problems import responses
from api.http.routes.common import LeaseHeader, WhoAsks
from api.http.service import Service


def add(router: APIRouter, service: Service) -> None:
    """Its routes: in the event loop, as none of them waits for anything and a page renews its lease each second."""

    @router.get("/control/lease", dependencies=[READ], summary="Who is in control")
    async def shown() -> ControlView:
        return views.control(service)

    @router.post(
        "/control/lease",
        dependencies=[OPERATE],
        summary="Takes control, for as long as it is renewed",
        responses=responses("423 lease-held"),
    )
    async def take(request: LeaseRequest, caller: WhoAsks) -> LeaseView:
        held = service.control.take(caller.known_as(request.holder), request.ttl_s, request.purpose)
        return views.lease(service, held)

    @router.put("/control/lease", dependencies=[OPERATE], summary="Renews the lease")
    async def renew(lease: LeaseHeader = "") -> LeaseView:
        return views.lease(service, service.control.renew(lease))

    @router.delete("/control/lease", dependencies=[OPERATE], summary="Gives control back; what moves is stopped")
    async def release(lease: LeaseHeader = "") -> ControlView:
        service.control.release(lease)
        return views.control(service)

    @router.post(
        "/control/take",
        dependencies=[OPERATE],
        summary="Takes control from whoever has it; what moves is stopped, which asks for the scope admin",
        responses=responses("423 lease-moving"),
    )
    async def take_over(request: TakeoverRequest, caller: WhoAsks) -> LeaseView:
        may_stop = caller.may(Scope.ADMIN)
        lease = service.control.take_over(
            caller.known_as(request.holder), request.ttl_s, request.purpose, request.reason, service.moves, may_stop
        )
        service.stop_taken_over()
        return views.lease(service, lease)
