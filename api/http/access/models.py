"""What goes over the wire about credentials."""

from typing import Annotated

from pydantic import BaseModel, Field

from api.http.access.audit import AuditLine
from api.http.access.scopes import WORDS, Caller, ScopeWord
from api.http.access.tokens import Token
from api.http.listing import Listing
from api.http.models import RequestBody

Secret = Annotated[str, Field(min_length=1, max_length=200)]
Holder = Annotated[str, Field(min_length=1, max_length=80)]


class LoginRequest(RequestBody):
    """A name and its password."""

    name: Holder
    password: Secret


class TicketRequest(RequestBody):
    """Changes a link's ticket, which is good once, for a login."""

    ticket: Secret


class LinkRequest(RequestBody):
    """Asks for an address that logs a browser in once."""

    name: Holder = Field(description="whom it is for, as others are told")
    scope: ScopeWord = "operate"


class LinkView(BaseModel):
    """An address that logs a browser in."""

    ticket: str = Field(description="good once, for five minutes; goes behind the page's address as #ticket=...")
    lasts_s: float
    address: str = Field(description="of the page; empty where the service was not told what people open")


class Me(BaseModel):
    """Who asks, and what they may."""

    name: str
    scopes: list[ScopeWord]

    @classmethod
    def of(cls, caller: Caller) -> "Me":
        """As ``caller`` sees it."""
        return cls(name=caller.name, scopes=[word for word, scope in WORDS.items() if caller.may(scope)])


class TokenRequest(RequestBody):
    """Makes a token."""

    name: Holder = Field(description="what it is for, as the audit log names it")
    scope: ScopeWord


class TokenView(BaseModel):
    """A token, without its secret."""

    id: str
    name: str
    scope: ScopeWord
    created: str

    @classmethod
    def of(cls, token: Token) -> "TokenView":
        """As it is shown."""
        return cls(id=token.id, name=token.name, scope=token.scope, created=token.created)


class NewTokenView(TokenView):
    """A token just made."""

    token: str = Field(description="to be sent as `Authorization: Bearer ...`; it is never shown again")


class AccountView(BaseModel):
    """A person who logs in with a password."""

    name: str
    scope: ScopeWord


class AuditView(Listing[AuditLine]):
    """What was done, newest first; ``next`` is the cursor of what came before, null at the beginning."""

    broken: list[int] = Field(description="numbers of lines that do not follow the one before")
