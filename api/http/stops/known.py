"""What the process that takes stops from other computers is told: at its start, and in a private file ever after."""

from pathlib import Path

from api.http.access.logins import Pass
from api.http.access.store import KeptModel


class AwaySettings(KeptModel):
    """At its start. Without ``files``, certificate and key, a reverse proxy on this computer is before it."""

    known: Path
    access: Path
    """Folder of tokens, accounts and the audit log."""
    names: tuple[str, ...]
    files: tuple[Path, Path] | None
    service_port: int
    """A cookie's name has it."""
    page_port: int
    """Of the address that people open."""


class Known(KeptModel):
    """What changes: the bench's stop word, and whose browsers are logged in."""

    page: str = ""
    logins: tuple[Pass, ...] = ()
