"""Credentials: logging a browser in and out, links that do it once, tokens for programs."""

import math

from fastapi import APIRouter, Request, Response

from api.http.access.access import cookie_name, cookies
from api.http.access.accounts import Busy
from api.http.access.limits import PASSWORD
from api.http.access.logins import TICKET_S
from api.http.access.models import (
    AccountView,
    AuditView,
    LinkRequest,
    LinkView,
    LoginRequest,
    Me,
    NewTokenView,
    TicketRequest,
    TokenRequest,
    TokenView,
)
from api.http.access.rights import ADMIN, CALLER, PUBLIC, READ
from api.http.access.scopes import WORDS, Caller, ScopeWord
from api.http.listing import Listing, listing
from api.http.problems import RequestRefused, responses
from api.http.routes.common import PageQuery, WhoAsks, Word
from api.http.service import Service

# As long as the passwords of those before take.
BUSY_S = 3.0


def add(router: APIRouter, service: Service) -> None:
    """Its routes."""
    _logins(router, service)
    _logged_in(router, service)
    _tokens(router, service)

    @router.get("/accounts", dependencies=[ADMIN], summary="People who log in with a password, by name")
    def accounts(page: PageQuery, name: Word = "", scope: ScopeWord | None = None) -> Listing[AccountView]:
        found = (AccountView(name=one.name, scope=one.scope) for one in service.access.accounts.accounts())
        return listing("accounts", found, page, lambda one: (one.name, ""), name=name, scope=scope)

    @router.get("/audit", dependencies=[ADMIN], summary="Who did what, newest first")
    def audit(page: PageQuery, who: Word = "", what: Word = "", outcome: Word = "") -> AuditView:
        log = service.access.audit
        log.settle()
        lines = log.lines()
        found = listing(
            "audit", log.entries(lines), page, lambda one: (f"{one.seq:012}", one.before), newest_first=True,
            who=who, what=what, outcome=outcome,
        )  # fmt: skip
        return AuditView(**vars(found), broken=log.broken(lines))


def _logins(router: APIRouter, service: Service) -> None:
    @router.post(
        "/auth/ticket",
        dependencies=[PUBLIC],
        summary="Logs a browser in by a link's ticket",
        responses=responses("401 ticket"),
    )
    def ticket(sent: TicketRequest, request: Request, response: Response) -> Me:
        caller = service.access.logins.tickets.take(sent.ticket)
        if caller is None:
            text = "this link is used up or older than five minutes; `rig token link` prints another"
            raise RequestRefused(401, "ticket", text)
        return _enter(service, caller, request, response)

    @router.post(
        "/auth/login",
        dependencies=[PUBLIC],
        summary="Logs a browser in by a password",
        responses=responses("401 password", "429 too-many"),
    )
    async def login(sent: LoginRequest, request: Request, response: Response) -> Me:
        caller = await _checked(service, sent, request)
        if caller is None:
            text = "name or password is wrong; an account is made on the bench's computer by `rig account set NAME`"
            raise RequestRefused(401, "password", text)
        return _enter(service, caller, request, response)


def _logged_in(router: APIRouter, service: Service) -> None:
    logins = service.access.logins

    @router.post("/auth/logout", dependencies=[READ], summary="Logs this browser out")
    def logout(request: Request, response: Response) -> Me:
        name = _cookie(request)
        gone = logins.browsers.take(cookies(request.headers).get(name, ""))
        response.delete_cookie(name, path="/")
        if gone:
            service.events.publish("access", "logout", f"{gone.name} logged out")
        return Me(name=gone.name if gone else "", scopes=[])

    @router.get("/auth/me", dependencies=[READ], summary="Who asks, and what they may")
    async def me(caller: WhoAsks) -> Me:
        return Me.of(caller)

    @router.post("/auth/links", dependencies=[ADMIN], summary="A ticket that logs a browser in once")
    def link(wanted: LinkRequest) -> LinkView:
        ticket = logins.ticket(wanted.name, WORDS[wanted.scope])
        return LinkView(ticket=ticket, lasts_s=TICKET_S, address=service.access.address)


async def _checked(service: Service, sent: LoginRequest, request: Request) -> Caller | None:
    address = request.client.host if request.client else ""
    limits = service.access.limits
    wait_s = max(limits.wait_s(f"{kind} {who}", PASSWORD) for kind, who in (("name", sent.name), ("from", address)))
    try:
        if not wait_s:
            return await service.access.accounts.enter(sent.name, sent.password)
    except Busy:
        wait_s = BUSY_S
    again_s = str(math.ceil(wait_s))
    text = f"too many tries to log in; try again in {again_s} s"
    raise RequestRefused(429, "too-many", text, headers={"Retry-After": again_s})


def _enter(service: Service, caller: Caller, request: Request, response: Response) -> Me:
    known, secret = service.access.logins.enter(caller)
    request.scope[CALLER] = known  # for the audit log
    service.events.publish("access", "login", f"{known.name} logged in")
    secure = request.url.scheme == "https"
    response.set_cookie(_cookie(request), secret, path="/", httponly=True, samesite="strict", secure=secure)
    return Me.of(known)


def _cookie(request: Request) -> str:
    _, port = request.scope["server"]
    return cookie_name(port or 0)


def _tokens(router: APIRouter, service: Service) -> None:
    tokens = service.access.tokens

    @router.get("/tokens", dependencies=[ADMIN], summary="Tokens, oldest first, without their secrets")
    def listed(page: PageQuery, name: Word = "", scope: ScopeWord | None = None) -> Listing[TokenView]:
        found = map(TokenView.of, tokens.tokens())
        return listing("tokens", found, page, lambda one: (one.created, one.id), name=name, scope=scope)

    @router.post(
        "/tokens", dependencies=[ADMIN], status_code=201, summary="Makes a token; its secret is shown once",
        responses=responses("422 refused"),
    )  # fmt: skip
    def create(wanted: TokenRequest) -> NewTokenView:
        made = tokens.create(wanted.name, WORDS[wanted.scope])
        return NewTokenView(**vars(TokenView.of(made.token)), token=made.secret)

    @router.delete(
        "/tokens/{name}", dependencies=[ADMIN], summary="Revokes a token", responses=responses("422 refused")
    )
    def revoke(name: str) -> TokenView:
        return TokenView.of(tokens.revoke(name))
