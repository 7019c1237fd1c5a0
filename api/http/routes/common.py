"""What several concerns' routes are made with."""

from typing import Annotated

from fastapi import Depends, Header, Query
from starlette.requests import HTTPConnection

from api.catalogue.pages import Page
from api.catalogue.settings import MOST, USUAL
from api.http.access.rights import CALLER
from api.http.access.scopes import Caller

PREFIX = "/api/v1"

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
