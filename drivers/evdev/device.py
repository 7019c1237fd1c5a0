"""A foot switch in the role of input: a sample whenever its key goes down or comes up."""

from collections.abc import Sequence

from drivers.evdev.codec import EventParser, KeyChange
from drivers.evdev.port import EventPort, open_device, path_of
from drivers.roles import Identity, LinkCounters
from rig.config.products.evdev_switch import EvdevSwitch
from rig.input_streams import InputSample

UNKNOWN_NS = -1
BY_NAME = "name:"


class FootSwitch:
    """Owns ``port`` until ``close``."""

    period_ns = 0

    def __init__(self, port: EventPort, config: EvdevSwitch) -> None:
        self.counters, self.next_seq = LinkCounters(), 0
        self.identity = Identity(config.product, "", "", {"path": port.path})
        self._port, self._key = port, config.key_code
        self._parser = EventParser()

    def start(self) -> None:
        """It sends by itself; its times are asked for by the host's clock."""
        self._on_host_clock = self._port.use_host_clock()

    def fileno(self) -> int:
        """Descriptor that turns readable when a key may have changed."""
        return self._port.fileno()

    def poll(self, now_ns: int) -> Sequence[InputSample]:
        """Changes since the last call."""
        changes = self._parser.changes(self._port.read())
        self.counters.frames += len(changes)
        return [self._sample(change, now_ns) for change in changes if self._key in (None, change.code)]

    def _sample(self, change: KeyChange, now_ns: int) -> InputSample:
        """The kernel's time where that is the host's clock; else a time of day, and capture is arrival."""
        seq, self.next_seq = self.next_seq, self.next_seq + 1
        known = self._on_host_clock
        capture_ns = min(change.at_ns, now_ns) if known else now_ns
        clock = (change.at_ns, capture_ns - change.at_ns, 0 if known else UNKNOWN_NS)
        return InputSample(seq, capture_ns, now_ns, *clock, (float(change.down), float(change.code)), 0, 1)

    def concern(self) -> str:
        """Nothing: it is there or it is gone."""
        return ""

    def close(self) -> None:
        """Gives the device back."""
        self._port.close()


def open_switch(config: EvdevSwitch) -> FootSwitch:
    """The switch by its name or port, grabbed, not yet started."""
    named = config.port.startswith(BY_NAME)
    path = path_of(config.port.removeprefix(BY_NAME)) if named else config.port
    return FootSwitch(EventPort(path, open_device(path, "switch"), "the switch"), config)
