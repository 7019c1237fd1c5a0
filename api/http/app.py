"""The application: routes, page, problems, and who may talk to it."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any
from urllib.parse import urlsplit

from fastapi import FastAPI
from fastapi.responses import FileResponse, HTMLResponse, JSONResponse, Response
from fastapi.staticfiles import StaticFiles

import rig
from api.http import description, problems, routes
from api.http.access.access import cookie_name
from api.http.access.rights import PUBLIC, READ, Right, RightsTable
from api.http.guard import Guard
from api.http.jobs.kept import EXPORTS, forget_old
from api.http.service import Service
from api.http.streams import routes as stream_routes
from api.http.streams.feed import Feed
from api.http.streams.session import Streams
from api.page import BUILT, NOT_BUILT

AGAIN = {"Cache-Control": "no-cache"}


def build(service: Service, meanwhile: bool = False, names: tuple[str, ...] = ()) -> FastAPI:
    """The service's application; the bench is connected with it and disconnected with it.

    With ``meanwhile`` requests are answered while the bench still starts, which homes the axis: so that it can be seen,
    and stopped. ``names`` are those that it is reached by from elsewhere.
    """

    feed = Feed(service.wiring, lambda: service.bench, service.events, service.onlookers)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:  # noqa: ARG001 - the signature of a lifespan
        await asyncio.to_thread(forget_old, service.jobs.folder / EXPORTS)
        following = asyncio.create_task(feed.follow())
        starting = asyncio.create_task(asyncio.to_thread(service.connect))
        if not meanwhile:
            await starting
        yield
        await starting
        service.jobs.close()
        await asyncio.to_thread(service.disconnect)
        following.cancel()

    app = FastAPI(
        title="tissue-rig",
        version=rig.__version__,
        description="A soft-tissue bench over HTTP. The stop here is a software stop: the hardware emergency stop and"
        " the drive's own safe torque off remain the safety function.",
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        openapi_url=None,
    )
    problems.install(app)
    app.add_middleware(Guard, headers=_headers(service), access=service.access, rights=RightsTable(app), names=names)
    # As routes of the application's own: those of an included router are looked through twice for each request.
    for router in (routes.build(service), stream_routes.build(Streams(service.wiring, feed, service.id, service.lost))):
        app.router.routes.extend(router.routes)
    app.get("/api/v1/openapi.json", include_in_schema=False, dependencies=[READ])(lambda: JSONResponse(app.openapi()))
    app.get("/", include_in_schema=False, dependencies=[PUBLIC])(lambda: _page(service))
    app.mount("/page", PageFiles(directory=BUILT, check_dir=False))
    description.install(app, cookie_name(urlsplit(service.address).port or 0))
    return app


class PageFiles(StaticFiles):
    """The page itself holds nothing of the bench, and has to be there to log in."""

    right = Right(None)

    def file_response(self, *args: Any, **stated: Any) -> Response:
        """Asked for again each time, and sent where it is another."""
        found = super().file_response(*args, **stated)
        found.headers.update(AGAIN)
        return found

    async def check_config(self) -> None:
        """A checkout that has not built the page has no such folder: then there is no such file, and no failure."""


def _headers(service: Service) -> dict[str, str]:
    """The page may talk to this service and to what takes stops beside it, by whatever name the page was opened."""
    stops = " ".join(f"http://{host}:*" for host in ("127.0.0.1", "localhost"))
    stops += f" https://*:{service.away.port}" if service.away else ""
    return {
        "Content-Security-Policy": f"default-src 'self'; connect-src 'self' {stops}; frame-ancestors 'none'",
        "X-Content-Type-Options": "nosniff",
        "Cache-Control": "no-store",  # nothing of a subject stays on the disk of whoever looks
    }


def _page(service: Service) -> Response:
    """The page, or where a checkout has not built it what to do about that."""
    if not (BUILT / "index.html").is_file():
        return HTMLResponse(NOT_BUILT.format(stop_port=service.stop_port), status_code=503)
    return FileResponse(BUILT / "index.html", headers=AGAIN)
