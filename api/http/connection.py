"""HTTP connections that end by themselves where the other side does not read or write: a slow client keeps nothing."""

import asyncio
import socket
import struct
from typing import ClassVar, TypedDict

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.exceptions import InvalidState

from api.http.streams.messages import LARGEST_MESSAGE_BYTES

NO_LINGER = struct.pack("ii", 1, 0)
# A second of all streams: what the system keeps for a client that reads slowly is old before it comes.
SOCKET_BYTES = 65_536
# What other servers take at most (nginx 32 kB, h11 64 kB); cookies and addresses of ours have a hundredth of it.
LARGEST_HEAD_BYTES = 65_536


class ImpatientProtocol(HttpToolsProtocol):
    """Uvicorn's own protocol with two deadlines: for a request's head to come, and for what is sent to be read."""

    # A request's head is one packet; a client on this computer sends it in one go.
    head_s: ClassVar = 5.0
    # A page that shows live values reads twenty times a second; one that has not read for this long has been left.
    read_s: ClassVar = 5.0
    _head_bytes = 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Starts the first deadline."""
        self._deadlines: dict[str, asyncio.TimerHandle] = {}
        super().connection_made(transport)
        self._expect("head", self.head_s)

    def data_received(self, data: bytes) -> None:
        """A head that comes in parts has the same deadline, whether it is the first of a connection or not."""
        super().data_received(data)
        between = self.cycle is None or self.cycle.response_complete
        if between and self.transport.get_protocol() is self:
            self._expect("head", self.head_s)
            self._head_bytes += len(data)
            if self._head_bytes > LARGEST_HEAD_BYTES:
                self._drop()

    def on_headers_complete(self) -> None:
        """The whole head is there."""
        self._head_bytes = 0
        self._came("head")
        super().on_headers_complete()

    def pause_writing(self) -> None:
        """The client has stopped reading."""
        super().pause_writing()
        self._expect("reading", self.read_s)

    def resume_writing(self) -> None:
        """It reads again."""
        self._came("reading")
        super().resume_writing()

    def connection_lost(self, exc: Exception | None) -> None:
        """Ends both deadlines."""
        self._came("head")
        self._came("reading")
        super().connection_lost(exc)

    def handle_websocket_upgrade(self) -> None:
        """From now on the deadlines of a WebSocket hold, see `server_settings`."""
        self.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SOCKET_BYTES)
        self.transport.set_write_buffer_limits(high=SOCKET_BYTES)
        super().handle_websocket_upgrade()

    def _expect(self, what: str, within_s: float) -> None:
        if what not in self._deadlines:
            self._deadlines[what] = self.loop.call_later(within_s, self._drop)

    def _came(self, what: str) -> None:
        if what in self._deadlines:
            self._deadlines.pop(what).cancel()

    def _drop(self) -> None:
        """At once: what the system still holds for a client that does not read is thrown away too."""
        self.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, NO_LINGER)
        self.transport.abort()


class LeavingProtocol(WebSocketsSansIOProtocol):
    """Uvicorn's own, whose end raises where the client is just leaving, and leaves the rest of the service running."""

    def shutdown(self) -> None:
        """The service ends."""
        try:
            super().shutdown()
        except InvalidState:  # both have said good-bye
            self.transport.close()


class ServerSettings(TypedDict):
    """Keywords of `uvicorn.Config`."""

    http: type[ImpatientProtocol]
    ws: type[LeavingProtocol]
    timeout_keep_alive: int
    backlog: int
    log_level: str
    ws_max_size: int
    ws_ping_timeout: float
    ws_per_message_deflate: bool


def server_settings() -> ServerSettings:
    """What `uvicorn.Config` needs so that no client can hold the service up."""
    return {
        "http": ImpatientProtocol, "timeout_keep_alive": 5, "backlog": 128, "log_level": "warning",
        # A client that reads nothing for a minute has been left; and numbers from a sensor do not get shorter by
        # compression, which takes the time of 50 clients.
        "ws": LeavingProtocol, "ws_max_size": LARGEST_MESSAGE_BYTES, "ws_ping_timeout": 60.0,
        "ws_per_message_deflate": False,
    }  # fmt: skip
