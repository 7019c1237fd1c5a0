"""The session with an NDI tracker: start, then one question at a time, never waiting for its answer.

The tracker does not stream: each BX or TX brings the newest frame. A question goes out as soon as the last is answered,
but no sooner than a new frame can be there; the frame number tells what is new and when it was taken.
"""

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from drivers.ndi import codec, replies, startup
from drivers.ndi.frames import FrameReader
from drivers.ports import Port, open_port
from drivers.roles import Identity, LinkCounters
from drivers.sampled import SampledTracker
from rig.channels import MarkerSample
from rig.config.products.ndi_polaris import PolarisWiring
from rig.errors import DeviceError

REPLY_TIMEOUT_NS = 200_000_000
"""After this a question is asked again; the longest BX reply takes 90 ms at 115200 baud."""
LOST_AFTER_NS = 1_000_000_000
"""After this without any good reply the tracker is given up: five questions."""
_CLOSE_S = 0.5


class NdiTracker(SampledTracker):
    """A marker tracker (role ``drivers.roles.MarkerTracker``).

    ``open_port`` gives the port at a speed in baud, which TCP passes over; ``now`` is the host's monotonic clock [ns].
    """

    _config: PolarisWiring
    _samples: FrameReader
    _identity: Identity | None  # type: ignore[assignment] # None until it is known

    def __init__(
        self, open_port: Callable[[int], Port], config: PolarisWiring, now: Callable[[], int] = time.monotonic_ns
    ) -> None:
        self.counters = LinkCounters()
        self._open_port = open_port
        self._config = config
        self._now = now
        self._question = codec.encode_command(config.reply, f"{replies.TRANSFORMS:04X}")
        self._decoder = codec.ReplyDecoder()
        self._samples = FrameReader((), config, self.counters)
        self._dialogue: startup.Dialogue | None = None
        self._identity: Identity | None = None
        self._waiting = False
        self._asked_ns = self._due_ns = 0
        self._silent_since_ns: int | None = None

    @property
    def identity(self) -> Identity:
        """Known after ``start``."""
        if self._identity is None:
            raise DeviceError(f"tracker on {self._config.port}: not started; call start first")
        return self._identity

    @property
    def _port(self) -> Port:
        if self._dialogue is None:
            raise DeviceError(f"tracker on {self._config.port}: not started; call start first")
        return self._dialogue.port

    def fileno(self) -> int:
        """Descriptor that turns readable when a reply may have come."""
        return self._port.fileno()

    def start(self) -> None:
        """Initialises the tracker, loads and enables the tools, starts tracking; takes seconds.

        Raises DeviceError (silent, another device, refused) or UsageError (tool definitions), the port closed again.
        """
        self.close()
        roms = startup.read_roms(self._config.roms, self.tools)
        self._decoder.reset()
        self._dialogue = startup.Dialogue(self._open_port(startup.POWER_UP_BAUD), self._decoder, self._now)
        try:
            self._converse(self._dialogue, roms)
        except BaseException:
            self.close()
            raise

    def identify(self) -> Identity:
        """Who is there, whatever tools it has; none is loaded, and none let go."""
        with contextlib.closing(self._open_port(startup.POWER_UP_BAUD)) as port:
            dialogue = startup.Dialogue(port, codec.ReplyDecoder(), self._now)
            startup.initialise(dialogue)
            return startup.identify(dialogue)

    def _converse(self, dialogue: startup.Dialogue, roms: Sequence[bytes]) -> None:
        startup.initialise(dialogue)
        identity = startup.identify(dialogue)
        startup.speed_up(dialogue)
        handles = startup.load_tools(dialogue, roms, self.tools)
        startup.start_tracking(dialogue)
        settings = {"reply": self._config.reply, "warnings": " ".join(dialogue.warnings)}
        self._identity = replace(identity, settings=identity.settings | settings)
        self._samples = FrameReader(handles, self._config, self.counters, self.next_seq)
        self._waiting = False
        self._asked_ns = self._due_ns = 0
        self._silent_since_ns = None
        self._count_link()

    def close(self) -> None:
        """Stops tracking and gives the port back; never raises, waits a second at most."""
        dialogue, self._dialogue = self._dialogue, None
        if dialogue is not None:
            with contextlib.suppress(DeviceError):
                startup.leave(dialogue, _CLOSE_S)
            dialogue.port.close()

    def poll(self, now_ns: int) -> list[MarkerSample]:
        """One sample a tool for each new frame; raises DeviceError when the tracker is lost, refuses or restarts."""
        samples: list[MarkerSample] = []
        data = self._port.read()
        if data:
            damaged = self._decoder.checksum_errors
            for reply in self._decoder.feed(data):
                samples += self._take(reply, now_ns)
            if self._decoder.checksum_errors != damaged:
                self._waiting = False
            self._count_link()
        self._keep_asking(now_ns)
        return samples

    def _count_link(self) -> None:
        self.counters.checksum_errors = self._decoder.checksum_errors
        self.counters.discarded_bytes = self._decoder.discarded_bytes

    def _keep_asking(self, now_ns: int) -> None:
        if self._waiting and now_ns - self._asked_ns >= REPLY_TIMEOUT_NS:
            self._decoder.reset()
            self._waiting = False
        since_ns = self._silent_since_ns
        if since_ns is not None and now_ns - since_ns >= LOST_AFTER_NS:
            raise DeviceError(
                f"{self._port.address}: the tracker gave no good reply to {self._config.reply} for"
                f" {LOST_AFTER_NS / 1e9:g} s, asked again every {REPLY_TIMEOUT_NS / 1e9:g} s; check power and cable"
            )
        if not self._waiting and now_ns >= self._due_ns:
            self._port.write(self._question)
            self._waiting = True
            # A host that was interrupted since it looked at its clock asks later than it thinks.
            self._asked_ns = max(now_ns, self._now())
            self._silent_since_ns = now_ns if since_ns is None else since_ns

    def _take(self, reply: codec.Reply, now_ns: int) -> list[MarkerSample]:
        tracking = self._parse(reply)
        self._waiting = False
        if tracking is None:
            self._decoder.discarded_bytes += len(reply[0])
            return []
        self._silent_since_ns = None
        samples = self._samples.samples(tracking, self._asked_ns, now_ns)
        # The next frame is one period away: look shortly before, then often, so that it is met soon after it is there.
        self._due_ns = self._asked_ns + (self.period_ns * 3 // 4 if samples else self.period_ns // 8)
        return samples

    def _parse(self, reply: codec.Reply) -> replies.TrackingReply | None:
        if isinstance(reply, codec.BinaryReply):
            return replies.parse_bx(reply.body)
        code = replies.parse_error(reply.text)
        if code is not None:
            raise DeviceError(
                f"{self._port.address}: the tracker refused {self._config.reply} ({replies.error_words(code)});"
                " start it again"
            )
        if reply.text == "RESET":
            raise DeviceError(f"{self._port.address}: the tracker has restarted by itself; check its power")
        return replies.parse_tx(reply.text)


def open_tracker(config: PolarisWiring) -> NdiTracker:
    """The tracker at the configured port, which ``start`` opens."""
    return NdiTracker(partial(open_port, config.port), config)
