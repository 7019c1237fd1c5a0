"""The catalogue of one folder of sessions: every question brings the tables to what the folders hold first."""

import contextlib
import os
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, func, select

from api.catalogue import people
from api.catalogue.database import CatalogueDamaged, Database, address
from api.catalogue.erasing import finish
from api.catalogue.folder import short, utc
from api.catalogue.pages import FIRST, Page, cut
from api.catalogue.people import NamedPerson
from api.catalogue.queries import EVERYTHING, Asked, every, listed, sites
from api.catalogue.refresh import FolderScan, current, refill, scan
from api.catalogue.schema import TABLES, Kind
from api.catalogue.settings import ENVIRONMENT
from api.catalogue.stiffness import compared
from rig.errors import UsageError
from rig.results.catalogue import (
    CatalogueResult,
    CauseEntry,
    CauseList,
    DiagnosisEntry,
    DiagnosisList,
    ModelEntry,
    ModelList,
    NamesResult,
    SessionEntry,
    SessionList,
    SiteList,
    SubjectEntry,
    SubjectHistory,
    SubjectList,
    ThresholdEntry,
    TrialEntry,
    TrialList,
    WorkEntry,
    WorkList,
    storable,
)

# Clocks that a person set differ by a minute; one that is further ahead was wrong.
LARGEST_AHEAD_S = 60.0
MOST_PAGES = 50  # of 100 entries each: a few megabytes
Current = tuple[Connection, tuple[str, ...]]
Found = tuple[tuple[Kind, ...], str | None, tuple[str, ...]]


class NoSuchSubject(UsageError):
    """Nothing is known of a code; the message says where the codes are."""


def default_file(root: Path) -> Path:
    """Beside the folder, not in it: whoever passes sessions on passes no names on."""
    return root.absolute().with_name(f"{root.absolute().name}.catalogue.sqlite")


