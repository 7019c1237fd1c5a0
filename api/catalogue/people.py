"""Names of people by the code their sessions carry: only in the catalogue, so they have a backup of their own."""

import os
import sqlite3
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from pydantic import Field
from sqlalchemy import Connection, select

from api.catalogue.schema import PERSON
from rig.errors import UsageError
from rig.recording.files import whole_file
from rig.results.base import Result, SavedResult
from rig.results.catalogue import Text


class NamedPerson(Result):
    """The name kept for a subject's code."""

    subject: Text = Field(min_length=1)
    name: Text = Field(min_length=1)
    entered: Text = ""


class NamesBackup(SavedResult):
    """A backup of all names."""

    format: Literal["tissue-rig names"] = "tissue-rig names"
    people: tuple[NamedPerson, ...]


def names(connection: Connection) -> dict[str, NamedPerson]:
    """Everybody's, by code."""
    found = connection.execute(select(PERSON).order_by(PERSON.c.subject)).mappings()
    return {row["subject"]: NamedPerson.model_validate(dict(row)) for row in found}


def keep(connection: Connection, people: Iterable[NamedPerson]) -> None:
    """Keeps each name, in place of one that the code had."""
    for person in people:
        connection.execute(PERSON.delete().where(PERSON.c.subject == person.subject))
        connection.execute(PERSON.insert().values(**person.model_dump()))


def forget_name(connection: Connection, subject: str) -> bool:
    """Whether there was a name to forget."""
    return connection.execute(PERSON.delete().where(PERSON.c.subject == subject)).rowcount > 0


def now() -> str:
    """When a name is entered, UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z")


def read_backup(file: Path) -> tuple[NamedPerson, ...]:
    """The names in a backup; raises UsageError where it is none, or of a newer program."""
    try:
        return NamesBackup.read(file).people
    except OSError as error:
        raise UsageError(f"{file}: cannot be read: {error.strerror}; give a file of `rig catalogue backup`") from error


def write_backup(people: tuple[NamedPerson, ...], file: Path) -> None:
    """Writes a new file that only its owner may read; one that exists is not overwritten."""
    text = NamesBackup(people=people).model_dump_json(indent=2) + "\n"
    with whole_file(file) as scratch, os.fdopen(os.open(scratch, os.O_CREAT | os.O_WRONLY, 0o600), "w") as out:
        out.write(text)


def salvage(file: Path) -> tuple[list[NamedPerson], str]:
    """Names that a damaged file still gives, and what ended the reading; empty where nothing did."""
    found: list[NamedPerson] = []
    try:
        connection = sqlite3.connect(f"file:{file}?mode=ro", uri=True)
        try:
            for row in connection.execute("SELECT subject, name, entered FROM rig_person"):
                found.append(NamedPerson(subject=row[0], name=row[1], entered=row[2]))
        finally:
            connection.close()
    except (sqlite3.Error, ValueError) as error:
        return found, str(error)
    return found, ""
