"""The application: routes, page, problems, and who may talk to it."""

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from fastapi import FastAPI, Request, Response
from fastapi.responses import FileResponse
from fastapi.staticfiles import StaticFiles

import rig
from api.http import problems, routes
from api.http.problems import Problem
from api.http.service import Service

PAGE = Path(__file__).parent / "page"
LOCAL = ("127.0.0.1", "localhost", "::1")
Next = Callable[[Request], Awaitable[Response]]
INVALID = 422
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
CONTENT_POLICY = "default-src 'self'; frame-ancestors 'none'"


def build(service: Service) -> FastAPI:
    """The service's application; the bench is connected with it and disconnected with it."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:  # noqa: ARG001 - the signature of a lifespan
        service.connect()
        yield
        service.disconnect()

    app = FastAPI(
        title="tissue-rig",
        version=rig.__version__,
        description="A soft-tissue bench over HTTP. The stop here is a software stop: the hardware emergency stop and"
        " the drive's own safe torque off remain the safety function.",
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/v1/openapi.json",
    )
    problems.install(app)
    app.middleware("http")(_own_pages_only)
    app.include_router(routes.build(service))
    app.get("/", include_in_schema=False)(_page)
    app.mount("/page", StaticFiles(directory=PAGE))
    _describe_problems(app)
    return app


async def _page() -> FileResponse:
    return FileResponse(PAGE / "index.html")


async def _own_pages_only(request: Request, call_next: Next) -> Response:
    """No other site's page may move this bench: the host must be local, and so must the page that asks."""
    host = request.url.hostname or ""
    origin = request.headers.get("origin")
    if host not in LOCAL and not _same_host(request):
        return problems.answer(403, "host", f"the host name {host} is not this service's")
    if origin and request.method not in SAFE_METHODS and urlsplit(origin).netloc != request.headers.get("host"):
        return problems.answer(403, "origin", f"a page of {origin} may not act on this bench")
    response = await call_next(request)
    response.headers["Content-Security-Policy"] = CONTENT_POLICY
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Cache-Control"] = "no-cache"
    return response


def _same_host(request: Request) -> bool:
    address, _ = request.scope.get("server") or ("", 0)
    return request.url.hostname == address


def _describe_problems(app: FastAPI) -> None:
    """Puts Problem among the schemas, and problem+json in place of the framework's own validation error."""
    original = app.openapi

    def described() -> dict[str, Any]:
        schema: dict[str, Any] = original()
        schemas = schema["components"]["schemas"]
        schemas["Problem"] = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
        for unused in ("HTTPValidationError", "ValidationError"):
            schemas.pop(unused, None)
        operations = [operation for path in schema["paths"].values() for operation in path.values()]
        for operation in operations:
            operation["responses"].update(
                {key: ours[int(key)] for key in operation["responses"] if int(key) == INVALID}
            )
        return schema

    ours = problems.responses(INVALID)
    app.openapi = described  # type: ignore[method-assign]
