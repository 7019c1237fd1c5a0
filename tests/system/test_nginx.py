"""The service behind nginx, by the file that the deployment guide gives: whatever must pass through it does."""

import contextlib
import http.client
import json
import re
import shutil
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from api.http.access.scopes import Scope
from mock_devices.testing.access import bearer, token
from mock_devices.testing.commands import ROOT, ServedBench, free_port, until
from mock_devices.testing.service import ServedRig
from tests.api.access.tls import Answer, Files, ask, made
from tests.lacking import lacking
from tests.system.presses import SLOW, press

# Where `make nginx` puts it, unless the computer has one.
PROGRAM = shutil.which("nginx") or shutil.which("nginx", path=str(Path(sys.executable).parent))
pytestmark = [pytest.mark.extra, pytest.mark.xdist_group("commands")]
NAME = "bench.example.org"
STREAM = "/api/v1/stream"


class Proxied:
    """A service and the port at which nginx has it; requests are those of somebody elsewhere."""

    def __init__(self, rig: ServedRig, port: int, files: Files) -> None:
        self.rig, self.port, self.files = rig, port, files

    @property
    def origin(self) -> str:
        """Of the page."""
        return f"https://{NAME}:{self.port}"

    def ask(self, method: str, path: str, body: object = None, **headers: str) -> Answer:
        """One request."""
        connection = http.client.HTTPSConnection("127.0.0.1", self.port, context=self.files.trusting, timeout=20)
        return ask(connection, method, path, body, **{"Host": f"{NAME}:{self.port}"} | headers)


