"""The service with a certificate of its own, and behind a reverse proxy: over real sockets."""

import contextlib
import http.client
import json
import socket
import ssl
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from websockets.client import ClientProtocol
from websockets.protocol import State
from websockets.sync.client import connect
from websockets.typing import Subprotocol
from websockets.uri import parse_uri

from api.http.access.limits import UNKNOWN, RateLimits
from api.http.access.scopes import Scope
from api.http.access.served_at import ServedAt, ServeOptions, served_at
from api.http.connection import ImpatientProtocol
from api.http.service import Service
from api.operations.remote import RemoteBench
from mock_devices.testing.access import bearer, token
from mock_devices.testing.clock import Clock
from rig.config.wiring import Wiring
from tests.api.access.tls import Answer, Files, ask, made, serving

NAME = "bench.example.org"
PROXY = f"https://{NAME}"


@pytest.fixture
def service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Service:
    monkeypatch.delenv("TISSUE_RIG_TOKEN", raising=False)
    return Service(Wiring(), tmp_path, tmp_path)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return made(tmp_path_factory.mktemp("tls"), NAME, "127.0.0.1")


@pytest.fixture
def encrypted(service: Service, files: Files) -> Iterator[ServedAt]:
    with serving(service, served_at(ServeOptions("0.0.0.0", 1, (NAME,), files.certificate, files.key, ""))) as place:
        yield place


@pytest.fixture
def proxied(service: Service) -> Iterator[ServedAt]:
    with serving(service, served_at(ServeOptions("127.0.0.1", 1, (), None, None, PROXY))) as place:
        yield place


def secure(place: ServedAt, files: Files) -> http.client.HTTPSConnection:
    return http.client.HTTPSConnection("127.0.0.1", place.port, context=files.trusting, timeout=20)


def passed_on(place: ServedAt, method: str, path: str, body: object = None, **more: str) -> Answer:
    """As a reverse proxy passes a request on that somebody at 192.0.2.7 has sent."""
    said = {"Host": NAME, "X_Forwarded_For": "192.0.2.7", "X_Forwarded_Proto": "https"} | more
    return ask(http.client.HTTPConnection("127.0.0.1", place.port, timeout=20), method, path, body, **said)


def test_programs_are_served_under_the_certificate_and_nothing_without(encrypted: ServedAt, files: Files) -> None:
    own = f"{NAME}:{encrypted.port}"
    served = ask(secure(encrypted, files), "GET", "/api/v1/rig", Host=own, **bearer())
    assert (served.status, served.said["state"]) == (200, "disconnected")
    plain = http.client.HTTPConnection("127.0.0.1", encrypted.port, timeout=20)
    with pytest.raises((http.client.HTTPException, OSError)), contextlib.closing(plain):
        plain.request("GET", "/api/v1/info")
        plain.getresponse()


def test_of_its_names_it_knows_those_it_was_told_and_its_numbers(encrypted: ServedAt, files: Files) -> None:
    for host, status in ((NAME, 200), ("127.0.0.1", 200), ("evil.example", 403), ("", 403)):
        said = ask(secure(encrypted, files), "GET", "/api/v1/info", Host=f"{host}:{encrypted.port}")
        assert said.status == status, host


def test_a_cookie_is_for_encrypted_pages_and_only_they_may_act(
    encrypted: ServedAt, service: Service, files: Files
) -> None:
    own, ticket = f"{NAME}:{encrypted.port}", service.access.logins.ticket("Ann")
    entered = ask(secure(encrypted, files), "POST", "/api/v1/auth/ticket", {"ticket": ticket}, Host=own)
    cookie, *attributes = entered.headers["set-cookie"].split("; ")
    assert {"Secure", "HttpOnly", "SameSite=strict"} <= set(attributes)
    for origin, status in ((f"https://{own}", 200), (f"http://{own}", 403), (f"https://{NAME}", 403)):
        said = ask(
            secure(encrypted, files), "POST", "/api/v1/auth/links", {"name": "Ben"},
            Host=own, Cookie=cookie, Origin=origin,
        )  # fmt: skip
        assert said.status == status, origin


def test_a_stream_goes_over_it(encrypted: ServedAt, files: Files) -> None:
    offered = ["rig.v1", f"rig.token.{token(Scope.READ)}"]
    address = f"wss://127.0.0.1:{encrypted.port}/api/v1/stream"
    with connect(address, ssl=files.trusting, subprotocols=offered, compression=None) as stream:  # type: ignore[arg-type]
        assert json.loads(stream.recv())["type"] == "hello"


def test_nothing_but_answers_comes_after_the_handshake(encrypted: ServedAt, files: Files) -> None:
    asking = secure(encrypted, files)
    asking.connect()
    with asking.sock as over:
        asking.request("GET", "/api/v1/info", headers={"Host": f"{NAME}:{encrypted.port}"})
        assert over.recv(15) == b"HTTP/1.1 200 OK"
        assert over.version() == "TLSv1.3" and over.session and not over.session.has_ticket


def exchange(client: ssl.SSLSocket, page: ClientProtocol, until: Callable[[], bool]) -> None:
    """What ``page`` says and hears."""
    while not until():
        client.sendall(b"".join(page.data_to_send()))
        page.receive_data(client.recv(65_536))


