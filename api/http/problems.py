"""Errors of the service as RFC 9457 problem details: what happened, where, and what to do next."""

from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException

from rig.errors import DeviceError, RigError, SafetyStop, UsageError

MEDIA_TYPE = "application/problem+json"


class Problem(BaseModel):
    """Problem details, RFC 9457."""

    type: str = Field(description="what kind of problem, as a path below /api/v1/problems")
    title: str
    status: int
    detail: str
    code: str = Field(description="short name for programs")


class RequestRefused(RigError):
    """A request that is right in itself but not in the present state; carries HTTP status and code."""

    def __init__(self, status: int, code: str, detail: str) -> None:
        super().__init__(detail)
        self.status, self.code = status, code


TITLES = {
    400: "the request is wrong",
    401: "a token is needed",
    403: "not from there",
    404: "there is no such thing",
    405: "not with this method",
    408: "too slow",
    409: "not in the present state",
    413: "too large",
    422: "the request is wrong",
    503: "the bench is not available",
    504: "no answer in time",
}


def answer(status: int, code: str, detail: str) -> JSONResponse:
    """One problem as a response."""
    title = TITLES.get(status, "the request failed")
    problem = Problem(type=f"/api/v1/problems/{code}", title=title, status=status, detail=detail, code=code)
    return JSONResponse(problem.model_dump(), status, media_type=MEDIA_TYPE)


def responses(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI entry of the problems a route may answer with."""
    return {
        status: {
            "description": TITLES[status],
            "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}},
        }
        for status in statuses
    }


def install(app: FastAPI) -> None:
    """Every failure of the service leaves as a problem."""

    async def validation(request: Request, error: Exception) -> JSONResponse:  # noqa: ARG001
        assert isinstance(error, RequestValidationError)
        wrong = "; ".join(f"{'.'.join(str(part) for part in e['loc'][1:])}: {e['msg']}" for e in error.errors())
        return answer(422, "invalid-request", wrong)

    async def http(request: Request, error: Exception) -> JSONResponse:  # noqa: ARG001
        assert isinstance(error, HTTPException)
        return answer(error.status_code, "http", str(error.detail))

    async def ours(request: Request, error: Exception) -> JSONResponse:  # noqa: ARG001
        assert isinstance(error, RigError)
        return _ours(error)

    app.add_exception_handler(RequestValidationError, validation)
    app.add_exception_handler(HTTPException, http)
    app.add_exception_handler(RigError, ours)


def _ours(error: RigError) -> JSONResponse:
    match error:
        case RequestRefused():
            return answer(error.status, error.code, str(error))
        case SafetyStop():
            return answer(409, "safety-stop", str(error))
        case UsageError():
            return answer(422, "refused", str(error))
        case DeviceError():
            return answer(503, "device", str(error))
        case _:
            return answer(500, "failed", str(error))
