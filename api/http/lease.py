"""Who may move the bench: one holder at a time, for as long as they keep saying so.

A lease runs out by itself, so none is ever lost with its holder's browser. Stops and looking need none.
"""

import threading
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from api.http.problems import RequestRefused


@dataclass(frozen=True)
class ControlLease:
    """One holder's turn; ``id`` is known to the holder alone, ``until_s`` is on the service's own clock."""

    id: str
    holder: str
    since: str
    ttl_s: float
    until_s: float


class LeaseRegistry:
    """Hands out the lease. Every method is safe from any thread."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s, self._lock = now_s, threading.Lock()
        self._lease: ControlLease | None = None

    @property
    def lease(self) -> ControlLease | None:
        """The lease in force."""
        with self._lock:
            return self._in_force()

    def _in_force(self) -> ControlLease | None:
        if self._lease and self._lease.until_s <= self._now_s():
            self._lease = None
        return self._lease

    def left_s(self, lease: ControlLease) -> float:
        """How long ``lease`` lasts if it is not renewed."""
        return max(lease.until_s - self._now_s(), 0.0)

    def take(self, holder: str, ttl_s: float) -> ControlLease:
        """A new lease; raises RequestRefused naming who holds it and since when."""
        with self._lock:
            held = self._in_force()
            if held:
                raise RequestRefused(
                    409, "lease-held", f"{held.holder} has been in control since {held.since}; ask for its release, or"
                    f" wait: it runs out {held.ttl_s:g} s after its last renewal",
                )  # fmt: skip
            since = datetime.now(UTC).isoformat(timespec="seconds")
            self._lease = ControlLease(uuid.uuid4().hex, holder, since, ttl_s, self._now_s() + ttl_s)
            return self._lease

    def renew(self, identifier: str) -> ControlLease:
        """The same lease for another while; raises RequestRefused where it is not in force any more."""
        with self._lock:
            held = self._mine(identifier)
            self._lease = replace(held, until_s=self._now_s() + held.ttl_s)
            return self._lease

    def release(self, identifier: str) -> None:
        """Ends the lease; what it moves is stopped as if it had run out."""
        with self._lock:
            self._mine(identifier)
            self._lease = None

    def check(self, identifier: str) -> None:
        """Raises RequestRefused where ``identifier`` is not the lease in force."""
        with self._lock:
            self._mine(identifier)

    def holds(self, identifier: str) -> bool:
        """Whether ``identifier`` is the lease in force."""
        held = self.lease
        return held is not None and held.id == identifier

    def _mine(self, identifier: str) -> ControlLease:
        held = self._in_force()
        if held and held.id == identifier:
            return held
        owner = f"{held.holder} is in control since {held.since}" if held else "nobody is in control"
        what = "that lease is not in force" if identifier else "no X-Control-Lease header was sent"
        raise RequestRefused(409, "no-lease", f"{what}; {owner}: take the lease with POST /api/v1/control/lease first")
