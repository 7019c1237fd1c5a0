"""Tokens for programs: shown once when they are made, kept as SHA-256, good until they are revoked.

They have no date of expiry: a wall clock that is set back would keep one alive.
"""

import secrets
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from api.http.access.scopes import WORDS, Caller, Scope, ScopeWord
from api.http.access.secrets import TOKEN_MARK, digest, new_secret, position
from api.http.access.store import KeptModel, PrivateFile
from controller.claims import state_folder
from rig.errors import UsageError


class Token(KeptModel):
    """One token as it is kept."""

    id: str
    name: str
    scope: ScopeWord
    created: str
    sha256: str

    @property
    def caller(self) -> Caller:
        """Whoever has it."""
        return Caller(self.name, WORDS[self.scope], self.id, "token")


class Tokens(KeptModel):
    """The file of tokens."""

    version: int = 1
    tokens: tuple[Token, ...] = ()


class NewToken(NamedTuple):
    """A token, and the secret that is never seen again."""

    token: Token
    secret: str


class TokenStore:
    """Tokens in ``folder``; what another process makes or revokes counts from the next request on."""

    def __init__(self, folder: Path) -> None:
        self._file = PrivateFile(folder / "tokens.json", Tokens())

    def tokens(self) -> tuple[Token, ...]:
        """All of them, oldest first."""
        return self._file.read().tokens

    def create(self, name: str, scope: Scope) -> NewToken:
        """A new one; raises UsageError where the name is taken, as the audit log names callers by it."""
        secret = TOKEN_MARK + new_secret()
        created = datetime.now(UTC).isoformat(timespec="seconds")
        with self._file.alone():
            tokens = self.tokens()
            if any(token.name == name for token in tokens):
                raise UsageError(f"there is a token called {name}; revoke it first, or give another name")
            token = Token(id=secrets.token_hex(4), name=name, scope=scope.word, created=created, sha256=digest(secret))
            self._file.write(Tokens(tokens=(*tokens, token)))
        return NewToken(token, secret)

    def revoke(self, name: str) -> Token:
        """Ends the token called ``name``, or with that id; raises UsageError where there is none."""
        with self._file.alone():
            tokens = self.tokens()
            ended = [token for token in tokens if name in (token.name, token.id)]
            if not ended:
                known = ", ".join(token.name for token in tokens) or "none"
                raise UsageError(f"there is no token called {name}; there are: {known}")
            self._file.write(Tokens(tokens=tuple(token for token in tokens if token not in ended)))
        return ended[0]

    def caller(self, secret: str) -> Caller | None:
        """Whose token it is."""
        tokens = self.tokens()
        found = position(secret, (token.sha256 for token in tokens))
        return None if found is None else tokens[found].caller


def access_folder() -> Path:
    """Where tokens, accounts and the audit log of this user are."""
    return state_folder() / "access"
