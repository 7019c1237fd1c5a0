"""OptiTrack cameras in the role of marker tracker: Motive is asked who it is and for its bodies, then its frames come.

A tool is a rigid body by its name, or one of its markers as ``Body/2``. In unicast, which is what this asks for, Motive
goes on sending for as long as it hears from us.
"""

import select
import time
from collections.abc import Callable, Iterator
from typing import Protocol

from drivers.optitrack import packets
from drivers.optitrack.frames import MotiveFrame, decode_frame
from drivers.optitrack.link import MotiveLink
from drivers.optitrack.models import decode_models
from drivers.poses import PoseFrames, ToolPose
from drivers.roles import Identity, LinkCounters
from drivers.sampled import SampledTracker
from rig.channels import MarkerSample
from rig.config.products.optitrack_natnet import NatNetWiring
from rig.errors import DeviceError

ANSWER_S, TRIES = 0.5, 4  # a datagram may be lost; Motive answers within a frame
LOST_AFTER_NS = 1_000_000_000
KEEP_ALIVE_NS = 1_000_000_000  # Motive's own clients send it every second
LAYOUTS = (3, 4)
NAMES_TOLD = 8


class DatagramLink(Protocol):
    """A link that carries whole datagrams."""

    def fileno(self) -> int:
        """Descriptor to wait on."""

    def datagrams(self) -> Iterator[bytes]:
        """What has come."""

    def send(self, datagram: bytes) -> None:
        """Sends one."""

    def close(self) -> None:
        """Gives it back."""


