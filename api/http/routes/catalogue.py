"""Subjects, models, diagnoses and what else the catalogue lists; a subject's data leave whole, or are erased."""

import contextlib
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Depends, Request, Response
from fastapi.responses import FileResponse
from pydantic import Field
from starlette.background import BackgroundTask

from api.catalogue.catalogue import Catalogue, NoSuchSubject
from api.catalogue.database import CatalogueDamaged, CatalogueUnavailable
from api.catalogue.pages import Page
from api.catalogue.queries import Asked
from api.catalogue.subjects import erase_subject, export_subject
from api.http.access.rights import ADMIN, CALLER, OPERATE, READ
from api.http.access.scopes import Scope
from api.http.jobs.kept import EXPORTS
from api.http.models import RequestBody
from api.http.problems import RequestRefused, responses
from api.http.room import refuse_full, size_of
from api.http.routes.common import MatchHeader, PageQuery, Word, etag_of, refuse_stale
from api.http.service import Service
from rig.recording.files import make_folder
from rig.results.base import SavedResult
from rig.results.catalogue import (
    CatalogueResult,
    CauseList,
    DiagnosisList,
    ErasureResult,
    ModelList,
    SessionList,
    SiteList,
    SubjectEntry,
    SubjectHistory,
    SubjectList,
    TrialList,
    WorkList,
)

Find = Callable[[Asked, Page], SavedResult]


class NameRequest(RequestBody):
    """Who a code stands for."""

    name: str = Field(max_length=200, description="empty: the name is forgotten")


async def asked_in(
    subject: Word = "",
    site: Word = "",
    session: Word = "",
    kind: Word = "",
    quality: Word = "",
    law: Word = "",
    verdict: Word = "",
    cause: Word = "",
    since: Word = "",
    until: Word = "",
) -> Asked:
    """What is asked for; a list takes no notice of what its lines do not have."""
    return Asked(subject, site, session, kind, quality, law, verdict, cause, since=since, until=until)


AskedQuery = Annotated[Asked, Depends(asked_in)]


@contextlib.contextmanager
def answering() -> Iterator[None]:
    """What the catalogue refuses, as problems."""
    try:
        yield
    except NoSuchSubject as error:
        raise RequestRefused(404, "no-such-subject", str(error)) from error
    except (CatalogueDamaged, CatalogueUnavailable) as error:
        raise RequestRefused(503, "catalogue", str(error)) from error


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""
    lists = Catalogue(service.sessions)
    _lists(router, lists)
    _export(router, service, lists)  # before them: a code may have any character, so what follows it is sought first
    _one_subject(router, lists)
    _changes(router, service, lists)


def _lists(router: APIRouter, lists: Catalogue) -> None:
    told = responses("503 catalogue")

    @router.get(
        "/subjects", summary="Subjects by code; names only for whoever may operate", dependencies=[READ], responses=told
    )
    def subjects(request: Request, asked: AskedQuery, page: PageQuery) -> SubjectList:
        with answering():
            return lists.subjects(asked, page, sees_names(request))

    known: Mapping[str, tuple[str, type[SavedResult], Find]] = {
        "sessions": ("Sessions by query, newest first", SessionList, lists.sessions),
        "sites": ("Sites of subjects, with their sessions", SiteList, lists.sites),
        "trials": ("Trials with their quality, newest first", TrialList, lists.trials),
        "models": ("Fitted models, newest first", ModelList, lists.models),
        "diagnoses": ("Diagnoses, newest first", DiagnosisList, lists.diagnoses),
        "causes": ("Causes that diagnoses named, newest first", CauseList, lists.causes),
        "operations": ("Operations that left a result in a session, newest first", WorkList, lists.operations),
    }
    for name, (summary, result, find) in known.items():
        listed_at = router.get(
            f"/{name}", name=name, summary=summary, response_model=result, dependencies=[READ], responses=told
        )
        listed_at(_lister(find))


def _lister(find: Find) -> Find:
    def page_of(asked: AskedQuery, page: PageQuery) -> SavedResult:
        with answering():
            return find(asked, page)

    return page_of


