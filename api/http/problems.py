"""Errors of the service as RFC 9457 problem details: what happened, where, and what to do next."""

from collections.abc import Mapping
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException

from api.catalogue.erasing import NotErased
from api.http.explained import EXPLAINED
from api.http.jobs.places import PlaceRefused
from rig.errors import NO_ROOM, DeviceError, DiskFull, RigError, SafetyStop, UsageError, WriteFailed

MEDIA_TYPE = "application/problem+json"
DISK_FULL = "disk-full"
NONE: Mapping[str, str] = {}


class Problem(BaseModel):
    """Problem details, RFC 9457."""

    type: str = Field(description="what kind of problem, as a path below /api/v1/problems")
    title: str
    status: int
    detail: str
    code: str = Field(description="short name for programs")
    holder: str | None = Field(default=None, description="who is in control, where that is why")
    purpose: str | None = Field(default=None, description="what the holder wants to do")
    since: str | None = Field(default=None, description="since when the holder is in control")
    state: str | None = Field(default=None, description="of the job that was asked for what it cannot do")
    taken_by: str | None = Field(default=None, description="who took control over from whoever sent this")
    reason: str | None = Field(default=None, description="why, as stated at the takeover")


class RequestRefused(RigError):
    """A request that is right in itself but not in the present state; carries what `answer` takes."""

    def __init__(
        self, status: int, code: str, detail: str, members: Mapping[str, str] = NONE, headers: Mapping[str, str] = NONE
    ) -> None:
        super().__init__(detail)
        self.status, self.code, self.members, self.headers = status, code, members, headers


class NotDone(RequestRefused):
    """What was begun and did not succeed: it may have moved before."""


TITLES = {
    400: "the request is wrong",
    401: "a token is needed",
    403: "not from there",
    404: "there is no such thing",
    405: "not with this method",
    408: "too slow",
    409: "not in the present state",
    412: "changed meanwhile",
    413: "too large",
    415: "not in this form",
    416: "no such part",
    422: "the request is wrong",
    423: "somebody else is in control, or nobody",
    428: "say what is to be changed",
    429: "too many requests",
    503: "the bench is not available",
    504: "no answer in time",
    507: "no room on the disk",
}


def title(status: int) -> str:
    """What all problems of ``status`` have in common."""
    return TITLES.get(status, "the request failed")


def problem(status: int, code: str, detail: str) -> Problem:
    """One problem; ``code`` leads to its page."""
    return Problem(type=f"/api/v1/problems/{code}", title=title(status), status=status, detail=detail, code=code)


def answer(
    status: int, code: str, detail: str, members: Mapping[str, str] = NONE, headers: Mapping[str, str] = NONE
) -> JSONResponse:
    """One problem as a response; ``members`` are more of its fields."""
    shown = problem(status, code, detail).model_copy(update=members)
    return JSONResponse(shown.model_dump(exclude_none=True), status, headers, MEDIA_TYPE)


def responses(*words: str) -> dict[int | str, dict[str, Any]]:
    """The OpenAPI entries of the problems a route may answer with, each named by status and code: ``409 busy``."""
    found: dict[int | str, dict[str, Any]] = {}
    for word in words:
        status, _, code = word.partition(" ")
        content = {"schema": {"$ref": "#/components/schemas/Problem"}, "examples": {}}
        entry = found.setdefault(int(status), {"description": title(int(status)), "content": {MEDIA_TYPE: content}})
        entry["content"][MEDIA_TYPE]["examples"][code] = _example(int(status), code)
    return found


def _example(status: int, code: str) -> dict[str, Any]:
    meaning, step = EXPLAINED[code]
    return {"summary": meaning, "value": problem(status, code, f"{meaning} {step}").model_dump(exclude_none=True)}


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

    async def system(request: Request, error: Exception) -> JSONResponse:  # noqa: ARG001
        assert isinstance(error, OSError)
        if error.errno in NO_ROOM:
            where = f"{error.filename}: " if error.filename else ""
            return answer(507, DISK_FULL, f"{where}{error.strerror}; remove what is not needed, then try again")
        if error.filename is None:
            raise error
        if isinstance(error, FileNotFoundError):
            return answer(404, "gone", f"{error.filename} was removed meanwhile; look at the list again")
        return answer(503, "storage", f"{error.filename}: {error.strerror}; see to that, then try again")

    async def unforeseen(request: Request, error: Exception) -> JSONResponse:  # noqa: ARG001
        text = f"the service met an error of its own ({type(error).__name__}); report it with what it has printed"
        return answer(500, "error", text)

    app.add_exception_handler(RequestValidationError, validation)
    app.add_exception_handler(HTTPException, http)
    app.add_exception_handler(RigError, ours)
    app.add_exception_handler(OSError, system)
    app.add_exception_handler(Exception, unforeseen)


def _ours(error: RigError) -> JSONResponse:
    match error:
        case RequestRefused():
            return answer(error.status, error.code, str(error), error.members, error.headers)
        case PlaceRefused():
            return answer(error.status, error.code, str(error))
        case SafetyStop():
            return answer(409, "safety-stop", str(error))
        case UsageError():
            return answer(422, "refused", str(error))
        case DiskFull():
            return answer(507, DISK_FULL, str(error))
        case NotErased() | WriteFailed():
            return answer(503, "storage", str(error))
        case DeviceError():
            return answer(503, "device", str(error))
        case _:
            return answer(500, "failed", str(error))