class OptiTrackTracker(SampledTracker):
    """A marker tracker (role ``drivers.roles.MarkerTracker``); nothing is opened before ``start``."""

    _config: NatNetWiring
    _samples: PoseFrames

    def __init__(
        self, open_link: Callable[[], DatagramLink], config: NatNetWiring, now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self.counters = LinkCounters()
        self._open_link, self._config, self._now = open_link, config, now
        self._samples = PoseFrames(config, self.counters)
        self._link: DatagramLink | None = None
        self._server = packets.ServerInfo("", "", (0, 0), 0)
        self._bodies: dict[str, int] = {}
        self._newest: MotiveFrame | None = None
        self._heard_ns = self._told_ns = 0

    @property
    def identity(self) -> Identity:
        """Known after ``start``."""
        server = self._server
        if not server.name:
            return Identity("", "", "")
        natnet = ".".join(map(str, server.natnet))
        settings = {"natnet": natnet, "clock": f"{server.ticks_Hz} Hz"}
        address = self._config.port.removeprefix("udp://")
        return Identity(self._config.product, address, f"{server.name} {server.version}", settings)

    def fileno(self) -> int:
        """Descriptor of the socket."""
        return self._started().fileno()

    def start(self) -> None:
        """Asks who streams and which bodies there are, waits for a frame; raises DeviceError in one sentence."""
        self._samples.restart()
        self._bodies, self._newest = {}, None
        try:
            self._connect()
            wanted = packets.encode_packet(packets.REQUEST_MODELS)
            self._ask(wanted, lambda: bool(self._bodies), "its rigid bodies", "that a rigid body is defined and it")
            self._refuse_tools()
            self._ask(packets.encode_packet(packets.KEEP_ALIVE), lambda: self._newest is not None, "a frame", "that it")
        except BaseException:
            self.close()
            raise
        self._heard_ns = self._told_ns = self._now()

    def identify(self) -> Identity:
        """Who streams, whatever its bodies are called."""
        try:
            self._connect()
        finally:
            self.close()
        return self.identity

    def _connect(self) -> None:
        self.close()
        self._link = self._open_link()
        self._server = self._server._replace(name="")
        self._ask(packets.encode_connect(), lambda: bool(self._server.name), "who it is", "its address, that it")
        self._refuse_layout()

    def poll(self, now_ns: int) -> list[MarkerSample]:
        """Samples of the frames that came since the last call; raises DeviceError after a second without any."""
        samples: list[MarkerSample] = []
        frames = list(self._received())
        for more, frame in zip(reversed(range(len(frames))), frames, strict=True):
            self._heard_ns = now_ns
            samples += self._samples.samples(frame.number, self._taken_ns(frame), self._poses(frame), now_ns, more)
        if now_ns - self._heard_ns > LOST_AFTER_NS:
            raise DeviceError(
                f"{self._config.port}: no frame for {LOST_AFTER_NS / 1e9:g} s; check Motive's streaming and the network"
            )
        if now_ns - self._told_ns > KEEP_ALIVE_NS:
            self._told_ns = now_ns
            self._started().send(packets.encode_packet(packets.KEEP_ALIVE))
        return samples

    def close(self) -> None:
        """Gives the socket back; Motive stops sending once it hears nothing more."""
        if self._link is not None:
            self._link.close()
        self._link = None

    def _started(self) -> DatagramLink:
        if self._link is None:
            raise DeviceError(f"tracker on {self._config.port}: not started; call start first")
        return self._link

    def _received(self) -> Iterator[MotiveFrame]:
        """Frames among what has come; what else came is taken down."""
        for datagram in self._started().datagrams():
            try:
                frame = self._take(*packets.split(datagram))
            except packets.BadPacket:
                self.counters.checksum_errors += 1
                self.counters.discarded_bytes += len(datagram)
                continue
            if frame is not None:
                yield frame

    def _take(self, message: int, payload: bytes) -> MotiveFrame | None:
        if message == packets.SERVER_INFO:
            self._server = packets.decode_server(payload)
        elif message == packets.MODELS:
            self._bodies = decode_models(payload, self._server.natnet)
        elif message == packets.FRAME and self._server.name:
            return decode_frame(payload, self._server.natnet)
        return None

    def _ask(self, question: bytes, answered: Callable[[], bool], what: str, check: str) -> None:
        """Sends ``question`` until it is ``answered``; frames that come meanwhile are looked at and not kept."""
        link = self._started()
        for _ in range(TRIES):
            link.send(question)
            deadline_ns = self._now() + round(ANSWER_S * 1e9)
            while (left_s := (deadline_ns - self._now()) * 1e-9) > 0:
                select.select([link.fileno()], [], [], left_s)
                for frame in self._received():
                    self._newest = frame
                if answered():
                    return
        raise DeviceError(
            f"{self._config.port}: Motive did not say {what} in {TRIES} tries of {ANSWER_S:g} s; check {check} streams"
            " in unicast, and the firewall"
        )

    def _refuse_layout(self) -> None:
        if self._server.natnet[0] not in LAYOUTS:
            natnet = ".".join(map(str, self._server.natnet))
            raise DeviceError(
                f"{self._config.port}: {self._server.name} streams NatNet {natnet}, and 3 or 4 is understood; set the"
                " version in Motive's streaming settings"
            )

    def _refuse_tools(self) -> None:
        unknown = [tool for tool in self.tools if tool.partition("/")[0] not in self._bodies]
        if unknown:
            there = ", ".join(list(self._bodies)[:NAMES_TOLD])
            raise DeviceError(
                f"{self._config.port}: Motive has no rigid body {unknown[0].partition('/')[0]!r}; it has {there}: name"
                " those in tracker.tools"
            )

    def _taken_ns(self, frame: MotiveFrame) -> int:
        """By the cameras' own clock where there is one, by Motive's time of the frame, or by its number."""
        if frame.ticks and self._server.ticks_Hz:
            return frame.ticks * 1_000_000_000 // self._server.ticks_Hz
        if frame.timestamp_s > 0:
            return round(frame.timestamp_s * 1e9)
        return frame.number * self.period_ns

    def _poses(self, frame: MotiveFrame) -> dict[str, ToolPose]:
        found: dict[str, ToolPose] = {}
        for tool in self.tools:
            body, _, marker = tool.partition("/")
            number = self._bodies.get(body, -1)
            pose = frame.markers.get((number, int(marker))) if marker else frame.bodies.get(number)
            if pose:
                found[tool] = pose
        return found


def open_tracker(config: NatNetWiring) -> OptiTrackTracker:
    """The tracker at the configured address, which ``start`` asks."""
    return OptiTrackTracker(lambda: MotiveLink(config.port), config)
