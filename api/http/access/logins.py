"""Browsers that are logged in, and links that log one in once.

Both live in this process' memory, by SHA-256, on a clock that nobody sets: they end with the service at the latest.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

from api.http.access.scopes import Caller, Scope
from api.http.access.secrets import awake_s, digest, new_secret, position

TICKET_S = 300.0
# A working day; whoever leaves the page open over night logs in again.
LOGIN_S = 12 * 3600.0
# A few browsers of each person of a lab; what is beyond them is the one that logged in first.
LOGINS = 200
TICKETS = 20


@dataclass(frozen=True)
class Pass:
    """One ticket or login: whose, and until when on the service's own clock."""

    sha256: str
    caller: Caller
    until_s: float


class Passes:
    """At most ``most`` secrets, each good for ``lasts_s``. Every method is safe from any thread."""

    def __init__(self, lasts_s: float, most: int, now_s: Callable[[], float] = awake_s) -> None:
        self._lasts_s, self._most, self._now_s = lasts_s, most, now_s
        self._lock = threading.Lock()
        self._passes: tuple[Pass, ...] = ()
        self.changed: Callable[[], None] = lambda: None
        """Called after what is in force has changed, other than by time."""

    def add(self, caller: Caller) -> str:
        """A new secret for ``caller``."""
        secret = new_secret()
        with self._lock:
            held = (*self._in_force(), Pass(digest(secret), caller, self._now_s() + self._lasts_s))
            self._passes = held[-self._most :]
        self.changed()
        return secret

    def caller(self, secret: str) -> Caller | None:
        """Whose secret it is."""
        with self._lock:
            found = self._find(secret)
            return found.caller if found else None

    def take(self, secret: str) -> Caller | None:
        """The same, once: from then on the secret is worth nothing."""
        with self._lock:
            found = self._find(secret)
            self._passes = tuple(held for held in self._in_force() if held is not found)
        self.changed()
        return found.caller if found else None

    def drop(self, which: Callable[[Caller], bool]) -> None:
        """Ends those of some callers."""
        with self._lock:
            self._passes = tuple(held for held in self._in_force() if not which(held.caller))
        self.changed()

    @property
    def held(self) -> tuple[Pass, ...]:
        """All that are in force."""
        with self._lock:
            return self._in_force()

    def restore(self, passes: tuple[Pass, ...]) -> None:
        """Takes over what another process holds; the clock is the computer's."""
        with self._lock:
            self._passes = passes

    def _find(self, secret: str) -> Pass | None:
        held = self._in_force()
        found = position(secret, (one.sha256 for one in held))
        return None if found is None else held[found]

    def _in_force(self) -> tuple[Pass, ...]:
        now_s = self._now_s()
        self._passes = tuple(held for held in self._passes if held.until_s > now_s)
        return self._passes


class Logins:
    """Tickets and what they, or a password, were changed for."""

    def __init__(self, now_s: Callable[[], float] = awake_s) -> None:
        self.tickets = Passes(TICKET_S, TICKETS, now_s)
        self.browsers = Passes(LOGIN_S, LOGINS, now_s)

    def ticket(self, name: str, scope: Scope = Scope.ADMIN) -> str:
        """A ticket for whoever started the service, who may do all that the service may."""
        return self.tickets.add(Caller(name, scope, "", "link"))

    def enter(self, caller: Caller) -> tuple[Caller, str]:
        """Logs a browser in; the secret is for its cookie."""
        known = replace(caller, id=caller.id + digest(new_secret())[:8])
        return known, self.browsers.add(known)
