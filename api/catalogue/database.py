"""One database, SQLite in a file or PostgreSQL by URL; whatever it refuses is said in one sentence.

Whoever reads sees one state; whoever writes is alone, and the others wait for it.
"""

import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection, Engine, NullPool, create_engine, event, inspect, select
from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError, DBAPIError, SQLAlchemyError

from api.catalogue.schema import CATALOGUE, DERIVED, OWN, VERSION
from rig.errors import RigError, UsageError

# A rebuild of a thousand sessions holds the others off for seconds; a minute is a writer that hangs.
WAIT_S = 60.0
REBUILD = "`rig catalogue rebuild` makes it anew from the folders of the sessions"
# Of all programs that use this catalogue, those that write take this lock of PostgreSQL; any number of its own.
WRITERS = 7_215_940_221
POSTGRESQL = "postgresql+psycopg"
# What is erased is overwritten in the file.
ON_CONNECT = "PRAGMA secure_delete = ON"


class CatalogueUnavailable(RigError):
    """The catalogue cannot be asked: its server, its folder or its file does not answer."""


class CatalogueDamaged(RigError):
    """The catalogue's file or tables are not as they were written; the sessions are, and it can be made anew."""


class Database:
    """The database at ``url``, which `address` made; ``root`` is the folder of sessions it tells of.

    Raises UsageError where it is of a newer program or of another folder, and as above.
    """

    def __init__(self, url: URL, root: Path, moves: bool = False) -> None:
        """``moves``: the folder may be moved together with its database, which is then still its own."""
        self.url, self.root, self._moves = url, root, moves
        self.engine = _engine(url)

    @property
    def file(self) -> Path | None:
        """The file of SQLite."""
        return Path(self.url.database) if self.is_sqlite and self.url.database else None

    @property
    def is_sqlite(self) -> bool:
        """Whether it is one file."""
        return self.url.get_backend_name() == "sqlite"

    @property
    def looks(self) -> tuple[int, int, int] | None:
        """What changes whenever its file is written to or replaced; None of a server, or where there is no file."""
        try:
            now = self.file.stat() if self.file else None
        except FileNotFoundError:
            now = None
        return (now.st_ino, now.st_size, now.st_mtime_ns) if now else None

    @property
    def place(self) -> str:
        """What to call it by; without a password."""
        return str(self.file or self.url.render_as_string(hide_password=True))

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """One state of all tables."""
        with self._said(), self.engine.connect() as connection, connection.begin():
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """The only writer until the block ends; what it wrote is kept whole, or not at all where it raises."""
        # PostgreSQL: what the writer before has done is seen, whenever this one began to wait.
        options = {"alone": True} if self.is_sqlite else {"alone": True, "isolation_level": "READ COMMITTED"}
        with self._said(), self.engine.connect().execution_options(**options) as connection, connection.begin():
            yield connection

    def prepare(self) -> None:
        """Makes the tables where there are none, and those of an older program anew, but for the names in them.

        Raises as above where they are not of this program and folder.
        """
        if self.file is not None and not self.file.exists():
            _make_private(self.file)
        self.check()
        with self.reading() as connection:
            version = self._own_version(connection) if self._has_ours(connection) else 0
        if version < VERSION:
            with self.writing() as connection:
                DERIVED.drop_all(connection)
                self.create(connection)

    def compact(self) -> None:
        """Takes what was erased out of the tables' own files; SQLite has overwritten it already."""
        if self.is_sqlite:
            return
        with self._said(), self.engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
            for table in (*OWN.tables, *DERIVED.tables):
                connection.exec_driver_sql(f"VACUUM FULL {table}")

    def create(self, connection: Connection) -> None:
        """The tables that are missing, and whose they are."""
        OWN.create_all(connection)
        DERIVED.create_all(connection)
        connection.execute(CATALOGUE.delete())
        connection.execute(CATALOGUE.insert().values(version=VERSION, root=str(self.root.resolve())))

    def check(self) -> None:
        """Raises CatalogueDamaged where pages of the file contradict each other, asked for or not."""
        if self.is_sqlite:
            with self.reading() as connection:
                found = connection.exec_driver_sql("PRAGMA quick_check(1)").scalar()
            if found != "ok":
                raise CatalogueDamaged(f"{self.place}: is damaged: {found}; {REBUILD}")

    def refuse_other(self, connection: Connection) -> None:
        """Raises UsageError where tables are not ours to be made anew: of something else, or of a newer program."""
        names = inspect(connection).get_table_names()
        if self._has_ours(connection) and CATALOGUE.name in names:
            self._refuse_newer(connection.scalar(select(CATALOGUE.c.version)) or VERSION)

    def _has_ours(self, connection: Connection) -> bool:
        """Whether any of our tables is there; raises UsageError where a file holds others instead."""
        names = set(inspect(connection).get_table_names())
        ours = names & (OWN.tables.keys() | DERIVED.tables.keys())
        if names and not ours and self.is_sqlite:
            raise UsageError(f"{self.place}: is a database, but no catalogue; give another file with --catalogue")
        return bool(ours)

    def _own_version(self, connection: Connection) -> int:
        """Raises UsageError where the catalogue is of a newer program or of another folder."""
        row = connection.execute(select(CATALOGUE)).first()
        if row is None:
            raise CatalogueDamaged(f"{self.place}: does not say of which folder it is; {REBUILD}")
        self._refuse_newer(row.version)
        if row.root != str(self.root.resolve()) and not self._moves:
            raise UsageError(
                f"{self.place}: is the catalogue of {row.root}, not of {self.root.resolve()}; give another with"
                " --catalogue, or `rig catalogue rebuild`, which makes it that of this folder"
            )
        return int(row.version)

    def _refuse_newer(self, version: int) -> None:
        if version > VERSION:
            raise UsageError(
                f"{self.place}: is a catalogue of version {version}, and this program knows up to {VERSION};"
                " update tissue-rig, or give another with --catalogue"
            )

    @contextmanager
    def _said(self) -> Iterator[None]:
        """What the database refuses, as a sentence."""
        try:
            yield
        except DBAPIError as error:
            raise self._sentence(error) from error
        except SQLAlchemyError as error:
            raise CatalogueDamaged(f"{self.place}: {_first_line(error)}; {REBUILD}") from error

    def _sentence(self, error: DBAPIError) -> RigError:
        why = _first_line(error.orig or error)
        if "locked" in why or "lock timeout" in why:
            return CatalogueUnavailable(
                f"{self.place}: another program has been writing to it for {WAIT_S:g} s; wait for it or end it"
            )
        if error.connection_invalidated or "connection" in why or "unable to open" in why:
            return CatalogueUnavailable(f"{self.place}: cannot be opened: {why}; {self._remedy}")
        if "readonly" in why or "permission denied" in why:
            return CatalogueUnavailable(f"{self.place}: cannot be written: {why}; {self._remedy}")
        return CatalogueDamaged(f"{self.place}: is damaged: {why}; {REBUILD}")

    @property
    def _remedy(self) -> str:
        if self.is_sqlite:
            return "see that its folder is there and may be written to, or give another place with --catalogue"
        return "see that the server runs and lets this account in"


