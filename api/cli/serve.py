"""`rig serve`: the HTTP service and its page over one bench."""

import asyncio
import contextlib
import os
import socket
import threading
from pathlib import Path
from typing import Annotated

import typer
import uvicorn

from api.cli.mock_bench import bench_for
from api.cli.options import ConfigOption, SetOption, wiring_from
from api.cli.output import show
from api.http.app import build
from api.http.connection import server_settings
from api.http.guard import LOCAL
from api.http.service import Service
from rig.errors import UsageError


class Announced(uvicorn.Server):
    """Prints its address once it listens and the bench has started, or has not been able to."""

    def __init__(self, config: uvicorn.Config, settled: threading.Event) -> None:
        super().__init__(config)
        self._settled = settled

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Starts, then says where."""
        await super().startup(sockets)
        await asyncio.to_thread(self._settled.wait)
        if self.started:
            show(f"http://{self.config.host}:{self.config.port}/")


def serve(
    config: ConfigOption = None,
    overrides: SetOption = None,
    port: Annotated[int, typer.Option(min=1, max=65535, help="TCP port to listen on.")] = 8000,
    host: Annotated[str, typer.Option(help="Address to listen on; only this computer's own.")] = "127.0.0.1",
    sessions: Annotated[Path, typer.Option(help="Folder of the sessions.")] = Path("sessions"),
    protocols: Annotated[Path, typer.Option(help="Folder of the protocols.")] = Path("examples"),
) -> None:
    """Serves the bench over HTTP, with a page at / and the interface described at /api/v1/openapi.json.

    Example: rig serve --config rig.toml --port 8000
    """
    if host not in LOCAL:
        raise UsageError(
            f"--host {host}: the service has no log-in yet, so it listens on this computer only: {LOCAL[0]}"
        )
    settings = wiring_from(config, overrides)
    with _listening(host, port) as listening, bench_for(settings, refuses=False) as (wiring, _):
        service = Service(wiring, sessions, protocols, f"http://{_in_url(host)}:{port}")
        application = build(service, meanwhile=True)
        # The server hands on the Ctrl-C that ended it, after an orderly end.
        with contextlib.suppress(KeyboardInterrupt):
            server = uvicorn.Config(application, host=host, port=port, **server_settings())
            Announced(server, service.settled).run([listening])


def _in_url(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _listening(host: str, port: int) -> socket.socket:
    """Taken before the bench starts, which homes the axis."""
    try:
        return socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except OSError as error:
        raise UsageError(
            f"--port {port}: {os.strerror(error.errno or 0)}; end what listens there, or give another port"
        ) from error
