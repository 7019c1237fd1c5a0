"""`rig serve`: the HTTP service and its page over one bench."""

import asyncio
import contextlib
import errno
import gc
import os
import socket
import ssl
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer
import uvicorn
from fastapi import FastAPI

from api.cli.mock_bench import bench_for
from api.cli.mock_calibration import done_by_mock
from api.cli.options import ConfigOption, SetOption, protocols_here, wiring_from
from api.cli.output import show
from api.http.access.access import owner_name
from api.http.access.arrived import LOOPBACK
from api.http.access.served_at import ServedAt, ServeOptions, served_at
from api.http.app import build
from api.http.connection import ImpatientProtocol, server_settings
from api.http.priority import NICE, go_at, lead
from api.http.service import Service
from api.http.stops.process import AwayStops
from api.http.streams.bridge import bridged
from api.operations.remote import folder_name, socket_path
from controller.loop.realtime import switch_promptly
from controller.stop.http import LOCAL
from rig.config.wiring import Wiring
from rig.errors import UsageError

FoxgloveOption = Annotated[
    int | None,
    typer.Option(
        min=1, max=65535, help="TCP port for Foxglove on this computer, as 8765; whoever is on it may look on."
    ),
]


NameOption = Annotated[
    list[str] | None, typer.Option("--name", help="Name by which the service is reached beside its address.")
]
CertificateOption = Annotated[
    Path | None, typer.Option("--tls-cert", help="Certificate with its chain, PEM; for any --host but this computer.")
]
KeyOption = Annotated[Path | None, typer.Option("--tls-key", help="Private key of the certificate, PEM.")]
ProxyOption = Annotated[
    str, typer.Option("--behind-proxy", help="What people open, as https://NAME, where a reverse proxy is before it.")
]
StopPortOption = Annotated[
    int | None,
    typer.Option(min=1, max=65535, help="TCP port for stops from other computers; two above --port if left out."),
]
ProtocolsOption = Annotated[
    Path | None, typer.Option(help="Folder of the protocols; else ./examples, else those that come with the program.")
]
# What answers gives the interpreter away with each piece it sends, and waits so long for it beside a list that is read:
# with half a millisecond, fifty clients and a list a stop took 40 to 90 ms.
SWITCH_S = 50e-6
HANDSHAKE_S = 5.0  # as long as a request's head has


