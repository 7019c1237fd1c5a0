"""What several concerns' routes are made with."""

import hashlib
from typing import Annotated

from fastapi import Depends, Header, Query
from pydantic import BaseModel
from starlette.convertors import PathConvertor, register_url_convertor
from starlette.requests import HTTPConnection

from api.catalogue.pages import Page
from api.catalogue.settings import MOST, USUAL
from api.http.access.rights import CALLER
from api.http.access.scopes import Caller
from api.http.problems import RequestRefused

PREFIX = "/api/v1"


class AnyPath(PathConvertor):
    """The rest of an address, also with an end of a line in it: a subject's code or a file's name may have one."""

    regex = "(?s:.*)"


register_url_convertor("path", AnyPath())

MatchHeader = Annotated[str, Header(alias="If-Match", max_length=80, description="the ETag of what is to be changed")]
LeaseHeader = Annotated[str, Header(alias="X-Control-Lease", description="lease_id of the lease in force")]

# Codes and words that are asked for; PostgreSQL and SQLite are asked with no longer ones.
LONGEST = 500
Word = Annotated[str, Query(max_length=LONGEST)]


# What only looks at the request is asked in the event loop: handing it to a thread costs more than the answer.
async def _caller(connection: HTTPConnection) -> Caller:
    caller = connection.scope[CALLER]
    assert isinstance(caller, Caller)
    return caller


# For every route that asks for a right, so that it can say who did what.
WhoAsks = Annotated[Caller, Depends(_caller)]


async def _page(
    limit: Annotated[int, Query(ge=1, le=MOST)] = USUAL, cursor: Annotated[str, Query(max_length=4 * LONGEST)] = ""
) -> Page:
    return Page(limit, cursor)


# Which page of a list: the `next` of the one before is its cursor.
PageQuery = Annotated[Page, Depends(_page)]


def etag_of(settings: BaseModel) -> str:
    """Another content, another tag."""
    return f'"{hashlib.sha256(settings.model_dump_json().encode()).hexdigest()[:16]}"'


def refuse_stale(match: str, now: str, address: str) -> None:
    """Raises RequestRefused where a change does not name the tag of what is there ``now``, by GET ``address``."""
    if not match:
        text = f"send If-Match with the ETag of GET {PREFIX}{address}, so that no change of somebody else is lost"
        raise RequestRefused(428, "if-match", text)
    if match not in (now, "*"):
        text = f"this was changed meanwhile: look at it (GET {PREFIX}{address}), then change it"
        raise RequestRefused(412, "stale", text)
