"""What a credential allows, and who one belongs to."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Literal


class Scope(IntEnum):
    """Each includes those below it."""

    READ = 1
    """Sees the bench, its sessions and what came of them; no names of people."""
    OPERATE = 2
    """Moves the bench, computes, imports, and sees the names of subjects."""
    ADMIN = 3
    """Makes tokens and accounts, erases, and takes over from whoever moves the bench."""

    @property
    def word(self) -> "ScopeWord":
        """As people write it."""
        return next(word for word, scope in WORDS.items() if scope is self)


ScopeWord = Literal["read", "operate", "admin"]
WORDS: dict[ScopeWord, Scope] = {"read": Scope.READ, "operate": Scope.OPERATE, "admin": Scope.ADMIN}


@dataclass(frozen=True)
class Caller:
    """Who asks, as the credential tells; ``id`` tells the credential itself from others of the same name."""

    name: str
    scope: Scope
    id: str
    by: Literal["token", "login", "link", "socket"]

    @property
    def key(self) -> str:
        """One credential of one person or program."""
        return f"{self.by} {self.name} {self.id}"

    def known_as(self, name: str) -> str:
        """As others are told: nobody goes by another's name, and what a page or program calls itself stands behind."""
        return self.name if name == self.name else f"{self.name} ({name})"

    def may(self, scope: Scope) -> bool:
        """Whether ``scope`` is within this caller's."""
        return self.scope >= scope