class Catalogue:
    """What the folder ``root`` of sessions holds. Safe from any thread and any number of processes.

    ``given`` is a file or a URL of PostgreSQL; empty: RIG_CATALOGUE, else a file beside the folder. Every method raises
    CatalogueUnavailable, CatalogueDamaged or UsageError with the next step.
    """

    def __init__(self, root: Path, given: str = "", now_s: Callable[[], float] = time.time) -> None:
        self.root, self._now_s = root, now_s
        given = given or os.environ.get(ENVIRONMENT, "")
        self.database = Database(address(given, default_file(root)), root, moves=not given)
        self._prepared = False
        self._known: tuple[object, dict[tuple[type[Any], Asked, Page], Any]] = None, {}

    def _fresh(self, now: FolderScan | None = None) -> contextlib.AbstractContextManager[Current]:
        """One state of all tables, as the folders are ``now``; and sentences on what is not listed."""
        self._prepare()
        return current(self.database, now or scan(self.root))

    def _prepare(self) -> None:
        file = self.database.file
        if not self._prepared or (file is not None and not file.exists()):
            self.database.prepare()
            self._prepared = True

    def _page(self, kind: type[Kind], asked: Asked, page: Page) -> Found[Kind]:
        """One page; while neither folders nor tables change, as it was found: a page of the browser asks on and on."""
        looks = self.database.looks, scan(self.root)
        known = self._known
        if known[0] != looks or looks[0] is None or len(known[1]) > MOST_PAGES:
            known = self._known = looks, {}
        found: Found[Kind] | None = known[1].get((kind, asked, page))
        if found is None:
            with self._fresh(looks[1]) as (connection, remarks):
                found = known[1][kind, asked, page] = *listed(connection, kind, asked, page), remarks
        return found

    def sessions(self, asked: Asked = EVERYTHING, page: Page = FIRST) -> SessionList:
        """Sessions by subject, site, kind, quality, dates and causes found."""
        items, following, remarks = self._page(SessionEntry, asked, page)
        return SessionList(items=tuple(map(self._dated, items)), next=following, remarks=remarks)

    def _dated(self, session: SessionEntry) -> SessionEntry:
        """The entry, with a remark where its date has not come yet."""
        if session.at <= utc(self._now_s() + LARGEST_AHEAD_S):
            return session
        ahead = f"its date, {session.at}, has not come yet: this computer's clock or the one that wrote it was wrong"
        return session.model_copy(update={"remarks": (*session.remarks, ahead)})

    def trials(self, asked: Asked = EVERYTHING, page: Page = FIRST) -> TrialList:
        """Trials, also by quality."""
        items, following, _ = self._page(TrialEntry, asked, page)
        return TrialList(items=items, next=following)

    def models(self, asked: Asked = EVERYTHING, page: Page = FIRST) -> ModelList:
        """Models, also by law."""
        items, following, _ = self._page(ModelEntry, asked, page)
        return ModelList(items=items, next=following)

    def diagnoses(self, asked: Asked = EVERYTHING, page: Page = FIRST) -> DiagnosisList:
        """Diagnoses, also by verdict and by a cause they named."""
        items, following, _ = self._page(DiagnosisEntry, asked, page)
        return DiagnosisList(items=items, next=following)

    def causes(self, asked: Asked = EVERYTHING, page: Page = FIRST) -> CauseList:
        """Causes that were named, also by name."""
        items, following, _ = self._page(CauseEntry, asked, page)
        return CauseList(items=items, next=following)

    def operations(self, asked: Asked = EVERYTHING, page: Page = FIRST) -> WorkList:
        """Operations that left a result, by kind and session."""
        items, following, _ = self._page(WorkEntry, asked, page)
        return WorkList(items=items, next=following)

    def subjects(self, asked: Asked = EVERYTHING, page: Page | None = None, named: bool = True) -> SubjectList:
        """Subjects that have such a session, or a name where nothing is asked of one; by code, without ``page`` all.

        Without ``named`` no names.
        """
        of_sessions = replace(asked, subject="")
        with self._fresh() as (connection, _):
            found = _subjects(connection, people.names(connection) if named else {})
            having = {one.subject for one in sites(connection, of_sessions)} if of_sessions != EVERYTHING else None
        shown = [
            each for each in found if asked.subject in ("", each.subject) and (having is None or each.subject in having)
        ]
        items, following = cut(page, "subjects", shown, lambda each: (each.subject, ""))
        return SubjectList(items=items, next=following)

    def sites(self, asked: Asked = EVERYTHING, page: Page | None = None) -> SiteList:
        """Sites by subject, each with its number of sessions; without ``page`` all."""
        with self._fresh() as (connection, _):
            found = sites(connection, asked)
        items, following = cut(page, "sites", found, lambda each: (each.subject, each.site))
        return SiteList(items=items, next=following)

    def history(self, subject: str, named: bool = True) -> SubjectHistory:
        """All that is known of one subject; raises UsageError where nothing is."""
        with self._fresh() as (connection, _):
            return self.history_in(connection, subject, named)

    def history_in(self, connection: Connection, subject: str, named: bool) -> SubjectHistory:
        """The same from tables as they are."""
        asked = Asked(subject=code_of(subject))
        found = [each for each in _subjects(connection, people.names(connection)) if each.subject == asked.subject]
        if not found:
            raise NoSuchSubject(
                f"subject {subject!r}: has no session in {self.root} and no name; `rig subject list` says who has"
            )
        shown = found[0] if named else found[0].model_copy(update={"name": None})
        sessions = tuple(map(self._dated, every(connection, SessionEntry, asked)))
        models = every(connection, ModelEntry, asked)
        return SubjectHistory(
            subject=shown,
            sessions=sessions,
            thresholds=every(connection, ThresholdEntry, asked),
            models=models,
            diagnoses=every(connection, DiagnosisEntry, asked),
            operations=every(connection, WorkEntry, asked),
            stiffness=compared(sessions, models),
        )

    def site_thresholds_N(self, subject: str, highest_N: float) -> dict[str, float]:
        """What was found last at each site of the subject, to a tenth and never above it; empty where nothing is."""
        with self._fresh() as (connection, _):
            found = every(connection, ThresholdEntry, Asked(subject=subject))
        newest_last = [(one.site, int(10 * (one.force_N or 0.0)) / 10) for one in found[::-1]]
        return {site: min(force_N, highest_N) for site, force_N in newest_last if site and force_N > 0}

    def refreshed(self) -> tuple[str, ...]:
        """Brings the tables to what the folders hold now; sentences on what is not listed."""
        with self._fresh() as (_, remarks):
            return remarks

    def unreadable(self) -> tuple[SessionEntry, ...]:
        """Sessions of which nothing could be read, so that nobody knows whose they are."""
        with self._fresh() as (connection, _):
            return every(connection, SessionEntry, Asked(kind="unknown"))

    def rename(self, subject: str, name: str) -> None:
        """Keeps a person's name for a code; an empty one is forgotten. Raises UsageError for a code that is none."""
        code = code_of(subject)
        self._prepare()
        with self.database.writing() as connection:
            if name.strip():
                people.keep(connection, [NamedPerson(subject=code, name=name.strip(), entered=people.now())])
            elif not people.forget_name(connection, code):
                raise NoSuchSubject(f"subject {subject!r}: no name is kept for it; `rig subject list` says for whom")

    def rebuild(self) -> CatalogueResult:
        """Makes all tables anew from the folders; names stay, as far as they can be read."""
        saved, remarks = self._saved_names()
        if self.database.file is not None and not self.database.file.exists():
            self.database.prepare()
        with self.database.writing() as connection:
            self.database.refuse_other(connection)
            finish(self.root)
            remarks += refill(self.database, connection)
            people.keep(connection, saved)
            sessions = connection.scalar(select(func.count()).select_from(TABLES[SessionEntry]))
            subjects, named = _subjects(connection, {}), people.names(connection)
        self._prepared = True
        return CatalogueResult(
            catalogue=self.database.place,
            sessions=sessions or 0,
            subjects=len([each for each in subjects if each.sessions]),
            names=len(named),
            remarks=remarks,
        )

    def _saved_names(self) -> tuple[list[NamedPerson], tuple[str, ...]]:
        """Where the file is damaged: it is put aside, with what it still says of names."""
        try:
            self.database.check()
        except CatalogueDamaged as damage:
            file = self.database.file
            if file is None:
                return [], ()
            saved, why = people.salvage(file)
            aside = file.with_name(f"{file.name}.damaged-{datetime.now(UTC):%Y%m%dT%H%M%SZ}")
            file.replace(aside)
            lost = f"after that: {why}; the others come back by `rig catalogue restore`" if why else "all there were"
            return saved, (
                str(damage).partition("; ")[0],
                f"it was kept as {aside}",
                f"{len(saved)} names saved, {lost}",
            )
        return [], ()

    def backup(self, file: Path) -> NamesResult:
        """Writes all names to a new file, which only its owner may read."""
        self._prepare()
        with self.database.reading() as connection:
            found = tuple(people.names(connection).values())
        people.write_backup(found, file)
        return NamesResult(file=str(file), names=len(found))

    def restore(self, file: Path) -> NamesResult:
        """Brings names back; those entered here since the backup, or never in it, stay."""
        saved = people.read_backup(file)
        self._prepare()
        with self.database.writing() as connection:
            there = people.names(connection)
            older = [each for each in saved if each.subject not in there or there[each.subject].entered < each.entered]
            people.keep(connection, older)
        return NamesResult(file=str(file), names=len(older))


def code_of(subject: str) -> str:
    """A subject's code as sessions are listed by; raises UsageError where it is empty."""
    code = short(storable(subject).strip())
    if not code:
        raise UsageError("subject: its code is empty; give the code that its sessions carry")
    return code


def _subjects(connection: Connection, named: dict[str, NamedPerson]) -> list[SubjectEntry]:
    """Everybody with a session or a name, by code."""
    table = TABLES[SessionEntry]
    columns = (table.c.subject, table.c.site, table.c.at)
    found: dict[str, SubjectEntry] = {code: SubjectEntry(subject=code, name=each.name) for code, each in named.items()}
    for row in connection.execute(select(*columns).where(table.c.subject != "").order_by(*columns)):
        before = found.get(row.subject) or SubjectEntry(subject=row.subject)
        found[row.subject] = _with_session(before, row.site, row.at)
    return [found[code] for code in sorted(found)]


def _with_session(subject: SubjectEntry, site: str, at: str) -> SubjectEntry:
    return subject.model_copy(
        update={
            "sites": tuple(sorted({*subject.sites, site} - {""})),
            "sessions": subject.sessions + 1,
            "first": min(subject.first or at, at),
            "last": max(subject.last, at),
        }
    )