def sees_names(request: Request) -> bool:
    """Whether the caller may see names of people."""
    caller = request.scope.get(CALLER)
    return caller is not None and caller.may(Scope.OPERATE)


def entry_of(lists: Catalogue, subject: str) -> SubjectEntry | None:
    """What is known of a code, with its name; None where nothing is."""
    try:
        return lists.history(subject).subject
    except NoSuchSubject:
        return None


def _export(router: APIRouter, service: Service, lists: Catalogue) -> None:
    exports = service.jobs.folder / EXPORTS

    @router.get(
        "/subjects/{subject:path}/export",
        dependencies=[OPERATE],
        summary="Recordings, results and name of a subject in one zip",
        response_class=FileResponse,
        responses={
            200: {"content": {"application/zip": {}}},
            **responses("404 no-such-subject", "422 refused", "503 catalogue", "507 disk-full"),
        },
    )
    def export(subject: str) -> FileResponse:
        make_folder(exports)
        with answering():
            found = lists.history(subject).sessions
        refuse_full(exports, sum(size_of(lists.root / each.session) for each in found))
        # Not where the system keeps such things, which may be in memory, and out of reach of an erasure.
        scratch = tempfile.TemporaryDirectory(prefix=".", dir=exports)
        archive = Path(scratch.name) / "subject.zip"
        try:
            with answering():
                export_subject(lists, subject, archive)
            archive.stat()  # an erasure meanwhile has taken it
        except BaseException:
            scratch.cleanup()
            raise
        sent = BackgroundTask(scratch.cleanup)
        return FileResponse(archive, media_type="application/zip", filename="subject.zip", background=sent)


def _one_subject(router: APIRouter, lists: Catalogue) -> None:
    one_changes = threading.Lock()

    @router.put(
        "/subjects/{subject:path}/name",
        dependencies=[OPERATE],
        summary="Keeps a person's name for a code; where something is known of it, If-Match has to name its ETag",
        responses=responses("404 no-such-subject", "412 stale", "422 refused", "428 if-match", "503 catalogue"),
    )
    def rename(subject: str, request: NameRequest, match: MatchHeader = "") -> SubjectList:
        with answering(), one_changes:
            known = entry_of(lists, subject)
            if known:
                refuse_stale(match, etag_of(known), f"/subjects/{quote(subject, safe='')}")
            lists.rename(subject, request.name)
            return lists.subjects()

    @router.get(
        "/subjects/{subject:path}",
        dependencies=[READ],
        summary="A subject's sessions, models and diagnoses; name only for whoever may operate, ETag for its change",
        responses=responses("404 no-such-subject", "422 refused", "503 catalogue"),
    )
    def history(subject: str, request: Request, response: Response) -> SubjectHistory:
        with answering():
            found = lists.history(subject, sees_names(request))
        response.headers["ETag"] = etag_of(found.subject)
        return found


def _changes(router: APIRouter, service: Service, lists: Catalogue) -> None:
    @router.delete(
        "/subjects/{subject:path}",
        dependencies=[ADMIN],
        summary="First says what would be erased, with 202; with what that says as `confirm` it is erased",
        responses={
            202: {"model": ErasureResult},
            **responses("404 no-such-subject", "409 busy", "422 refused", "503 catalogue"),
        },
    )
    def erase(subject: str, response: Response, confirm: Word = "") -> ErasureResult:
        if service.jobs.active:
            raise RequestRefused(
                409, "busy", "a job is under way, which may use a session; erase when it has ended, or cancel it"
            )
        with answering():
            found = erase_subject(lists, subject, confirm, also=service.jobs.erase)
        response.status_code = 200 if found.done else 202
        return found

    @router.post(
        "/catalogue/rebuild",
        dependencies=[ADMIN],
        summary="Makes the catalogue anew from the folders; names stay",
        responses=responses("422 refused", "503 catalogue"),
    )
    def rebuild() -> CatalogueResult:
        with answering():
            return lists.rebuild()
