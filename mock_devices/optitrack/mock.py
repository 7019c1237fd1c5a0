"""A Motive that streams NatNet in unicast to whoever connected last, for as long as it hears from there.

Checked against the package `natnet`, unchanged. Commands other than FrameRate are answered as not recognised.
"""

import struct
from collections.abc import Sequence

from drivers.optitrack.packets import (
    CONNECT,
    ECHO_REQUEST,
    ECHO_RESPONSE,
    FRAME,
    KEEP_ALIVE,
    MODELS,
    REQUEST,
    REQUEST_MODELS,
    RESPONSE,
    SERVER_INFO,
    UNRECOGNISED,
    BadPacket,
    encode_packet,
    split,
)
from mock_devices.interfaces import NEVER_NS, TrackerPlant
from mock_devices.optitrack import packets
from mock_devices.optitrack.packets import TICKS_HZ, Version
from mock_devices.wire import OnWire, Wire

FRAME_HZ = 120
# Ten of the keep-alives of Motive's own clients.
DESERTED_NS = 10_000_000_000
DATA_PORT = 1511


class OptiTrackMock(OnWire):
    """The server; ``tools`` names the markers of ``plant`` in order.

    Faults, to be set at any time: ``silent`` sends nothing; ``frozen`` repeats its last frame; ``missing`` are indexes
    of bodies that are not tracked; ``corrupt_every`` cuts every n-th frame short; ``unknown`` speaks NatNet 2.
    """

    name = "tracker"

    def __init__(
        self, wire: Wire, plant: TrackerPlant, start_ns: int, tools: Sequence[str], version: Version = (4, 1)
    ) -> None:
        super().__init__(wire)
        self.latency_ms = 0.0
        self._plant, self._start_ns, self._tools, self._version = plant, start_ns, tuple(tools), version
        self.silent = self.frozen = self.unknown = False
        self.missing: set[int] = set()
        self.corrupt_every = 0
        self._heard_ns, self._due_ns, self._number, self._sent = start_ns, NEVER_NS, 0, 0
        self._frame = b""

    def endpoints(self) -> dict[str, str]:
        """Where it is asked."""
        return {"udp": self._wire.endpoint}

    @property
    def due_ns(self) -> int:
        """The next frame, while somebody listens."""
        return self._due_ns

    def tick(self, now_ns: int) -> None:
        """Sends one frame."""
        self._due_ns = now_ns + 1_000_000_000 // FRAME_HZ if now_ns - self._heard_ns < DESERTED_NS else NEVER_NS
        if not self.frozen or not self._frame:
            self._number = (now_ns - self._start_ns) * FRAME_HZ // 1_000_000_000
            ticks = (now_ns - self._start_ns) * TICKS_HZ // 1_000_000_000
            seen = [
                None if index in self.missing else marker for index, marker in enumerate(self._plant.markers(now_ns))
            ]
            self._frame = encode_packet(FRAME, packets.frame(self._number, seen, ticks, self._version))
        self._sent += 1
        cut = bool(self.corrupt_every) and self._sent % self.corrupt_every == 0
        self._send(self._frame[: len(self._frame) // 2] if cut else self._frame)

    def receive(self, now_ns: int) -> None:
        """Answers each datagram."""
        while datagram := self._wire.read():
            try:
                self._obey(*split(datagram), now_ns)
            except (BadPacket, struct.error):
                continue

    def _obey(self, message: int, payload: bytes, now_ns: int) -> None:
        self._heard_ns = now_ns
        if message in (CONNECT, KEEP_ALIVE) and self._due_ns == NEVER_NS:
            self._due_ns = now_ns
        if message == CONNECT:
            version = (2, 10) if self.unknown else self._version
            self._send(encode_packet(SERVER_INFO, packets.server_information(version, DATA_PORT)))
        elif message == REQUEST_MODELS:
            self._send(encode_packet(MODELS, packets.models(self._tools, self._version)))
        elif message == REQUEST:
            known = payload.startswith(b"FrameRate")
            self._send(encode_packet(RESPONSE, struct.pack("<f", FRAME_HZ)) if known else encode_packet(UNRECOGNISED))
        elif message == ECHO_REQUEST:
            ticks = (now_ns - self._start_ns) * TICKS_HZ // 1_000_000_000
            self._send(encode_packet(ECHO_RESPONSE, payload[:8] + struct.pack("<Q", ticks)))

    def _send(self, datagram: bytes) -> None:
        if not self.silent:
            self._wire.write(datagram)
