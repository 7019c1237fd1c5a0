"""An OpenIGTLink server as PLUS is one: sends each tool as TRANSFORM, or tracking data where a client asks for them.

It answers in the header version that the client used last. A hidden tool is left out, as the standard asks.
"""

from collections.abc import Callable, Sequence

from drivers.openigtlink import codec
from drivers.poses import ToolPose
from drivers.roles import LinkCounters
from mock_devices.interfaces import NEVER_NS, TrackerPlant
from mock_devices.wire import OnWire, Wire

FRAME_HZ = 60
NAME = "MockTracker"
STATUS_OK = b"\0\x01" + bytes(28)


class OpenIgtLinkMock(OnWire):
    """The server; ``tools`` names the markers of ``plant`` in order, ``wall_ns`` gives seconds since 1970.

    Faults, to be set at any time: ``silent`` sends nothing; ``frozen`` repeats its last time; ``missing`` are indexes
    of tools that are hidden; ``corrupt_every`` spoils every n-th message; ``clockless`` sends 0 as time.
    """

    name = "tracker"

    def __init__(self, wire: Wire, plant: TrackerPlant, tools: Sequence[str], wall_ns: Callable[[int], int]) -> None:
        super().__init__(wire)
        self._plant, self._tools, self._wall_ns = plant, tuple(tools), wall_ns
        self.silent = self.frozen = self.clockless = False
        self.latency_ms = 0.0
        self.missing: set[int] = set()
        self.corrupt_every = 0
        self._decoder = codec.MessageDecoder(LinkCounters())
        self._version, self._sent = codec.PLAIN, 0
        self._period_ns = round(1e9 / FRAME_HZ)
        self._tracking_data = False
        self._due_ns, self._time_ns = NEVER_NS, 0

    @property
    def due_ns(self) -> int:
        """The next frame, while a client is there."""
        return self._due_ns

    def tick(self, now_ns: int) -> None:
        """Sends one frame."""
        self._due_ns = now_ns + self._period_ns if len(self.filenos()) > 1 else NEVER_NS
        if not self.frozen:
            self._time_ns = self._wall_ns(now_ns)
        seen = self._seen(now_ns)
        if self._tracking_data:
            self._send("TDATA", NAME, codec.encode_tools(seen))
        else:
            for tool, pose in seen:
                self._send("TRANSFORM", tool, codec.encode_transform(pose))

    def receive(self, now_ns: int) -> None:
        """Accepts a client, or obeys what it sent."""
        before = self._wire.filenos()
        messages = self._decoder.feed(self._wire.read())
        if self._wire.filenos() != before:
            self._version, self._tracking_data = codec.PLAIN, False
            self._period_ns, self._due_ns = round(1e9 / FRAME_HZ), now_ns
        for message in messages:
            self._version = message.version
            self._obey(message)

    def _obey(self, message: codec.TimedMessage) -> None:
        if message.kind == codec.START_TDATA:
            resolution_ms = codec.decode_resolution_ms(message.content)
            understood = resolution_ms is not None and resolution_ms > 0
            if resolution_ms and understood:
                self._tracking_data, self._period_ns = True, resolution_ms * 1_000_000
            self._send(codec.ANSWER_TDATA, NAME, b"\0" if understood else b"\x01")
        elif message.kind == codec.STOP_TDATA:
            self._tracking_data, self._period_ns = False, round(1e9 / FRAME_HZ)
            self._send(codec.ANSWER_TDATA, NAME, b"\0")
        elif message.kind == "GET_STATUS":
            self._send("STATUS", NAME, STATUS_OK)

    def _seen(self, now_ns: int) -> list[tuple[str, ToolPose]]:
        markers = enumerate(zip(self._tools, self._plant.markers(now_ns), strict=False))
        return [(tool, ToolPose(*marker)) for index, (tool, marker) in markers if marker and index not in self.missing]

    def _send(self, kind: str, device: str, content: bytes) -> None:
        self._sent += 1
        sent_ns = 0 if self.clockless else self._time_ns
        raw = codec.encode(kind, device, content, sent_ns, self._version, self._sent)
        if self.corrupt_every and self._sent % self.corrupt_every == 0:
            raw = raw[:-1] + bytes([raw[-1] ^ 0xFF])
        if not self.silent:
            self._wire.write(raw)
