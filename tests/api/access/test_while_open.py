"""A right that ends while a connection is open ends that connection: a token is revoked, a person logs out."""

import contextlib
import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError
from pathlib import Path
from typing import NamedTuple

import pytest
from starlette.websockets import WebSocketDisconnect

from api.http.access.access import Access, cookie_name
from api.http.access.scopes import Caller, Scope
from api.http.service import Service
from api.http.streams import socket, sse
from mock_devices.testing.access import ADDRESS, client_of
from rig.config.products.bota_sensone import BotaWiring
from rig.config.wiring import Wiring

PERIOD_S = 0.05
STREAM = f"{ADDRESS.replace('http', 'ws')}/api/v1/stream"


class Credential(NamedTuple):
    """What lets a request pass, until it is ended."""

    headers: dict[str, str]
    end: Callable[[], object]


def token(service: Service) -> Credential:
    made = service.access.tokens.create("looks on", Scope.READ)
    headers = {"Authorization": f"Bearer {made.secret}"}
    return Credential(headers, lambda: service.access.tokens.revoke(made.token.id))


def login(service: Service) -> Credential:
    _, secret = service.access.logins.enter(Caller("Ann", Scope.READ, "", "link"))
    headers = {"Cookie": f"{cookie_name(8000)}={secret}", "Origin": ADDRESS}
    return Credential(headers, lambda: service.access.logins.browsers.drop(lambda _: True))


@pytest.fixture
def service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Service:
    made = Service(Wiring(force=BotaWiring(port="/dev/no-such-sensor")), tmp_path, tmp_path)
    made.access = Access(tmp_path / "access")
    monkeypatch.setattr(made, "connect", lambda: None)
    for module in (socket, sse):
        monkeypatch.setattr(module, "RECHECK_S", PERIOD_S)
    return made


@pytest.mark.timeout(60)
@pytest.mark.parametrize("held", [token, login])
def test_a_websocket_stays_open_for_as_long_as_the_right_lasts(
    service: Service, held: Callable[[Service], Credential]
) -> None:
    credential, client = held(service), client_of(service, scope=None)
    # The client cancels a route that may just have ended by itself.
    with (
        contextlib.suppress(CancelledError),
        client.websocket_connect(STREAM, ["rig.v1"], headers=credential.headers) as opened,
    ):
        assert opened.receive_json()["type"] == "hello"
        time.sleep(4 * PERIOD_S)
        opened.send_json({"type": "ping", "id": 1})
        assert opened.receive_json()["type"] == "pong"
        credential.end()
        with pytest.raises(WebSocketDisconnect) as closed:
            opened.receive_json()
        assert (closed.value.code, closed.value.reason) == (1008, socket.RIGHT_ENDED)


@pytest.mark.timeout(60)
@pytest.mark.parametrize("held", [token, login])
def test_events_end_with_the_right(service: Service, held: Callable[[Service], Credential]) -> None:
    credential = held(service)
    with client_of(service, scope=None) as client:
        began_s = time.monotonic()
        threading.Timer(0.5, credential.end).start()
        answer = client.get("/api/v1/events", headers=credential.headers)  # which comes once the stream has ended
        assert answer.status_code == 200 and answer.text.startswith("retry:")
        assert 0.4 < time.monotonic() - began_s < 20


def test_whose_right_cannot_be_looked_up_looks_on_no_longer(service: Service) -> None:
    credential, client = token(service), client_of(service, scope=None)
    with (
        contextlib.suppress(CancelledError),
        client.websocket_connect(STREAM, ["rig.v1"], headers=credential.headers) as opened,
    ):
        assert opened.receive_json()["type"] == "hello"
        file = service.access.folder / "tokens.json"
        file.chmod(0o644)
        os.utime(file)
        with pytest.raises(WebSocketDisconnect) as closed:
            opened.receive_json()
        assert closed.value.code == 1008
