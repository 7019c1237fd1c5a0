"""Who may move the bench: one holder at a time, for as long as they keep saying so.

A lease runs out by itself, so none is ever lost with its holder's browser. Stops and looking need none. How long it
lasts is measured on a clock that nobody sets and that goes on while the computer sleeps; ``since`` is for people alone.
"""

import threading
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from api.http.access.secrets import awake_s
from api.http.problems import NONE, RequestRefused

LOCKED = 423
Hearing = Callable[[str, str], object]


def silent(_code: str, _text: str) -> None:
    """Nobody is told."""


@dataclass(frozen=True)
class ControlLease:
    """One holder's turn; ``id`` is known to the holder alone, ``until_s`` is on the service's own clock.

    ``epoch`` grows with every lease given: of two, the one with the smaller number is the older, whatever clocks say.
    """

    id: str
    holder: str
    since: str
    ttl_s: float
    until_s: float
    epoch: int = 0
    purpose: str = ""


@dataclass(frozen=True)
class Takeover:
    """Who took control from whom, and why."""

    lease_id: str
    by: str
    reason: str
    at: str


class LeaseRegistry:
    """Hands out the lease. Every method is safe from any thread."""

    def __init__(self, now_s: Callable[[], float] = awake_s, told: Hearing = silent) -> None:
        """``told`` hears of every change: what, and in a sentence."""
        self._now_s, self._told, self._lock = now_s, told, threading.Lock()
        self._lease: ControlLease | None = None
        self._epoch = 0
        self._takeover: Takeover | None = None

    @property
    def lease(self) -> ControlLease | None:
        """The lease in force."""
        with self._lock:
            return self._in_force()

    def _in_force(self) -> ControlLease | None:
        if self._lease and self._lease.until_s <= self._now_s():
            self._told("lease-lost", f"{self._lease.holder} is not in control any more: control was not renewed")
            self._lease = None
        return self._lease

    def left_s(self, lease: ControlLease) -> float:
        """How long ``lease`` lasts if it is not renewed."""
        return max(lease.until_s - self._now_s(), 0.0)

    def take(self, holder: str, ttl_s: float, purpose: str = "") -> ControlLease:
        """A new lease; raises RequestRefused naming who holds it and since when."""
        with self._lock:
            held = self._in_force()
            if held:
                raise _locked(
                    held, "lease-held", f"{held.holder} has been in control since {held.since}; ask for its release, or"
                    f" wait: it runs out {held.ttl_s:g} s after its last renewal",
                )  # fmt: skip
            self._told("lease-taken", f"{holder} is in control" + (f": {purpose}" if purpose else ""))
            return self._give(holder, ttl_s, purpose)

    def take_over(
        self, holder: str, ttl_s: float, purpose: str, reason: str, moving: bool, may_stop: bool
    ) -> ControlLease:
        """A new lease in the place of the one in force; who had it is told by whom and why.

        The rule: while nothing moves whoever may operate the bench may take over; while something is ``moving``, which
        is then stopped and retracted, only who ``may_stop`` the work of others. Raises RequestRefused otherwise.
        """
        with self._lock:
            held = self._in_force()
            if held and moving and not may_stop:
                raise _locked(
                    held, "lease-moving", f"{held.holder} moves the bench; wait for its end, or stop it: a stop needs"
                    " no control. Someone with the scope admin may take over meanwhile",
                )  # fmt: skip
            if held:
                self._takeover = Takeover(held.id, holder, reason, _now())
            whose = f" from {held.holder}" if held else ""
            self._told("lease-taken-over", f"{holder} took control over{whose}: {reason}")
            return self._give(holder, ttl_s, purpose)

    def _give(self, holder: str, ttl_s: float, purpose: str) -> ControlLease:
        self._epoch += 1
        until_s = self._now_s() + ttl_s
        self._lease = ControlLease(uuid.uuid4().hex, holder, _now(), ttl_s, until_s, self._epoch, purpose)
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
            held = self._mine(identifier)
            self._told("lease-released", f"{held.holder} gave control back")
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
        taken = self._takeover if self._takeover and self._takeover.lease_id == identifier else None
        if taken:
            what = f"{taken.by} took control over at {taken.at}: {taken.reason}"
        text = f"{what}; {owner}: take the lease with POST /api/v1/control/lease first"
        raise _locked(held, "no-lease", text, {"taken_by": taken.by, "reason": taken.reason} if taken else NONE)


def _locked(held: ControlLease | None, code: str, text: str, more: Mapping[str, str] = NONE) -> RequestRefused:
    whose = {"holder": held.holder, "purpose": held.purpose, "since": held.since} if held else {}
    return RequestRefused(LOCKED, code, text, {**whose, **more})


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
