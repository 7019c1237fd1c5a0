"""Who a request comes from: a program with a token, a browser with a cookie, or the command line beside the service."""

import getpass
import os
from collections.abc import Callable, Mapping
from http.cookies import CookieError, SimpleCookie
from pathlib import Path

from api.http.access.accounts import AccountStore
from api.http.access.audit import AuditLog
from api.http.access.limits import RateLimits
from api.http.access.logins import Logins
from api.http.access.scopes import Caller, Scope
from api.http.access.secrets import awake_s
from api.http.access.tokens import TokenStore, access_folder

BEARER = "bearer "
SUBPROTOCOL = "rig.token."  # a browser cannot set headers of a WebSocket, and addresses end up in logs
COOKIE = "rig_login"


class Access:
    """Tokens, logins and tickets of one service; ``folder`` keeps what outlasts it."""

    def __init__(self, folder: Path | None = None, now_s: Callable[[], float] = awake_s) -> None:
        self.folder = folder or access_folder()
        self.tokens = TokenStore(self.folder)
        self.accounts = AccountStore(self.folder)
        self.logins = Logins(now_s)
        self.limits = RateLimits(now_s)
        self.audit = AuditLog(self.folder / "audit.jsonl")
        self.address = ""
        """What people open."""

    def caller(self, headers: Mapping[str, str], cookie: str, owner: bool) -> Caller | None:
        """Who sent these headers; ``owner``: they came through the socket that only this account can open.

        A token that is wrong is not made up for by a cookie that is right.
        """
        token = _token(headers)
        if token is not None:
            return self.tokens.caller(token)
        if owner:
            return Caller(owner_name(), Scope.ADMIN, "socket", "socket")
        secret = cookies(headers).get(cookie, "")
        found = self.logins.browsers.caller(secret) if secret else None
        return found if found and (found.by != "login" or self.accounts.has(found)) else None


def owner_name() -> str:
    """The account that runs the service."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # an account without a name, as in a container
        return f"uid-{os.getuid()}"


def _token(headers: Mapping[str, str]) -> str | None:
    """The token that was sent; None where none was."""
    stated = headers.get("authorization", "")
    if stated[: len(BEARER)].lower() == BEARER:
        return stated[len(BEARER) :].strip()
    if stated:
        return ""
    offered = (part.strip() for part in headers.get("sec-websocket-protocol", "").split(","))
    return next((part.removeprefix(SUBPROTOCOL) for part in offered if part.startswith(SUBPROTOCOL)), None)


def cookies(headers: Mapping[str, str]) -> Mapping[str, str]:
    """Cookies by name; none where the header is no list of cookies."""
    try:
        return {name: morsel.value for name, morsel in SimpleCookie(headers.get("cookie", "")).items()}
    except CookieError:
        return {}


def cookie_name(port: int) -> str:
    """Cookies are the host's, not the port's: two services on one computer must not log each other out."""
    return f"{COOKIE}_{port}"
