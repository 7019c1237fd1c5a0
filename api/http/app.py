"""The application: routes, page, problems, and who may talk to it."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.responses import FileResponse
from fastapi.staticfiles import StaticFiles

import rig
from api.http import problems, routes
from api.http.guard import Guard
from api.http.problems import Problem
from api.http.service import Service

PAGE = Path(__file__).parent / "page"
INVALID = 422


def build(service: Service, meanwhile: bool = False) -> FastAPI:
    """The service's application; the bench is connected with it and disconnected with it.

    With ``meanwhile`` requests are answered while the bench still starts, which homes the axis: so that it can be seen,
    and stopped.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:  # noqa: ARG001 - the signature of a lifespan
        starting = asyncio.create_task(asyncio.to_thread(service.connect))
        if not meanwhile:
            await starting
        yield
        await starting
        await asyncio.to_thread(service.disconnect)

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
    app.add_middleware(Guard, headers=_headers())
    app.include_router(routes.build(service))
    app.get("/", include_in_schema=False)(_page)
    app.mount("/page", StaticFiles(directory=PAGE))
    _describe_problems(app)
    return app


def _headers() -> dict[str, str]:
    """The page may talk to this service and to the stop process on this computer, whatever port that has."""
    stops = " ".join(f"http://{host}:*" for host in ("127.0.0.1", "localhost"))
    return {
        "Content-Security-Policy": f"default-src 'self'; connect-src 'self' {stops}; frame-ancestors 'none'",
        "X-Content-Type-Options": "nosniff",
        "Cache-Control": "no-cache",
    }


async def _page() -> FileResponse:
    return FileResponse(PAGE / "index.html")


def _describe_problems(app: FastAPI) -> None:
    """Puts Problem among the schemas, and problem+json in place of the framework's own validation error."""
    original = app.openapi

    def described() -> dict[str, Any]:
        schema = original()
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
