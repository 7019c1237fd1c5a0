"""A tracker behind OpenIGTLink: connects, asks for tracking data where that is wanted, and gathers tools into frames.

The protocol has neither frame numbers nor an identity: tools with the same time of sending are one frame, frames are
counted here, and the address stands for the serial number.
"""

import contextlib
import time
from collections.abc import Callable, Iterable
from functools import partial

from drivers.openigtlink import codec
from drivers.ports import Port, open_port, read_until
from drivers.poses import PoseFrames, ToolPose
from drivers.roles import Identity, LinkCounters
from drivers.sampled import SampledTracker
from rig.channels import MarkerSample
from rig.config.products.openigtlink import OpenIgtLinkWiring
from rig.errors import DeviceError

FIRST_TOOL_S = 3.0  # a server that begins to track on STT_TDATA starts its cameras first
# Sixty frames of a usual tracker; a server whose tools are all hidden may send nothing, which is told as loss too.
LOST_AFTER_NS = 1_000_000_000
# Tools of one frame have one time; senders that stamp each by itself do so within a millisecond or two.
SAME_FRAME = 0.5
STREAM_NAME = "tissue-rig"
NAMES_TOLD = 8


class FrameGatherer:
    """Messages of one tool, or of several, to frames: ``add`` returns those that are complete."""

    def __init__(self, config: OpenIgtLinkWiring) -> None:
        self._tools = set(config.tools)
        self._period_ns = round(1e9 / config.rate_Hz)
        self._sent_ns = 0
        self._poses: dict[str, ToolPose | None] = {}

    def add(
        self, sent_ns: int, seen: dict[str, ToolPose | None], whole: bool
    ) -> Iterable[tuple[int, dict[str, ToolPose]]]:
        """(time, poses) of each frame that ends with this message; ``whole`` messages are frames by themselves."""
        if whole:
            yield sent_ns, _tracked(seen)
            return
        if self._poses and (self._poses.keys() & seen.keys() or not self._belongs(sent_ns)):
            yield self._end()
        if not self._poses:
            self._sent_ns = sent_ns
        self._poses.update(seen)
        if self._poses.keys() >= self._tools:
            yield self._end()

    def _belongs(self, sent_ns: int) -> bool:
        return abs(sent_ns - self._sent_ns) < SAME_FRAME * self._period_ns

    def _end(self) -> tuple[int, dict[str, ToolPose]]:
        poses, self._poses = self._poses, {}
        return self._sent_ns, _tracked(poses)


def _tracked(poses: dict[str, ToolPose | None]) -> dict[str, ToolPose]:
    return {tool: pose for tool, pose in poses.items() if pose is not None}


class OpenIgtLinkTracker(SampledTracker):
    """A marker tracker (role ``drivers.roles.MarkerTracker``); nothing is opened before ``start``."""

    _config: OpenIgtLinkWiring
    _samples: PoseFrames

    def __init__(
        self, open_port: Callable[[], Port], config: OpenIgtLinkWiring, now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self.counters = LinkCounters()
        self._open_port, self._config, self._now = open_port, config, now
        self._samples = PoseFrames(config, self.counters)
        self._port: Port | None = None
        self._identity = Identity("", "", "")

    def fileno(self) -> int:
        """Descriptor of the connection."""
        return self._started().fileno()

    def start(self) -> None:
        """Connects, asks for tracking data where configured, waits for a named tool; raises DeviceError without one."""
        self.close()
        self._port = self._open_port()
        self._decoder = codec.MessageDecoder(self.counters)
        self._gatherer = FrameGatherer(self._config)
        self._samples.restart()
        self._number, self._heard_ns = 0, self._now()
        self._waiting: list[codec.TimedMessage] = []
        try:
            self._tell(codec.START_TDATA, codec.encode_start(round(1000 / self._config.rate_Hz)))
            self._await_tool(self._port)
        except BaseException:
            self.close()
            raise

    def poll(self, now_ns: int) -> list[MarkerSample]:
        """Samples of the frames completed since the last call; raises DeviceError after a second without any tool."""
        messages, self._waiting = [*self._waiting, *self._decoder.feed(self._started().read())], []
        samples = [sample for message in messages for sample in self._take(message, now_ns)]
        if now_ns - self._heard_ns > LOST_AFTER_NS:
            raise DeviceError(
                f"{self._config.port}: no tool came for {LOST_AFTER_NS / 1e9:g} s; check the tracker behind the server"
            )
        return samples

    def close(self) -> None:
        """Ends the tracking data that were asked for, and the connection."""
        port = self._port
        if port is not None:
            with contextlib.suppress(DeviceError):
                self._tell(codec.STOP_TDATA, b"")
            port.close()
        self._port = None

    def _started(self) -> Port:
        if self._port is None:
            raise DeviceError(f"tracker on {self._config.port}: not started; call start first")
        return self._port

    def _tell(self, kind: str, content: bytes) -> None:
        if self._config.stream == "TDATA":
            version = codec.WITH_EXTENDED if self._config.version == 3 else codec.PLAIN
            self._started().write(codec.encode(kind, STREAM_NAME, content, version=version))

    def _await_tool(self, port: Port) -> None:
        """Keeps what came for ``poll``."""
        deadline_ns = self._now() + round(FIRST_TOOL_S * 1e9)
        seen: dict[str, None] = {}
        while not seen.keys() & set(self.tools):
            left_s = (deadline_ns - self._now()) * 1e-9
            if left_s <= 0:
                raise self._no_tool(seen)
            self._waiting += self._decoder.feed(read_until(port, bool, left_s))
            seen |= dict.fromkeys(tool for message in self._waiting for tool in codec.tools_in(message))
        newest = next(message for message in reversed(self._waiting) if codec.tools_in(message))
        settings = {"stream": newest.kind, "clock": "sender's" if newest.sent_ns else "none: time of arrival"}
        address = self._config.port.removeprefix("tcp://")
        self._identity = Identity(self._config.product, address, f"header version {newest.version}", settings)

    def _no_tool(self, seen: dict[str, None]) -> DeviceError:
        wanted = ", ".join(self.tools)
        others = f"; it sends {', '.join(list(seen)[:NAMES_TOLD])}: name those in tracker.tools" if seen else ""
        return DeviceError(
            f"{self._config.port}: no {self._config.stream} message of {wanted} within {FIRST_TOOL_S:g} s{others};"
            " check that the server tracks, and tracker.stream"
        )

    def _take(self, message: codec.TimedMessage, now_ns: int) -> list[MarkerSample]:
        seen = {tool: pose for tool, pose in codec.tools_in(message).items() if tool in self.tools}
        whole = message.kind == "TDATA"
        if not seen and not whole:
            return []
        self._heard_ns = now_ns
        sent_ns = message.sent_ns or now_ns
        return [
            sample
            for taken_ns, poses in self._gatherer.add(sent_ns, seen, whole)
            for sample in self._samples_of(taken_ns, poses, now_ns)
        ]

    def _samples_of(self, taken_ns: int, poses: dict[str, ToolPose], now_ns: int) -> list[MarkerSample]:
        self._number += 1
        return self._samples.samples(self._number, taken_ns, poses, now_ns)


def open_tracker(config: OpenIgtLinkWiring) -> OpenIgtLinkTracker:
    """The tracker at the configured address, to which ``start`` connects."""
    return OpenIgtLinkTracker(partial(open_port, config.port, 0), config)
