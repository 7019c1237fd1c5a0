"""The protocols of this bench."""

from fastapi import APIRouter

from api.http.access.rights import READ
from api.http.listing import Listing, listing
from api.http.models import ProtocolView
from api.http.protocols import ProtocolShelf
from api.http.routes.common import PageQuery, Word
from api.http.service import Service


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""
    shelf = ProtocolShelf(service.protocols)

    @router.get("/protocols", dependencies=[READ], summary="Protocols, by name; refused: those that cannot be started")
    def protocols(page: PageQuery, name: Word = "", refused: bool | None = None) -> Listing[ProtocolView]:
        found = (one for one in shelf.listed(service.wiring) if refused in (None, bool(one.refusal)))
        return listing("protocols", found, page, lambda one: (one.name, ""), name=name)
