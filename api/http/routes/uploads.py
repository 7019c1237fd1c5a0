"""Files that are sent to be imported."""

from functools import partial

from fastapi import APIRouter, Request, Response

from api.http.access.rights import OPERATE, READ, upload
from api.http.access.scopes import Scope
from api.http.answers import ANSWERS, forget
from api.http.erasing import Confirm, UploadErasure, to_confirm
from api.http.listing import Listing, listing
from api.http.problems import RequestRefused, responses
from api.http.routes.common import PageQuery, Word
from api.http.service import Service
from api.http.uploads import LARGEST_UPLOAD_BYTES, UploadShelf, UploadView

FILES = {"type": "array", "items": {"type": "string", "format": "binary"}}
BODY = {"type": "object", "properties": {"file": FILES}, "required": ["file"]}


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""
    shelf = UploadShelf(service.jobs.uploads, partial(_in_use, service))
    _collection(router, shelf)
    _member(router, shelf, service)


def _in_use(service: Service, identifier: str) -> bool:
    return any(job.asked.params.get("upload") == identifier for job in service.jobs.active)


def _collection(router: APIRouter, shelf: UploadShelf) -> None:
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
    def listed(page: PageQuery, file: Word = "") -> Listing[UploadView]:
        found = (one for one in shelf.listed() if not file or file in {each.name for each in one.files})
        return listing("uploads", found, page, lambda one: (one.at, one.id), newest_first=True)


def _member(router: APIRouter, shelf: UploadShelf, service: Service) -> None:
    @router.get(
        "/uploads/{identifier}", dependencies=[READ], summary="One upload", responses=responses("404 no-such-upload")
    )
    def one(identifier: str) -> UploadView:
        return shelf.view(identifier)

    @router.delete(
        "/uploads/{identifier}",
        dependencies=[OPERATE],
        summary="First says what would be removed, with 202; with what that says as `confirm` it is removed",
        responses={202: {"model": UploadErasure}, **responses("404 no-such-upload", "409 busy", "409 stale")},
    )
    def remove(identifier: str, response: Response, confirm: Confirm = "") -> UploadErasure:
        if _in_use(service, identifier):
            raise RequestRefused(409, "busy", "a job works on it; cancel that first")
        found = shelf.view(identifier)
        token = to_confirm(f"upload {identifier}", service.jobs.uploads / identifier, confirm, response)
        if not token:
            shelf.remove(identifier)
            forget(service.jobs.folder / ANSWERS, [identifier])
        return UploadErasure(**vars(found), done=not token, confirm=token)
