"""A node on any bus of python-can: frames instead of an adapter's lines, for mocks on `udp_multicast`."""

from collections import deque
from typing import Protocol

import can

from drivers.can.slcan import CanFrame

ECHOES_LARGEST = 256  # more than a node sends before it looks again


class BusAdapter(Protocol):
    """What is between a mock node and whoever talks to it over CAN."""

    def receive(self) -> list[CanFrame]:
        """Frames for the node since the last call."""

    def send(self, can_id: int, data: bytes, now_ns: int) -> None:
        """A frame of the node."""

    def flush(self) -> None:
        """Hands over what was sent."""


class BusNode:
    """The mock node's end of ``bus``, which may hand back what was sent; both Wire and BusAdapter of a mock."""

    def __init__(self, bus: can.BusABC) -> None:
        self.endpoint = str(bus.channel_info)
        self._bus = bus
        self._own: deque[tuple[int, bytes]] = deque(maxlen=ECHOES_LARGEST)

    def filenos(self) -> list[int]:
        """Descriptor to wait on."""
        return [self._bus.fileno()]

    def read(self) -> bytes:
        """A bus has frames, no bytes."""
        return b""

    def write(self, data: bytes) -> None:
        """A bus has frames, no bytes."""

    def receive(self) -> list[CanFrame]:
        """Frames of others since the last call."""
        frames = []
        while (message := self._bus.recv(0)) is not None:
            key = (message.arbitration_id, bytes(message.data))
            if key in self._own:
                self._own.remove(key)
            elif not message.is_error_frame:
                frames.append(CanFrame(key[0], key[1], message.is_extended_id, message.is_remote_frame))
        return frames

    def send(self, can_id: int, data: bytes, now_ns: int) -> None:  # noqa: ARG002 - this adapter stamps nothing
        """A frame of the node, which leaves at once."""
        self._own.append((can_id, data))
        self._bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def flush(self) -> None:
        """Nothing waits."""

    def close(self) -> None:
        """Leaves the bus."""
        self._bus.shutdown()
