"""The routes of the service, version 1, a module a concern. State is data, stops need nothing, motion is a job."""

from fastapi import APIRouter

from api.http.answers import ANSWERS
from api.http.idempotency import AnswerStore, idempotent
from api.http.routes import (
    access,
    bench,
    calibrations,
    catalogue,
    control,
    curves,
    devices,
    foresight,
    jobs,
    problems,
    protocols,
    recordings,
    sessions,
    stops,
    subject,
    uploads,
)
from api.http.routes.common import PREFIX
from api.http.service import Service

# Each adds its routes to the router, over the service; tried in this order, what is asked for all the time first.
MODULES = (
    bench, control, stops, jobs, access, subject, protocols, foresight, uploads, recordings, sessions, curves,
    catalogue, calibrations, devices, problems,
)  # fmt: skip


def build(service: Service) -> APIRouter:
    """All routes over ``service``."""
    router = APIRouter(prefix=PREFIX, route_class=idempotent(AnswerStore(service.jobs.folder / ANSWERS)))
    for module in MODULES:
        module.add(router, service)
    return router