def address(given: str, default: Path) -> URL:
    """Where the catalogue is: ``given`` as a file or a URL of PostgreSQL, else the file ``default``."""
    if "://" not in given:
        return URL.create("sqlite", database=str(Path(given) if given else default))
    try:
        url = make_url(given)
    except (ArgumentError, ValueError) as error:
        raise UsageError(f"--catalogue {given.partition('://')[0]}://...: {error}") from error
    if url.get_backend_name() not in ("postgresql", "postgres"):
        raise UsageError(
            f"--catalogue {url.render_as_string(hide_password=True)}: give a file, or postgresql://USER@HOST/NAME"
        )
    return url.set(drivername=POSTGRESQL)


def _engine(url: URL) -> Engine:
    """A connection each time: a file that was replaced and a server that was started again are no matter."""
    if url.get_backend_name() == "sqlite":
        engine = create_engine(url, poolclass=NullPool, connect_args={"timeout": WAIT_S})
        event.listen(engine, "connect", _on_connect)
        event.listen(engine, "begin", _begin_sqlite)
        return engine
    try:
        engine = create_engine(url, poolclass=NullPool, isolation_level="REPEATABLE READ")
    except ModuleNotFoundError as error:
        raise UsageError("a catalogue in PostgreSQL needs psycopg: install tissue-rig[postgresql]") from error
    event.listen(engine, "begin", _begin_postgresql)
    return engine


def _on_connect(connection: sqlite3.Connection, _record: object) -> None:
    # Transactions begin where we say so, not where the driver thinks.
    connection.isolation_level = None
    connection.execute(ON_CONNECT)


def _begin_sqlite(connection: Connection) -> None:
    # Two that read first and write then would refuse each other at once; who begins as a writer waits.
    connection.exec_driver_sql("BEGIN IMMEDIATE" if _alone(connection) else "BEGIN")


def _begin_postgresql(connection: Connection) -> None:
    if _alone(connection):
        connection.exec_driver_sql(f"SET LOCAL lock_timeout = '{WAIT_S:g}s'")
        connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({WRITERS})")


def _alone(connection: Connection) -> bool:
    return bool(connection.get_execution_options().get("alone"))


def _first_line(error: BaseException) -> str:
    return str(error).strip().partition("\n")[0] or type(error).__name__


def _make_private(file: Path) -> None:
    """An empty file that nobody else may read: it will hold names of people."""
    try:
        os.close(os.open(file, os.O_CREAT | os.O_WRONLY, 0o600))
    except OSError as error:
        raise CatalogueUnavailable(
            f"{file}: cannot be made: {error.strerror}; give another place with --catalogue"
        ) from error
