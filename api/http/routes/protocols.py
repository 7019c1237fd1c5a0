"""The protocols of this bench."""

from fastapi import APIRouter

from api.http.access.rights import READ
from api.http.models import ProtocolView
from api.http.protocols import ProtocolShelf
from api.http.service import Service


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""
    shelf = ProtocolShelf(service.protocols)

    @router.get("/protocols", dependencies=[READ], summary="Protocols that can be started")
    def protocols() -> list[ProtocolView]:
        return shelf.listed(service.wiring)
