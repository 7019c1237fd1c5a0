"""The tables follow the folders: new, changed and removed ones are noticed by what their files look like now."""

import contextlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sqlalchemy import Connection, bindparam, select

from api.catalogue.database import Database
from api.catalogue.erasing import left
from api.catalogue.folder import read_folder, stamp
from api.catalogue.schema import DERIVED, STAMP, TABLES, rows
from rig.results.catalogue import CatalogueEntry


@dataclass(frozen=True)
class FolderScan:
    """What each folder of a session looks like by its name, and sentences on what is not listed."""

    stamps: Mapping[str, str]
    remarks: tuple[str, ...] = ()


def scan(root: Path) -> FolderScan:
    """Every folder in ``root`` but hidden ones; a root that is not there holds nothing, and that is said."""
    try:
        found = sorted(os.scandir(root), key=lambda item: item.name)
    except FileNotFoundError:
        return FolderScan({}, (f"{root}: there is no such folder, so no session is listed",))
    except OSError as error:
        return FolderScan({}, (f"{root}: cannot be listed: {error.strerror}; see who may read it",))
    shown = [item for item in found if not item.name.startswith(".")]
    refused = {item.name: why for item in shown if (why := _refusal(item))}
    stamps = {}
    for item in shown:
        if item.name not in refused and _is_folder(item):
            with contextlib.suppress(OSError):  # removed meanwhile, or nobody may look into it: not listed
                stamps[item.name] = stamp(root / item.name)
    unfinished = [f"{path.name}: an erasure was interrupted; `rig catalogue rebuild` ends it" for path in left(root)]
    return FolderScan(stamps, (*refused.values(), *unfinished))


def _refusal(item: os.DirEntry[str]) -> str:
    """Why a folder is not listed; empty where it is, or is none."""
    if item.is_symlink():
        return f"{_printable(item.name)}: is a link, which is not followed; put the folder itself there"
    try:
        item.name.encode()
    except UnicodeEncodeError:
        return f"{_printable(item.name)}: its name is no UTF-8, so it cannot be listed; rename it"
    return ""


def _is_folder(item: os.DirEntry[str]) -> bool:
    return item.is_dir(follow_symlinks=False)


def _printable(name: str) -> str:
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


@contextlib.contextmanager
def current(database: Database, found: FolderScan) -> Iterator[tuple[Connection, tuple[str, ...]]]:
    """One state of all tables, brought to what the folders were ``found`` to hold; sentences on what is not listed."""
    with database.reading() as connection:
        known = stamps(connection)
        changed = [name for name, now in found.stamps.items() if known.get(name) != now]
        gone = [name for name in known if name not in found.stamps]
        if not changed and not gone:
            yield connection, found.remarks
            return
    entries = _read(database.root, changed)
    with database.writing() as connection:
        replace(connection, [*changed, *gone], entries, found.stamps)
    with database.reading() as connection:
        yield connection, found.remarks


def stamps(connection: Connection) -> dict[str, str]:
    """What each folder looked like when it was read, by name."""
    return {row.session: row.stamp for row in connection.execute(select(STAMP))}


def _read(root: Path, names: Iterable[str]) -> dict[str, list[CatalogueEntry]]:
    """The entries of each session; none of one that was removed while it was read."""
    found = {}
    for name in names:
        try:
            found[name] = read_folder(root / name)
        except OSError:
            found[name] = []
    return found


def replace(
    connection: Connection,
    names: Sequence[str],
    entries: Mapping[str, Sequence[CatalogueEntry]],
    found: Mapping[str, str],
) -> None:
    """In place of all there is of the sessions ``names`` their ``entries``, and how their folders look."""
    forget(connection, names)
    listed = [{"session": name, "stamp": found[name]} for name in entries]
    if listed:
        connection.execute(STAMP.insert(), listed)
    for kind, table in TABLES.items():
        of_kind = [entry for each in entries.values() for entry in each if isinstance(entry, kind)]
        if of_kind:
            connection.execute(table.insert(), rows(of_kind))


def forget(connection: Connection, names: Sequence[str]) -> None:
    """Takes the sessions ``names`` out of all tables."""
    if names:
        for table in DERIVED.tables.values():
            connection.execute(table.delete().where(table.c.session == bindparam("gone")), [{"gone": n} for n in names])


def refill(database: Database, connection: Connection) -> tuple[str, ...]:
    """Makes all derived tables anew from the folders, as one change; sentences on what is not listed."""
    DERIVED.drop_all(connection)
    database.create(connection)
    found = scan(database.root)
    replace(connection, (), _read(database.root, found.stamps), found.stamps)
    return found.remarks