def configured(files: Files, folder: Path, port: int, service: int, stops: int) -> str:
    """The guide's file, with this computer's certificate and ports, in what nginx needs around it."""
    site = (ROOT / "examples" / "deploy" / "nginx.conf").read_text()
    for before, now in (
        ("listen 443 ssl", f"listen 127.0.0.1:{port} ssl"),
        (f"/etc/ssl/certs/{NAME}.pem", str(files.certificate)),
        (f"/etc/ssl/private/{NAME}.key", str(files.key)),
        ("127.0.0.1:8000", f"127.0.0.1:{service}"),
        ("127.0.0.1:8002", f"127.0.0.1:{stops}"),
    ):
        assert site.count(before) == 1, before
        site = site.replace(before, now)
    kept = "".join(f"{part}_temp_path {folder};\n" for part in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
    return f"daemon off;\npid {folder}/pid;\nerror_log stderr;\nevents {{}}\nhttp {{\naccess_log off;\n{kept}{site}}}\n"


@contextlib.contextmanager
def nginx(text: str, folder: Path, port: int) -> Iterator[None]:
    """nginx with that file, once it listens."""
    (folder / "nginx.conf").write_text(text)
    assert PROGRAM
    process = subprocess.Popen([PROGRAM, "-p", folder, "-c", folder / "nginx.conf"], stderr=subprocess.PIPE, text=True)
    try:
        until(lambda: process.poll() is not None or listens(port), 20, "nginx listening")
        assert process.poll() is None, process.communicate()[1]
        yield
    finally:
        process.terminate()
        process.communicate(timeout=20)


def listens(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
        return True
    return False


def ports_but_one() -> tuple[int, int]:
    """Two that are free; the first that is free stays so for the service."""
    with socket.create_server(("127.0.0.1", free_port())):
        stops = free_port()
        with socket.create_server(("127.0.0.1", stops)):
            return stops, free_port()


@pytest.fixture
def proxied(bench: ServedBench, tmp_path: Path) -> Iterator[Proxied]:
    if PROGRAM is None:
        lacking("no nginx here: `make nginx` fetches it")
    (tmp_path / "protocols").mkdir()
    (tmp_path / "protocols" / "slow.toml").write_text(SLOW)
    stops, port = ports_but_one()
    arguments: list[str | Path] = ["--protocols", tmp_path / "protocols", "--behind-proxy", f"https://{NAME}:{port}"]
    rig = ServedRig(bench, tmp_path, [*arguments, "--stop-port", str(stops), *bench.settings("stop.port=0")])
    found = Proxied(rig, port, made(tmp_path, NAME, "127.0.0.1"))
    try:
        with nginx(configured(found.files, tmp_path, port, rig.port, stops), tmp_path, port):
            yield found
    finally:
        rig.running.process.terminate()
        rig.running.end()


def first_samples(proxied: Proxied) -> bytes:
    """The first batch of the stream; raises what the handshake was refused by."""
    offered = ["rig.v1", f"rig.token.{token(Scope.READ)}"]
    there = socket.create_connection(("127.0.0.1", proxied.port), 20)
    with connect(
        f"wss://{NAME}:{proxied.port}{STREAM}", sock=there, ssl=proxied.files.trusting, subprotocols=offered,  # type: ignore[arg-type]
        compression=None,
    ) as stream:  # fmt: skip
        stream.send(json.dumps({"type": "subscribe", "streams": ["force"], "max_rate_hz": 30.0}))
        while isinstance(said := stream.recv(20), str):
            pass
        return said


def taking_control(at: Proxied, origin: str) -> int:
    """The status of a page's own request, once its browser was logged in by a link."""
    page = {"Host": origin.removeprefix("https://")} if NAME in origin else {}
    link = at.ask("POST", "/api/v1/auth/links", {"name": "Ann"}, **bearer()).said
    assert link["address"].startswith(f"https://{NAME}:")
    entered = at.ask("POST", "/api/v1/auth/ticket", {"ticket": link["ticket"]}, **page)
    cookie, *attributes = entered.headers["set-cookie"].split("; ")
    assert (entered.status, {"Secure", "HttpOnly", "SameSite=strict"} <= set(attributes)) == (200, True)
    wanted = {"holder": "Ann", "ttl_s": 30.0}
    return at.ask("POST", "/api/v1/control/lease", wanted, **page, Cookie=cookie, Origin=origin).status


def test_requests_logins_streams_and_stops_of_others_come_through(proxied: Proxied) -> None:
    assert proxied.ask("GET", "/api/v1/rig").status == 401
    assert proxied.ask("GET", "/api/v1/rig", **bearer(Scope.READ)).said["state"] == "idle"
    assert proxied.ask("GET", "/api/v1/rig", **bearer() | {"Host": "evil.example"}).status == 403
    assert [taking_control(proxied, of) for of in ("https://evil.example", proxied.origin)] == [403, 200]
    assert len(first_samples(proxied)) > 24, "the head of a batch, and what follows it"


def test_a_stop_goes_past_a_service_that_hangs(proxied: Proxied) -> None:
    press(proxied.rig)
    proxied.rig.running.process.send_signal(signal.SIGSTOP)
    try:
        assert proxied.ask("POST", "/stops/estop").status == 401
        stopped = proxied.ask("POST", "/stops/estop", **bearer(Scope.READ))
    finally:
        proxied.rig.running.process.send_signal(signal.SIGCONT)
    assert (stopped.status, stopped.said["confirmed"]) == (200, True)


@pytest.mark.parametrize("lacking", ["Host", "Upgrade"])
def test_what_a_file_lacks_is_seen(proxied: Proxied, tmp_path: Path, lacking: str) -> None:
    text = (tmp_path / "nginx.conf").read_text()
    port = free_port()
    text = re.sub(rf"proxy_set_header {lacking} [^;]*;", "", text).replace(f":{proxied.port} ", f":{port} ")
    (tmp_path / "other").mkdir()
    other = Proxied(proxied.rig, port, proxied.files)
    with nginx(text.replace(f"pid {tmp_path}/pid", f"pid {tmp_path}/other/pid"), tmp_path / "other", port):
        if lacking == "Host":
            assert [taking_control(at, proxied.origin) for at in (proxied, other)] == [200, 403]
        else:
            with pytest.raises(InvalidStatus):
                first_samples(other)
