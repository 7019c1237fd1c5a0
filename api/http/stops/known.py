"""What the process that takes stops from other computers is told: at its start, and in a private file ever after."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from api.http.access.logins import Pass


class AwaySettings(BaseModel):
    """At its start. Without ``files``, certificate and key, a reverse proxy on this computer is before it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    known: Path
    access: Path
    """Folder of tokens, accounts and the audit log."""
    names: tuple[str, ...]
    files: tuple[Path, Path] | None
    service_port: int
    """A cookie's name has it."""
    page_port: int
    """Of the address that people open."""


class Known(BaseModel):
    """What changes: the bench's stop word, and whose browsers are logged in."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    page: str = ""
    logins: tuple[Pass, ...] = ()
