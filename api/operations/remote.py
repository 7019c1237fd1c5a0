"""The service that uses the bench, asked over HTTP by another command on the same computer.

Through a socket in the user's state folder, which the service's own account alone can open and which asks for nothing;
or, where TISSUE_RIG_TOKEN holds a token, at its address.
"""

import http.client
import json
import os
import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar
from urllib.parse import urlsplit
from uuid import uuid4

from pydantic import BaseModel

from controller.claims import state_folder
from controller.loop.messages import DeviceView
from controller.recovery.situation import Consent
from rig.errors import DeviceError
from rig.results.bench import ResetResult

# A recovery homes and retracts before it answers.
ANSWER_S = 180.0
HOLDER = "rig reset"
LEASE_S = 30.0
TOKEN_VARIABLE = "TISSUE_RIG_TOKEN"
View = TypeVar("View", bound=BaseModel)


class LeaseTaken(BaseModel):
    """Of a lease, what this command needs; what else the service says is left aside, here as below."""

    lease_id: str = ""


class Link(BaseModel):
    """A ticket that logs a browser in."""

    ticket: str
    address: str = ""


class BenchSaid(BaseModel):
    """The bench as the service shows it."""

    state: str
    reason: str
    rates_Hz: dict[str, float]
    devices: dict[str, DeviceView]


class RemoteBench:
    """A running service; inside a ``with`` block it is under this command's control."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._lease = ""

    def __enter__(self) -> Self:
        self._lease = self._call(
            "POST", "/api/v1/control/lease", LeaseTaken, {"holder": HOLDER, "ttl_s": LEASE_S}
        ).lease_id
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._call("DELETE", "/api/v1/control/lease", LeaseTaken)
        except DeviceError:
            if error is None:
                raise

    def state(self) -> BenchSaid:
        """The bench as the service shows it."""
        return self._call("GET", "/api/v1/rig", BenchSaid)

    def recover(self, consent: Consent) -> ResetResult:
        """The service's own recovery."""
        return self._call("POST", "/api/v1/recover", ResetResult, asdict(consent))

    def link(self, name: str, scope: str) -> str:
        """An address that logs a browser in once."""
        found = self._call("POST", "/api/v1/auth/links", Link, {"name": name, "scope": scope})
        return f"{found.address or self.address}/#ticket={found.ticket}"

    def _call(self, method: str, path: str, kind: type[View], body: object = None) -> View:
        try:
            status, content = self._exchange(method, path, body)
            if status < http.client.BAD_REQUEST:
                return kind.model_validate_json(content)
        except (http.client.HTTPException, OSError, ValueError) as error:
            raise DeviceError(
                f"the service at {self.address} uses the bench and does not answer ({error}); end it, then try again"
            ) from error
        raise DeviceError(f"the service at {self.address} refuses: {_detail(content, status)}")

    def _exchange(self, method: str, path: str, body: object) -> tuple[int, bytes]:
        data = None if body is None else json.dumps(body).encode()
        headers = {"Content-Type": "application/json", "X-Control-Lease": self._lease, "Idempotency-Key": uuid4().hex}
        with closing(_connection(self.address, headers)) as connection:
            connection.request(method, path, data, headers)
            reply = connection.getresponse()
            return reply.status, reply.read()


def _connection(address: str, headers: dict[str, str]) -> http.client.HTTPConnection:
    """To the service at ``address``; ``headers`` gets the token where one is used."""
    token = os.environ.get(TOKEN_VARIABLE)
    if not token and socket_path(address).exists():
        return OwnSocket(socket_path(address))
    if token:
        headers["Authorization"] = f"Bearer {token}"
    parts = urlsplit(address)
    kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
    return kind(parts.hostname or "", parts.port, timeout=ANSWER_S)


def socket_path(address: str) -> Path:
    """Where the service at ``address`` takes what its own account asks."""
    return state_folder() / f"service-{urlsplit(address).port}.sock"


class OwnSocket(http.client.HTTPConnection):
    """HTTP over the socket at ``path``."""

    def __init__(self, path: Path) -> None:
        super().__init__("localhost", timeout=ANSWER_S)
        self._path = path

    def connect(self) -> None:
        """By the folder's descriptor: a socket's own name has at most 107 letters."""
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(self.timeout)
        with folder_name(self._path.parent) as folder:
            self.sock.connect(f"{folder}/{self._path.name}")


@contextmanager
def folder_name(folder: Path) -> Iterator[str]:
    """A short name of ``folder``, however deep it is."""
    fd = os.open(folder, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{fd}"
    finally:
        os.close(fd)


def _detail(content: bytes, status: int) -> str:
    try:
        return str(json.loads(content)["detail"])
    except (ValueError, KeyError, TypeError):
        return f"HTTP {status}"
