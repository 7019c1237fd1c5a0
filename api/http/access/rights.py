"""What each route asks for, declared where the route is: ``APIRouter(dependencies=[READ])``.

The last declaration counts, so that a route may ask for more, or less, than its router. A route that declares nothing
serves nobody. The right is checked before a body is read, by `api.http.guard`; the dependency itself checks again.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from fastapi import Depends, FastAPI
from fastapi.params import Depends as Declared
from fastapi.routing import RouteContext, iter_route_contexts
from starlette.requests import HTTPConnection
from starlette.routing import Mount, compile_path

from api.http.access.scopes import Caller, Scope
from api.http.problems import RequestRefused

# The largest request of most routes is a tracking job of 20 forces, below 2 kB.
LARGEST_BODY_BYTES = 64_000


@dataclass(frozen=True)
class Right:
    """``scope`` None: open to all. ``stop``: on this computer open to all, and never limited.

    A body is read whole before the route runs, unless it is ``streamed``.
    """

    scope: Scope | None
    stop: bool = False
    largest_body_bytes: int = LARGEST_BODY_BYTES
    streamed: bool = False

    async def __call__(self, connection: HTTPConnection) -> None:
        """As a dependency: raises RequestRefused where the guard has not let this right pass."""
        if connection.scope.get(PASSED) != self and not _passes(self, connection.scope.get(CALLER)):
            raise RequestRefused(403, "no-right", "this request did not pass the check of rights")


# What is known of a request: its right, who asks, and a function that says whether they still may.
PASSED, CALLER, ENTITLED = "rig.right", "rig.caller", "rig.entitled"
# How often that is asked of what stays open: who revokes a token waits for it, and a look costs what a request does.
RECHECK_S = 1.0


def _passes(right: Right, caller: Caller | None) -> bool:
    return right.scope is None or (caller is not None and caller.may(right.scope))


def _declared(right: Right) -> Declared:
    found = Depends(right)
    assert isinstance(found, Declared)
    return found


PUBLIC = _declared(Right(None))
STOP = _declared(Right(Scope.READ, stop=True))
READ = _declared(Right(Scope.READ))
OPERATE = _declared(Right(Scope.OPERATE))
ADMIN = _declared(Right(Scope.ADMIN))


def upload(scope: Scope, largest_body_bytes: int) -> Declared:
    """For a route that takes a file and reads it itself, piece by piece."""
    return _declared(Right(scope, largest_body_bytes=largest_body_bytes, streamed=True))


@dataclass(frozen=True)
class Rule:
    """The right of one route; None where none was declared."""

    path: str
    methods: frozenset[str]
    right: Right | None
    pattern: re.Pattern[str]

    def fits(self, method: str, path: str) -> bool:
        """Whether that request is this route's."""
        known = not self.methods or method in self.methods
        return known and self.pattern.match(path) is not None


class RightsTable:
    """Rights of all routes of ``app``, in the order in which routes are tried."""

    def __init__(self, app: FastAPI) -> None:
        self._app = app
        self._rules: Sequence[Rule] = ()
        self._routes = 0

    @property
    def rules(self) -> Sequence[Rule]:
        """One rule a route."""
        if self._routes != len(self._app.routes):
            self._rules, self._routes = tuple(_rules(self._app)), len(self._app.routes)
        return self._rules

    def find(self, method: str, path: str) -> Rule | None:
        """The rule of the route that will serve the request; None where none will."""
        return next((rule for rule in self.rules if rule.fits(method, path)), None)

    def methods(self, path: str) -> frozenset[str]:
        """What the routes at ``path`` take; none where there is no route."""
        return frozenset().union(*(rule.methods for rule in self.rules if rule.pattern.match(path)))


WEBSOCKET = "WEBSOCKET"


def _rules(app: FastAPI) -> Iterator[Rule]:
    for context in iter_route_contexts(app.routes):
        path, mounted = context.path or "", isinstance(context.original_route, Mount)
        pattern, _, _ = compile_path(path + "/{path:path}" if mounted else path)
        methods = frozenset() if mounted else frozenset(context.methods or {WEBSOCKET})
        yield Rule(path, methods, declared(context), pattern)


def declared(context: RouteContext) -> Right | None:
    """The right that a route declares last; a mounted application carries it as its own ``right``."""
    dependencies = getattr(context, "dependencies", None) or ()
    rights = [found.dependency for found in dependencies if isinstance(found.dependency, Right)]
    mounted = getattr(getattr(context.original_route, "app", None), "right", None)
    return rights[-1] if rights else mounted if isinstance(mounted, Right) else None
