"""Files that are sent to be imported."""

from fastapi import APIRouter, Request

from api.http.access.rights import OPERATE, READ, upload
from api.http.access.scopes import Scope
from api.http.problems import RequestRefused, responses
from api.http.service import Service
from api.http.uploads import LARGEST_UPLOAD_BYTES, UploadShelf, UploadView

FILES = {"type": "array", "items": {"type": "string", "format": "binary"}}
BODY = {"type": "object", "properties": {"file": FILES}, "required": ["file"]}


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""
    shelf = UploadShelf(service.jobs.uploads)

    @router.post(
        "/uploads",
        dependencies=[upload(Scope.OPERATE, LARGEST_UPLOAD_BYTES)],
        status_code=201,
        summary="Takes files to be imported, any number of parts named file; names may have folders",
        responses=responses("400 multipart", "415 multipart", "422 no-files", "422 refused", "507 disk-full"),
        openapi_extra={"requestBody": {"required": True, "content": {"multipart/form-data": {"schema": BODY}}}},
    )
    async def receive(request: Request) -> UploadView:
        stated = int(request.headers.get("content-length", "0"))
        return await shelf.receive(request.headers.get("content-type", ""), stated, request.stream())

    @router.get("/uploads", dependencies=[READ], summary="Files that were sent, newest first")
    def listed() -> list[UploadView]:
        return shelf.listed()

    @router.get(
        "/uploads/{identifier}", dependencies=[READ], summary="One upload", responses=responses("404 no-such-upload")
    )
    def one(identifier: str) -> UploadView:
        return shelf.view(identifier)

    @router.delete(
        "/uploads/{identifier}",
        dependencies=[OPERATE],
        summary="Removes an upload",
        responses=responses("404 no-such-upload", "409 busy"),
    )
    def remove(identifier: str) -> UploadView:
        if any(job.asked.params.get("upload") == identifier for job in service.jobs.active):
            raise RequestRefused(409, "busy", "a job works on it; cancel that first")
        return shelf.remove(identifier)
