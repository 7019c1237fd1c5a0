"""A request's head as it arrived, and what that tells of where it came from."""

from collections.abc import Mapping
from typing import NamedTuple
from urllib.parse import urlsplit

from controller.stop.http import LOCAL

LOOPBACK = ("127.0.0.1", "::1", "::ffff:127.0.0.1")
FORWARDED = {"forwarded", "x-forwarded-for", "x-forwarded-host", "x-forwarded-proto", "x-real-ip", "via"}


class Arrived(NamedTuple):
    """A request's head, and what is known of who sent it."""

    method: str
    path: str
    headers: Mapping[str, str]
    scheme: str
    address: str
    port: int
    client: str
    owner: bool
    """It came through the socket that only the account of the service can open."""

    @property
    def host(self) -> str:
        """The name it was sent to."""
        try:
            return urlsplit(f"//{self.headers.get('host', '')}").hostname or ""
        except ValueError:
            return ""

    @property
    def local(self) -> bool:
        """Whether it came from this computer itself, and not through a proxy on it."""
        if self.owner:
            return True
        return self.client in LOOPBACK and self.host in LOCAL and not FORWARDED & self.headers.keys()

    def known_as(self, names: tuple[str, ...]) -> bool:
        """Whether it was sent to this computer by one of ``names``, or by its own."""
        return self.owner or self.host in (*LOCAL, self.address, *names)
