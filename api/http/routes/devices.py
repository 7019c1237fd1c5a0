"""What this installation knows of devices."""

from fastapi import APIRouter

from api.http.access.rights import READ
from api.http.service import Service
from api.operations.devices import devices as known_devices
from rig.results.devices import DevicesResult


def add(router: APIRouter, _service: Service) -> None:
    """Its route."""

    @router.get("/devices", dependencies=[READ], summary="Products and plug-ins that this installation knows")
    def devices() -> DevicesResult:
        return known_devices()
