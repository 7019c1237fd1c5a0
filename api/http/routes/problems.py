"""What the `type` of a problem leads to."""

from typing import Annotated

from fastapi import APIRouter, Path
from fastapi.responses import HTMLResponse

from api.http.access.rights import PUBLIC
from api.http.explained import EXPLAINED, page
from api.http.problems import RequestRefused, responses
from api.http.service import Service

Code = Annotated[str, Path(pattern=r"^[a-z_-]{1,40}$")]


def add(router: APIRouter, _service: Service) -> None:
    """Its route."""

    @router.get(
        "/problems/{code}",
        dependencies=[PUBLIC],
        summary="What a problem means and what to do about it",
        response_class=HTMLResponse,
        responses=responses("404 no-such-problem"),
    )
    def explained(code: Code) -> HTMLResponse:
        if code not in EXPLAINED:
            raise RequestRefused(404, "no-such-problem", f"no problem is called {code}; its message says it")
        return HTMLResponse(page(code))
