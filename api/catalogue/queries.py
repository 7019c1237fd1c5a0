"""Questions to the tables: equal columns, newest first, page by page."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import TypeVar

from sqlalchemy import ColumnElement, Connection, Table, and_, func, or_, select

from api.catalogue.folder import utc_of
from api.catalogue.pages import FIRST, Page, Place
from api.catalogue.schema import TABLES, entry
from rig.errors import UsageError
from rig.results.catalogue import CatalogueEntry, CauseEntry, SessionEntry, SiteEntry, storable

DAY = re.compile(r"\d{4}-\d\d-\d\d")
Kind = TypeVar("Kind", bound=CatalogueEntry)


@dataclass(frozen=True)
class Asked:
    """What entries must be; empty asks for nothing. ``since`` and ``until`` are ISO dates or times, UTC."""

    subject: str = ""
    site: str = ""
    session: str = ""
    kind: str = ""
    quality: str = ""
    law: str = ""
    verdict: str = ""
    cause: str = ""
    name: str = ""
    since: str = ""
    until: str = ""


EVERYTHING = Asked()


def listed(
    connection: Connection, kind: type[Kind], asked: Asked = EVERYTHING, page: Page = FIRST
) -> tuple[tuple[Kind, ...], str | None]:
    """Entries of one kind, newest first, and the cursor of what follows; raises UsageError for a wrong page."""
    table = TABLES[kind]
    wanted = select(table).where(*_conditions(table, asked), *_after(table, page.after(_name(table))))
    rows = connection.execute(wanted.order_by(table.c.at.desc(), table.c.key).limit(page.limit + 1)).mappings()
    return page.first(_name(table), [entry(kind, row) for row in rows], lambda one: (one.at, one.key))


def every(connection: Connection, kind: type[Kind], asked: Asked) -> tuple[Kind, ...]:
    """All entries of one kind, newest first."""
    table = TABLES[kind]
    found = connection.execute(
        select(table).where(*_conditions(table, asked)).order_by(table.c.at.desc(), table.c.key)
    ).mappings()
    return tuple(entry(kind, row) for row in found)


def sites(connection: Connection, asked: Asked = EVERYTHING) -> tuple[SiteEntry, ...]:
    """Every site of every subject, with its sessions."""
    table = TABLES[SessionEntry]
    whose = (table.c.subject, table.c.site)
    counted = (func.count().label("sessions"), func.min(table.c.at).label("first"), func.max(table.c.at).label("last"))
    wanted = select(*whose, *counted).where(*_conditions(table, asked)).group_by(*whose).order_by(*whose)
    return tuple(SiteEntry.model_validate(dict(row)) for row in connection.execute(wanted).mappings())


def _conditions(table: Table, asked: Asked) -> list[ColumnElement[bool]]:
    given: Mapping[str, str] = {each.name: storable(getattr(asked, each.name)) for each in fields(asked)}
    equal = [table.c[name] == value for name, value in given.items() if value and name in table.c]
    return [*equal, *_of_cause(table, given["cause"]), *_between(table, asked)]


def _of_cause(table: Table, cause: str) -> list[ColumnElement[bool]]:
    named = TABLES[CauseEntry]
    return [table.c.session.in_(select(named.c.session).where(named.c.name == cause))] if cause else []


def _between(table: Table, asked: Asked) -> list[ColumnElement[bool]]:
    since = [table.c.at >= _moment(asked.since, "since")] if asked.since else []
    # A day ends after all of its times, which begin with it and go on with a letter below this one.
    until = [table.c.at <= _moment(asked.until, "until") + "~"] if asked.until else []
    return [*since, *until]


def _moment(given: str, name: str) -> str:
    """A day as it is, a time in the form of all entries: both sort as text."""
    found = utc_of(given)
    if not found:
        raise UsageError(f"{name} {given[:40]!r}: is no date; write 2026-11-23, or 2026-11-23T10:00+01:00")
    return given if DAY.fullmatch(given) else found


def _name(table: Table) -> str:
    """As whoever asks knows the list."""
    return table.name.removeprefix("rig_")


def _after(table: Table, last: Place | None) -> list[ColumnElement[bool]]:
    if last is None:
        return []
    at, key = last
    return [or_(table.c.at < at, and_(table.c.at == at, table.c.key > key))]