class Announced(uvicorn.Server):
    """Listens to its own account through ``own`` too, and prints its address once the bench has started, or could not.

    The address logs in once, for five minutes: whoever started the service needs no password for it.
    """

    def __init__(self, config: uvicorn.Config, service: Service, own: socket.socket, place: ServedAt) -> None:
        super().__init__(config)
        self._service, self._own, self._place = service, own, place

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Starts, then says where."""
        await super().startup([])
        for listening in sockets or ():
            await self._listen(listening, self._place.tls)
        await self._listen(self._own, None)
        await asyncio.to_thread(self._service.settled.wait)
        _answer_promptly()
        if self.started:
            show(f"{self._place.address}/#ticket={self._service.access.logins.ticket(owner_name())}")

    async def _listen(self, listening: socket.socket, tls: ssl.SSLContext | None) -> None:
        """A client that begins TLS and does not go on keeps no connection."""
        within_s = HANDSHAKE_S if tls else None
        loop = asyncio.get_running_loop()
        self.servers.append(
            await loop.create_server(
                self._protocol, sock=listening, backlog=self.config.backlog, ssl=tls, ssl_handshake_timeout=within_s,
                ssl_shutdown_timeout=within_s,
            )
        )  # fmt: skip

    def _protocol(self) -> asyncio.Protocol:
        return ImpatientProtocol(self.config, self.server_state, self.lifespan.state)


def _answer_promptly() -> None:
    """No answer, and no stop among them, waits for a look through all that was loaded (0.3 s), or long for a thread."""
    gc.collect()
    gc.freeze()
    switch_promptly(SWITCH_S)
    go_at(NICE)
    lead()


def serve(
    config: ConfigOption = None,
    overrides: SetOption = None,
    port: Annotated[int, typer.Option(min=1, max=65535, help="TCP port to listen on.")] = 8000,
    host: Annotated[str, typer.Option(help="Address to listen on; others than this computer's need TLS.")] = LOCAL[0],
    sessions: Annotated[Path, typer.Option(help="Folder of the sessions.")] = Path("sessions"),
    protocols: ProtocolsOption = None,
    foxglove: FoxgloveOption = None,
    name: NameOption = None,
    tls_cert: CertificateOption = None,
    tls_key: KeyOption = None,
    behind_proxy: ProxyOption = "",
    stop_port: StopPortOption = None,
) -> None:
    """Serves the bench over HTTP, with a page at / and the interface described at /api/v1/openapi.json.

    Example: rig serve --config rig.toml --port 8000
    """
    place = served_at(ServeOptions(host, port, tuple(name or ()), tls_cert, tls_key, behind_proxy, stop_port))
    run_service(wiring_from(config, overrides), place, sessions, protocols or protocols_here(), foxglove)


def run_service(
    settings: Wiring, place: ServedAt, sessions: Path, protocols: Path, foxglove: int | None = None
) -> None:
    """Serves until Ctrl-C, and ends in order."""
    with (
        contextlib.ExitStack() as beside,
        listening_at(place.host, place.port) as listening,
        _away(place) as away,
        own_socket(socket_path(place.here)) as own,
        bench_for(settings, refuses=False) as (wiring, endpoints),
    ):
        service = Service(wiring, sessions, protocols, place.here)
        if endpoints:
            service.hands, service.works = endpoints.control, done_by_mock(settings)
        service.access.address = place.address
        if away:
            service.away = away
            beside.enter_context(away.running(service.access, service.events))
        application = build(service, meanwhile=True, names=place.names)
        # The server hands on the Ctrl-C that ended it, after an orderly end.
        with contextlib.suppress(KeyboardInterrupt), bridged(foxglove, service.id) as bridges:
            service.onlookers += [bridge.hand_on for bridge in bridges]
            Announced(configured(application, place), service, own, place).run([listening])


def _away(place: ServedAt) -> contextlib.AbstractContextManager[AwayStops | None]:
    """What takes stops from other computers, where any may use the service."""
    if place.alone:
        return contextlib.nullcontext()
    beside = place.tls and place.host not in (*LOCAL, "0.0.0.0")
    hosts = (place.host, LOCAL[0]) if beside else (place.host,)
    listeners = [listening_at(host, place.stop_port, "--stop-port") for host in hosts]
    return contextlib.closing(AwayStops(place, listeners))


def refuse_taken(port: int) -> None:
    """Raises UsageError, before anything else is done, where something listens there on this computer."""
    listening_at(LOCAL[0], port).close()


def serve_here(settings: Wiring, sessions: Path, protocols: Path, port: int) -> None:
    """The same for this computer alone."""
    run_service(settings, served_at(ServeOptions(LOCAL[0], port, (), None, None, "")), sessions, protocols)


def configured(application: FastAPI, place: ServedAt) -> uvicorn.Config:
    """Who asks is taken from a proxy's headers only where one was declared, and it is on this computer."""
    return uvicorn.Config(
        application, host=place.host, port=place.port, proxy_headers=bool(place.proxy),
        forwarded_allow_ips=list(LOOPBACK), **server_settings(),
    )  # fmt: skip


def listening_at(host: str, port: int, option: str = "--port") -> socket.socket:
    """A port that is taken before the bench starts, which homes the axis; raises UsageError where it cannot be."""
    try:
        listening = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
        # Head and body of an answer leave by themselves: else the body waits 40 ms for the client's acknowledgement.
        listening.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return listening
    except OSError as error:
        # Below zero are those of looking up a name (EAI_NONAME, netdb.h).
        if (error.errno or 0) < 0 or error.errno == errno.EADDRNOTAVAIL:
            raise UsageError(f"--host {host}: is no address of this computer; `ip address` lists them") from error
        raise UsageError(
            f"{option} {port}: {os.strerror(error.errno or 0)}; end what listens there, or give another port"
        ) from error


@contextlib.contextmanager
def own_socket(path: Path) -> Iterator[socket.socket]:
    """Where the command line asks: this account alone may open it. What a service that was killed left is replaced.

    The TCP port of its name is this process' by now, so no other service listens there.
    """
    path.unlink(missing_ok=True)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as own:
        before = os.umask(0o177)
        try:
            with folder_name(path.parent) as folder:
                own.bind(f"{folder}/{path.name}")
        finally:
            os.umask(before)
        own.listen()
        try:
            yield own
        finally:
            path.unlink(missing_ok=True)
