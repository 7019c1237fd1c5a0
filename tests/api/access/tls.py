"""Certificates for tests, and the service on a free port as `rig serve` starts it."""

import contextlib
import http.client
import json
import socket
import ssl
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import trustme

from api.cli.serve import Announced, configured, own_socket
from api.http.access.served_at import ServedAt
from api.http.app import build
from api.http.service import Service
from api.operations.remote import socket_path


class Files(NamedTuple):
    """A certificate and its key, and what trusts it."""

    certificate: Path
    key: Path
    trusting: ssl.SSLContext


def made(folder: Path, *names: str) -> Files:
    """For ``names``, by an authority of its own."""
    authority = trustme.CA()
    issued = authority.issue_cert(*names)
    files = Files(folder / "cert.pem", folder / "key.pem", ssl.create_default_context())
    for number, part in enumerate(issued.cert_chain_pems):
        part.write_to_path(files.certificate, append=number > 0)
    files.key.touch(mode=0o600)
    issued.private_key_pem.write_to_path(files.key)
    authority.configure_trust(files.trusting)
    return files


@contextlib.contextmanager
def serving(service: Service, place: ServedAt) -> Iterator[ServedAt]:
    """The service at ``place`` on a free port, without a bench, and at its own socket."""
    with socket.create_server((place.host, 0)) as listening:
        found = replace(place, port=listening.getsockname()[1])
        service.address, service.access.address = found.here, found.address
        service.settled.set()
        with own_socket(socket_path(found.here)) as own:
            config = configured(build(service, names=found.names), found)
            config.lifespan = "off"
            server = Announced(config, service, own, found)
            thread = threading.Thread(target=server.run, args=([listening],))
            thread.start()
            while len(getattr(server, "servers", ())) < 2:
                time.sleep(0.01)
            try:
                yield found
            finally:
                server.should_exit = True
                thread.join()


class Answer(NamedTuple):
    """What came of one request."""

    status: int
    headers: Mapping[str, str]
    said: Any

    @property
    def code(self) -> str:
        """Of a problem."""
        return str(self.said["code"])


def ask(connection: http.client.HTTPConnection, method: str, path: str, body: object = None, **headers: str) -> Answer:
    """One request on ``connection``, which is closed after it; words of headers are joined by underscores here."""
    sent = {"Content-Type": "application/json"} | {name.replace("_", "-"): value for name, value in headers.items()}
    with contextlib.closing(connection):
        connection.request(method, path, None if body is None else json.dumps(body), sent)
        answer = connection.getresponse()
        return Answer(answer.status, dict(answer.getheaders()), json.loads(answer.read()))
