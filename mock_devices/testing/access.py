"""Credentials for tests: one token of each scope, made once a process, for services of the same state folder."""

import atexit
import contextlib
import functools
import os
import secrets
from typing import TYPE_CHECKING, Any

from api.http.access.scopes import Scope
from api.http.access.tokens import TokenStore, access_folder
from api.http.app import build
from api.http.service import Service
from rig.errors import UsageError

if TYPE_CHECKING:
    from fastapi.testclient import TestClient

ADDRESS = "http://127.0.0.1:8000"


def token(scope: Scope = Scope.ADMIN) -> str:
    """A token that services with this process' state folder know."""
    return _made(scope, os.environ.get("XDG_STATE_HOME", ""))


@functools.cache
def _made(scope: Scope, _folder: str) -> str:
    store = TokenStore(access_folder())
    made = store.create(f"test-{scope.word}-{secrets.token_hex(4)}", scope)
    atexit.register(_ended, store, made.token.id)
    return made.secret


def _ended(store: TokenStore, identifier: str) -> None:
    """A benchmark leaves no token in its user's own folder; a test's folder may be gone."""
    with contextlib.suppress(UsageError, OSError):
        store.revoke(identifier)


def bearer(scope: Scope = Scope.ADMIN) -> dict[str, str]:
    """The header that lets a request pass."""
    return {"Authorization": f"Bearer {token(scope)}"}


def client_of(service: Service, scope: Scope | None = Scope.ADMIN, base: str = ADDRESS) -> "TestClient":
    """A client on this computer with a token; ``scope`` None: without one."""
    from fastapi.testclient import TestClient  # noqa: PLC0415 - needs a library of developers, `service` does not

    headers = {} if scope is None else bearer(scope)
    found = TestClient(build(service), base_url=base, headers=headers, client=("127.0.0.1", 50_000))
    found.event_hooks["request"].append(_keyed)
    return found


def in_control(client: "TestClient", holder: str = "test") -> "TestClient":
    """The same client, which has taken control for half a minute."""
    taken = client.post("/api/v1/control/lease", json={"holder": holder, "ttl_s": 30.0})
    client.headers["X-Control-Lease"] = taken.json()["lease_id"]
    return client


def _keyed(request: Any) -> None:
    """Each request is to happen once, unless a test says which."""
    request.headers.setdefault("Idempotency-Key", secrets.token_hex(8))
