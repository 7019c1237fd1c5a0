"""Secrets of 256 random bits: made, hashed and compared.

So many random bits need no slow hash (that is for passwords): nobody finds them by trying, so SHA-256 is enough.
"""

import hashlib
import hmac
import secrets
import time
from collections.abc import Callable, Iterable

BYTES = 32
TOKEN_MARK = "rig_"  # so that a scanner for leaked secrets can tell what it found


def new_secret() -> str:
    """43 letters of a URL."""
    return secrets.token_urlsafe(BYTES)


def digest(secret: str) -> str:
    """What is kept of a secret."""
    return hashlib.sha256(secret.encode("utf-8", "surrogateescape")).hexdigest()


def position(secret: str, digests: Iterable[str]) -> int | None:
    """Which of ``digests`` is that of ``secret``. All are looked at, and each to its end: the time tells nothing."""
    wanted, found = digest(secret), None
    for number, candidate in enumerate(digests):
        if hmac.compare_digest(wanted, candidate):
            found = number
    return found


def awake_s() -> float:
    """A clock for how long something lasts [s]: nobody sets it, and it goes on while the computer sleeps."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def steady_s() -> Callable[[], float]:
    """The time of day, carried on by a clock that nobody sets: who sets the date makes nothing be forgotten [s]."""
    ahead_s = time.time() - awake_s()
    return lambda: ahead_s + awake_s()
