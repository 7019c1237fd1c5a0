"""People with a password: kept as argon2id, which takes a quarter of a second and 64 MB a try.

So it is done in a pool of its own with few places: the event loop and other requests go on, and who comes when all are
taken is asked to wait. A name that is not there takes as long as one that is.
"""

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from api.http.access.scopes import WORDS, Caller, Scope, ScopeWord
from api.http.access.secrets import digest
from api.http.access.store import KeptModel, PrivateFile
from rig.apart import stand_back
from rig.errors import UsageError

SHORTEST_PASSWORD = 12
LONGEST_PASSWORD = 200
# 64 MB each; whoever comes beyond them waits outside.
WORKERS, WAITING = 1, 8
NICE = 10  # below the force loop and the service itself


class Account(KeptModel):
    """One person."""

    name: str
    scope: ScopeWord
    argon2: str

    @property
    def caller(self) -> Caller:
        """Who this is, by this password."""
        return Caller(self.name, WORDS[self.scope], self.mark, "login")

    @property
    def mark(self) -> str:
        """Tells one password from the next, and nothing of it."""
        return digest(self.argon2)[:8]


class Accounts(KeptModel):
    """The file of accounts."""

    version: int = 1
    accounts: tuple[Account, ...] = ()


class Busy(Exception):
    """All places of the pool are taken."""


class AccountStore:
    """Accounts in ``folder``; the hash's cost is argon2-cffi's own default (RFC 9106, second choice)."""

    def __init__(self, folder: Path, hasher: PasswordHasher | None = None) -> None:
        self._file = PrivateFile(folder / "accounts.json", Accounts())
        self._hasher = hasher or PasswordHasher()
        self._pool = ThreadPoolExecutor(WORKERS, "password", initializer=_stand_back)
        self._places = threading.Semaphore(WAITING)
        self._nobody = ""

    def accounts(self) -> tuple[Account, ...]:
        """All of them."""
        return self._file.read().accounts

    def has(self, caller: Caller) -> bool:
        """Whether the account that ``caller`` logged in with is still there, has that password, and allows as much."""
        known = (one for one in self.accounts() if (one.name, WORDS[one.scope]) == (caller.name, caller.scope))
        return any(caller.id.startswith(one.mark) for one in known)

    def set(self, name: str, scope: Scope, password: str) -> None:
        """A new account, or a new password and scope of one; raises UsageError where the password is too short."""
        if not SHORTEST_PASSWORD <= len(password) <= LONGEST_PASSWORD:
            raise UsageError(
                f"a password has {SHORTEST_PASSWORD} to {LONGEST_PASSWORD} letters, and this one {len(password)};"
                " a few words are easier to remember than signs"
            )
        hashed = Account(name=name, scope=scope.word, argon2=self._hasher.hash(password))
        with self._file.alone():
            others = tuple(account for account in self.accounts() if account.name != name)
            self._file.write(Accounts(accounts=(*others, hashed)))

    def remove(self, name: str) -> None:
        """Ends an account; raises UsageError where there is none."""
        with self._file.alone():
            accounts = self.accounts()
            kept = tuple(account for account in accounts if account.name != name)
            if len(kept) == len(accounts):
                known = ", ".join(account.name for account in accounts) or "none"
                raise UsageError(f"there is no account {name}; there are: {known}")
            self._file.write(Accounts(accounts=kept))

    async def enter(self, name: str, password: str) -> Caller | None:
        """Who that is; None where name or password is wrong. Raises Busy where too many are being checked."""
        if not self._places.acquire(blocking=False):
            raise Busy
        try:
            return await asyncio.get_running_loop().run_in_executor(self._pool, self._checked, name, password)
        finally:
            self._places.release()

    def _checked(self, name: str, password: str) -> Caller | None:
        found = next((account for account in self.accounts() if account.name == name), None)
        fits = self._fits(found.argon2 if found else self._made_up(), password)
        return found.caller if found and fits else None

    def _fits(self, hashed: str, password: str) -> bool:
        try:
            return self._hasher.verify(hashed, password)
        except (VerificationError, InvalidHashError):
            return False

    def _made_up(self) -> str:
        self._nobody = self._nobody or self._hasher.hash("")
        return self._nobody


def _stand_back() -> None:
    """On Linux a thread has a priority of its own."""
    stand_back(NICE, threading.get_native_id())
