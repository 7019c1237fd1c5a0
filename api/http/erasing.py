"""Erasure in two steps: the first says what would go, the second is sent what the first has said."""

import hashlib
from pathlib import Path
from typing import Annotated

from fastapi import Query, Response
from pydantic import Field

from api.http.jobs.places import PlaceRefused
from api.http.uploads import UploadView
from rig.results.base import SavedResult

Confirm = Annotated[str, Query(max_length=100)]


class SessionErasure(SavedResult):
    """What an erasure takes, or has taken once it is ``done``; ``confirm`` is what the second step asks for."""

    session: str
    done: bool
    files: int
    bytes: int
    confirm: str = Field(default="", description="good as long as nothing in the session changes")


class UploadErasure(UploadView):
    """What goes with an upload, or has gone once it is ``done``; ``confirm`` is what the second step asks for."""

    done: bool
    confirm: str = Field(default="", description="good as long as nothing in the upload changes")


def state_of(folder: Path) -> str:
    """Another content, another name."""
    found = sorted(
        (path.relative_to(folder).as_posix(), *(path.lstat()[at] for at in (6, 8)), path.lstat().st_mtime_ns)
        for path in folder.rglob("*")
    )
    return hashlib.sha256(repr((str(folder), found)).encode()).hexdigest()[:24]


def to_confirm(what: str, folder: Path, confirm: str, response: Response) -> str:
    """In the first step, answered with 202, what the second is to send; empty in the second.

    Raises PlaceRefused where that is something else, or ``folder`` has changed since.
    """
    token = state_of(folder)
    if not confirm:
        response.status_code = 202
        return token
    if confirm != token:
        text = f"{what} has changed since, or that is not what the first step said; ask again without it"
        raise PlaceRefused(409, "stale", text)
    return ""
