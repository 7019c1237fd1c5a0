"""The recordings of the sessions, to be looked through and downloaded."""

from fastapi import APIRouter, Response

from api.catalogue.catalogue import Catalogue
from api.http import views
from api.http.access.rights import READ
from api.http.downloads import FileAsOfNow, files_at
from api.http.jobs.places import regular_file
from api.http.jobs.views import media_type
from api.http.models import RecordingList
from api.http.problems import RequestRefused, responses
from api.http.routes.catalogue import AskedQuery, answering
from api.http.routes.common import PageQuery
from api.http.service import Service

# A report is a page that carries its own style and pictures. Whatever else lies there as one, it runs no script, and is
# of no origin: neither what the page keeps nor the interface is open to it.
SANDBOX = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'"


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""

    lists = Catalogue(service.sessions)

    @router.get(
        "/recordings",
        dependencies=[READ],
        response_model=RecordingList,
        summary="Sessions by query with their recordings, newest first",
        responses=responses("503 catalogue"),
    )
    def recordings(asked: AskedQuery, page: PageQuery) -> Response:
        with answering():
            found = views.recordings(service.sessions, lists.sessions(asked, page))
        return Response(found.model_dump_json(), media_type="application/json")

    @files_at(
        router,
        "/recordings/{session}/{file:path}",
        READ,
        responses("404 no-such-session", "404 no-such-recording"),
        "One file of a session, also of its results; HEAD and ranges are served, and a report is shown by a browser",
    )
    def download(session: str, file: str) -> FileAsOfNow:
        found = regular_file(service.session(session), file)
        if found is None:
            raise RequestRefused(404, "no-such-recording", f"session {session} has no file {file[:200]}")
        name, kind = f"{session}-{file.replace('/', '-')}", media_type(found.name)
        if kind != "text/html":
            return FileAsOfNow(found, media_type=kind, filename=name)
        apart = {"Content-Security-Policy": SANDBOX}
        return FileAsOfNow(found, headers=apart, media_type=kind, filename=name, content_disposition_type="inline")
