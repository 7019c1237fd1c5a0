"""What can go wrong with a wire, as knobs on a wrapper around it, and by name for tests and the control channel.

Faults of the devices themselves stand in `device_faults.py`.
"""

import random
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import Generic, NamedTuple, TypeVar

from mock_devices.interfaces import NEVER_NS
from mock_devices.wire import Pluggable, Wire
from rig.errors import UsageError

GARBAGE_BYTES = 23
S_TO_NS = 1e9

Value = bool | float | str
Target = TypeVar("Target")


class FaultyWire:
    """A wire that does what its knobs say; with all of them at rest it is the wire inside.

    Shares are of writes: a mock writes one message at a time. Damage acts on what the device sends; only ``frozen``
    also keeps the client's bytes from it. A delayed write leaves at ``tick``.
    """

    def __init__(self, wire: Wire, rng: random.Random, clock_ns: Callable[[], int]) -> None:
        self.endpoint = wire.endpoint
        self._wire = wire
        self._rng = rng
        self._clock_ns = clock_ns
        self._late: deque[tuple[int, bytes]] = deque()
        self._unheard = b""
        self.heal()

    def heal(self) -> None:
        """All knobs to rest; what was delayed leaves at the next tick, and a cut wire stays cut."""
        self.frozen = False
        self.drop_share = self.corrupt_share = self.truncate_share = self.garbage_share = 0.0
        self.delay_s = 0.0

    def filenos(self) -> list[int]:
        """Descriptors to wait on."""
        return self._wire.filenos()

    def read(self) -> bytes:
        """What the client sent."""
        data = self._unheard or self._wire.read()
        self._unheard = b""
        return b"" if self.frozen else data

    def put_back(self, data: bytes) -> None:
        """The next ``read`` brings ``data`` and no more."""
        self._unheard = data

    def write(self, data: bytes) -> None:
        """Sends to the client what the faults leave of ``data``."""
        data = self._damaged(data)
        if self.delay_s or self._late:
            self._late.append((self._clock_ns() + round(self.delay_s * S_TO_NS), data))
        elif data:
            self._wire.write(data)

    def close(self) -> None:
        """Cuts the wire for good."""
        self._late.clear()
        self._wire.close()

    def plug(self) -> None:
        """In again after ``close``; raises UsageError where this wire has no plug."""
        if not isinstance(self._wire, Pluggable):
            raise UsageError("this wire has no plug")
        self._wire.plug()

    @property
    def due_ns(self) -> int:
        """When the next delayed write leaves."""
        return self._late[0][0] if self._late else NEVER_NS

    def tick(self, now_ns: int) -> None:
        """Lets go what was delayed long enough."""
        while self._late and self._late[0][0] <= now_ns:
            self._wire.write(self._late.popleft()[1])

    def _damaged(self, data: bytes) -> bytes:
        if self.frozen or self._happens(self.drop_share):
            return b""
        if data and self._happens(self.truncate_share):
            data = data[: self._rng.randrange(len(data))]
        if data and self._happens(self.corrupt_share):
            at = self._rng.randrange(len(data))
            data = data[:at] + bytes([data[at] ^ (1 << self._rng.randrange(8))]) + data[at + 1 :]
        if self._happens(self.garbage_share):
            data = self._rng.randbytes(GARBAGE_BYTES) + data
        return data

    def _happens(self, share: float) -> bool:
        return share > 0 and self._rng.random() < share


class Fault(NamedTuple):
    """One fault of one wire or device: what it does, the value where none is given, and how it is brought about."""

    meaning: str
    default: Value
    apply: Callable[[Value], None]


class FaultKind(NamedTuple, Generic[Target]):
    """A fault that any wire, or any device of one product, can have."""

    meaning: str
    default: Value
    apply: Callable[[Target, Value], None]

    def of(self, target: Target) -> Fault:
        """The same for ``target``."""
        return Fault(self.meaning, self.default, partial(self.apply, target))


def faults_of(target: Target, kinds: Mapping[str, FaultKind[Target]]) -> dict[str, Fault]:
    """All ``kinds`` for ``target``, by name."""
    return {name: kind.of(target) for name, kind in kinds.items()}


def as_switch(value: Value) -> bool:
    """``value`` as on or off; raises UsageError."""
    if isinstance(value, bool):
        return value
    raise UsageError(f"this fault is switched with true or false, not with {value!r}")


def as_number(value: Value, low: float, high: float) -> float:
    """``value`` within bounds; raises UsageError."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise UsageError(f"this fault takes a number from {low:g} to {high:g}, not {value!r}")
    return float(value)


def switching(attribute: str) -> Callable[[object, Value], None]:
    """What sets ``attribute`` of a wire or device to on or off."""
    return lambda target, value: setattr(target, attribute, as_switch(value))


def setting(attribute: str, high: float) -> Callable[[object, Value], None]:
    """What sets ``attribute`` of a wire or device to a number from 0 to ``high``."""
    return lambda target, value: setattr(target, attribute, as_number(value, 0, high))


def _cut(wire: FaultyWire, value: Value) -> None:
    if as_switch(value):
        wire.close()


def _unplug(wire: FaultyWire, value: Value) -> None:
    if as_switch(value):
        wire.close()
    else:
        wire.plug()


def _heal(wire: FaultyWire, value: Value) -> None:
    if as_switch(value):
        wire.heal()


WIRE_FAULTS: Mapping[str, FaultKind[FaultyWire]] = {
    "cut": FaultKind("the cable is pulled: the client sees a hang-up; for good", True, _cut),
    "unplug": FaultKind("the cable is pulled, and with false plugged in again under the same address", True, _unplug),
    "freeze": FaultKind(
        "nothing passes any more in either direction, though the line stays open", True, switching("frozen")
    ),
    "drop": FaultKind("this share of messages is lost", 0.1, setting("drop_share", 1)),
    "corrupt": FaultKind("one bit is flipped in this share of messages", 0.1, setting("corrupt_share", 1)),
    "truncate": FaultKind("this share of messages ends too early", 0.1, setting("truncate_share", 1)),
    "garbage": FaultKind("this share of messages has random bytes in front of it", 0.1, setting("garbage_share", 1)),
    "delay": FaultKind("messages arrive this many seconds late", 0.05, setting("delay_s", 10)),
    "heal": FaultKind("the wire is well again, unless it was cut", True, _heal),
}