def test_a_page_that_is_just_leaving_does_not_break_the_orderly_end(service: Service, files: Files) -> None:
    place = served_at(ServeOptions("127.0.0.1", 1, (), files.certificate, files.key, ""))
    offered = [Subprotocol("rig.v1"), Subprotocol(f"rig.token.{token(Scope.READ)}")]
    with contextlib.ExitStack() as leaving, serving(service, place) as served:
        connecting = socket.create_connection(("127.0.0.1", served.port), 20)
        client = leaving.enter_context(files.trusting.wrap_socket(connecting, server_hostname="127.0.0.1"))
        page = ClientProtocol(parse_uri(f"wss://127.0.0.1:{served.port}/api/v1/stream"), subprotocols=offered)
        page.send_request(page.connect())
        exchange(client, page, lambda: page.state is State.OPEN)
        page.send_close(1001)
        exchange(client, page, lambda: page.close_rcvd is not None)


def test_older_protocols_are_refused(encrypted: ServedAt) -> None:
    old = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    old.check_hostname, old.verify_mode = False, ssl.CERT_NONE
    with pytest.warns(DeprecationWarning):
        old.minimum_version = old.maximum_version = ssl.TLSVersion.TLSv1_1
    with pytest.raises((ssl.SSLError, OSError)), socket.create_connection(("127.0.0.1", encrypted.port), 20) as client:
        old.wrap_socket(client)


def test_who_begins_and_does_not_go_on_keeps_no_connection(
    service: Service, files: Files, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("api.cli.serve.HANDSHAKE_S", 1.5)  # the second one has to end its own on a busy computer
    monkeypatch.setattr(ImpatientProtocol, "head_s", 0.3)
    with serving(service, served_at(ServeOptions("127.0.0.1", 1, (), files.certificate, files.key, ""))) as place:
        began_s = time.monotonic()
        with socket.create_connection(("127.0.0.1", place.port), 20) as silent:
            assert silent.recv(1) == b""
        connecting = socket.create_connection(("127.0.0.1", place.port), 20)
        with connecting, files.trusting.wrap_socket(connecting, server_hostname="127.0.0.1") as nothing:
            nothing.settimeout(20)
            with contextlib.suppress(ConnectionError):
                assert nothing.recv(1) == b""
        assert time.monotonic() - began_s < 10


def test_the_command_line_beside_it_uses_its_socket_and_links_to_what_people_open(encrypted: ServedAt) -> None:
    link = RemoteBench(encrypted.here).link("Ann", "read")
    assert link.startswith(f"https://{NAME}:{encrypted.port}/#ticket=")
    # `rig token link` knows the port alone.
    assert RemoteBench(f"http://127.0.0.1:{encrypted.port}").link("Ann", "read").startswith(f"https://{NAME}:")


def test_behind_a_proxy_the_page_logs_in_and_acts_as_from_its_own_address(proxied: ServedAt, service: Service) -> None:
    entered = passed_on(proxied, "POST", "/api/v1/auth/ticket", {"ticket": service.access.logins.ticket("Ann")})
    cookie, *attributes = entered.headers["set-cookie"].split("; ")
    assert {"Secure", "HttpOnly", "SameSite=strict"} <= set(attributes)
    for origin, status in ((PROXY, 200), (f"http://{NAME}", 403), ("https://evil.example", 403)):
        said = passed_on(proxied, "POST", "/api/v1/auth/links", {"name": "Ben"}, Cookie=cookie, Origin=origin)
        assert said.status == status, origin
    assert RemoteBench(proxied.here).link("Ann", "read").startswith(f"{PROXY}/#ticket=")


def test_behind_a_proxy_a_stop_needs_a_right_and_on_this_computer_none(proxied: ServedAt) -> None:
    refused = passed_on(proxied, "POST", "/api/v1/estop")
    assert (refused.status, refused.code) == (401, "no-credential")
    assert passed_on(proxied, "POST", "/api/v1/estop", **bearer(Scope.READ)).code == "disconnected"
    beside = http.client.HTTPConnection("127.0.0.1", proxied.port, timeout=20)
    assert ask(beside, "POST", "/api/v1/estop").code == "disconnected"


def taken(place: ServedAt, client: str) -> list[int]:
    """What somebody is answered who asks once more than a stranger may."""
    asked = [
        passed_on(place, "GET", "/api/v1/info", Host="127.0.0.1", X_Forwarded_For=client).status
        for _ in range(int(UNKNOWN.burst) + 1)
    ]
    return sorted({*asked})


def test_a_proxy_that_is_declared_says_who_asks_and_one_that_is_not_is_not_believed(
    proxied: ServedAt, service: Service
) -> None:
    service.access.limits = RateLimits(Clock().seconds)
    assert taken(proxied, "192.0.2.7") == [200, 429]
    assert passed_on(proxied, "GET", "/api/v1/info", X_Forwarded_For="192.0.2.8").status == 200
    with serving(service, served_at(ServeOptions("127.0.0.1", 1, (), None, None, ""))) as undeclared:
        assert taken(undeclared, "192.0.2.9") == [200, 429]
        refused = passed_on(undeclared, "GET", "/api/v1/info", Host="127.0.0.1", X_Forwarded_For="192.0.2.10")
        assert refused.status == 429
